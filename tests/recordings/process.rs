//! Tanks, coupled drives and a hair dryer, through the command line.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::folder::{Folder, columns, effects, json};
use crate::recordings;

/// Root mean square of the difference of the outputs of two files, over rows `from..to`.
fn error(simulated: &Path, recorded: &Path, rows: std::ops::Range<usize>) -> f64 {
    let output = |path: &Path| {
        let (header, data) = columns(&fs::read_to_string(path).unwrap());
        let at = header.iter().position(|h| h.starts_with("y1")).unwrap();
        data[at].clone()
    };
    let (a, b) = (output(simulated), output(recorded));
    let squares: f64 = rows.clone().map(|k| (a[k] - b[k]).powi(2)).sum();
    (squares / rows.len() as f64).sqrt()
}

/// Simulates the explanation on a recording, from an estimated initial state.
fn simulated(folder: &Folder, explanation: &str, input: &str) -> PathBuf {
    folder
        .run(&[
            "simulate",
            explanation,
            input,
            "--initial-state",
            "estimate",
            "--output",
            "prediction.csv",
        ])
        .ok();
    folder.join("prediction.csv")
}

fn numbers(effect: &Value) -> Vec<(f64, f64)> {
    effect["parameters"]
        .as_object()
        .unwrap()
        .values()
        .map(|q| (q["value"].as_f64().unwrap(), q["std"].as_f64().unwrap()))
        .collect()
}

/// Two tanks: the root and both rims, whether the simulation is a model or its column. A linear model reaches 0.59 V on the
/// other recording, published nonlinear ones 0.34 to 0.45 V.
#[test]
fn cascaded_tanks() {
    let Some(from) = recordings() else { return };
    let folder = Folder::new();
    for name in ["cascaded_tanks_est.csv", "cascaded_tanks_val.csv"] {
        fs::copy(from.join(name), folder.join(name)).unwrap();
    }
    let log = "cascaded_tanks_est.csv";
    folder
        .run(&["identify", log, "--output", "model.json"])
        .ok();
    folder
        .run(&["identify", log, "--order", "2", "--output", "second.json"])
        .ok();
    folder
        .run(&["simulate", "second.json", log, "--output", "column.csv"])
        .ok();
    for simulation in ["model.json", "column.csv"] {
        folder
            .run(&[
                "explain",
                log,
                "--simulation",
                simulation,
                "--output",
                "explanation.json",
                "--report",
                "page.html",
            ])
            .ok();
        let said = json(&folder.join("explanation.json"));
        assert_eq!(
            said["verdict"], "named",
            "{simulation}: {}",
            said["summary"]
        );
        assert_eq!(
            effects(&said),
            ["tank_outflow", "overflow", "overflow"],
            "{simulation}"
        );
        for (value, std) in numbers(&said["effects"][0]) {
            assert!(
                std > 0.0 && std < 0.3 * value.abs(),
                "{}",
                said["effects"][0]
            );
        }
        // The recorded level ends at 10 V.
        let rim = rim(&said["effects"][2]).unwrap();
        assert!((rim - 10.0).abs() < 0.05 * 10.0, "{rim}");
        let page = fs::read_to_string(folder.join("page.html")).unwrap();
        assert!(page.contains("tank outflow (square root)"));
        let prediction = simulated(&folder, "explanation.json", "cascaded_tanks_val.csv");
        let error = error(&prediction, &folder.join("cascaded_tanks_val.csv"), 5..1024);
        println!("{simulation}: {error:.4} V");
        assert!(error < 0.36, "{simulation}: {error} V");
    }
}

/// Where an overflow begins, whether what flows over grows as the height above the rim or as its root.
fn rim(effect: &serde_json::Value) -> Option<f64> {
    let mut all = effect["parameters"].as_object()?.iter();
    let (_, rim) = all.find(|(name, _)| name.contains("above_from"))?;
    rim["value"].as_f64()
}

/// The same tanks as equations with the root: what flows over the upper rim falls into the lower tank, which overflows too.
#[test]
fn cascaded_tanks_in_equations() {
    let Some(from) = recordings() else { return };
    let folder = Folder::new();
    for name in ["cascaded_tanks_est.csv", "cascaded_tanks_val.csv"] {
        fs::copy(from.join(name), folder.join(name)).unwrap();
    }
    folder.text(
        "tanks.mo",
        "model Tanks\n  parameter Real b(min=0) = 0.033;\n  parameter Real w = 0;\n  parameter Real a(min=0) = 0.074;\n  parameter Real g(min=0) = 0.05;\n  parameter Real d(min=0) = 0.03;\n  input Real u1;\n  output Real y1;\n  Real h1(start=5);\n  Real h2(start=5);\nequation\n  der(h1) = b*u1 + w - a*sqrt(max(h1, 0));\n  der(h2) = g*sqrt(max(h1, 0)) - d*sqrt(max(h2, 0));\n  y1 = h2;\nend Tanks;\n",
    );
    let said = folder.explained("cascaded_tanks_est.csv", "tanks.mo", &[]);
    assert_eq!(
        effects(&said),
        ["overflow", "overflow"],
        "{}",
        said["summary"]
    );
    let equation = said["effects"][0]["equation"].as_str().unwrap();
    assert!(
        equation.contains("der(h1)") && equation.contains("der(h2)"),
        "{equation}"
    );
    let rim = rim(&said["effects"][1]);
    assert!(rim.is_some_and(|rim| (rim - 10.0).abs() < 0.5), "{rim:?}");
    let prediction = simulated(&folder, "e.json", "cascaded_tanks_val.csv");
    let error = error(&prediction, &folder.join("cascaded_tanks_val.csv"), 5..1024);
    println!("equations: {error:.4} V");
    assert!(error < 0.36, "{error} V");
}

/// Coupled drives: the speed sensor loses the sign, and friction saturates with the speed. The last fifth of each
/// recording was not shown. Linear models reach 0.31 and 0.39, published nonlinear ones 0.10.
#[test]
fn coupled_drives() {
    let Some(from) = recordings() else { return };
    let folder = Folder::new();
    for index in [1, 2] {
        let text = fs::read_to_string(from.join(format!("ced_unif{index}.csv"))).unwrap();
        folder.text(&format!("whole{index}.csv"), &text);
        let shown: String = text.lines().take(401).map(|l| format!("{l}\n")).collect();
        folder.text(&format!("shown{index}.csv"), &shown);
    }
    folder
        .run(&[
            "identify",
            "shown1.csv",
            "shown2.csv",
            "--output",
            "model.json",
        ])
        .ok();
    folder
        .run(&[
            "explain",
            "shown1.csv",
            "shown2.csv",
            "--simulation",
            "model.json",
            "--output",
            "explanation.json",
        ])
        .ok();
    let said = json(&folder.join("explanation.json"));
    assert_eq!(said["verdict"], "named", "{}", said["summary"]);
    assert_eq!(
        effects(&said),
        ["sensor_rectification", "coulomb_friction"],
        "{}",
        said["summary"]
    );
    let friction = &said["effects"][1];
    assert_eq!(friction["variant"], "smooth");
    for (value, std) in numbers(friction) {
        // The force that holds against the friction leans on the static gain, which the recording hardly shows.
        assert!(value > 0.0 && std < 0.7 * value, "{friction}");
    }
    for index in [1, 2] {
        let whole = format!("whole{index}.csv");
        let prediction = simulated(&folder, "explanation.json", &whole);
        let error = error(&prediction, &folder.join(&whole), 400..500);
        println!("recording {index}: {error:.4}");
        assert!(error < 0.1, "recording {index}: {error}");
    }
}

/// A hair dryer, which a linear model describes: nothing is named.
#[test]
fn dryer() {
    let Some(from) = recordings() else { return };
    let folder = Folder::new();
    fs::copy(from.join("daisy_dryer.csv"), folder.join("dryer.csv")).unwrap();
    folder
        .run(&["identify", "dryer.csv", "--output", "model.json"])
        .ok();
    folder
        .run(&[
            "explain",
            "dryer.csv",
            "--simulation",
            "model.json",
            "--output",
            "explanation.json",
        ])
        .ok();
    let said = json(&folder.join("explanation.json"));
    assert!(
        ["consistent", "parameters"].contains(&said["verdict"].as_str().unwrap()),
        "{}",
        said["summary"]
    );
    assert!(effects(&said).is_empty());
}
