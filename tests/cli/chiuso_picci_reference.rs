//! Whitening filter and innovation estimation against reference values of the derivation (numpy), through the command
//! line: three recordings in closed loop, both weights, everything that does not depend on the state basis. The
//! recordings hold the very samples, in shortest round-trip form.

use std::path::PathBuf;

use assert_cmd::Command;
use innovant::covariance::frequency_response_covariance;
use innovant::identify::{Prediction, Weight};
use innovant::internal::identify::{AsymptoticMethod, asymptotic_covariance};
use innovant::internal::systems::{
    ClosedLoop, chiuso_picci_one, chiuso_picci_two, van_wingerden_one,
};
use nalgebra::DMatrix;
use serde_json::Value;

use crate::command::run;

/// Largest error allowed, relative to the largest entry of the quantity.
const TOLERANCE: f64 = 1e-8;

fn data(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("tests/data")
        .join(name)
}

fn reference() -> Value {
    serde_json::from_slice(&std::fs::read(data("chiuso_picci.json")).unwrap()).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(list) => list.iter().flat_map(numbers).collect(),
        other => vec![other.as_f64().unwrap()],
    }
}

/// Largest difference relative to the largest expected value.
fn difference(found: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(found.len(), expected.len());
    let size = expected.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
    found
        .iter()
        .zip(expected)
        .map(|(a, b)| (a - b).abs() / size)
        .fold(0.0, f64::max)
}

struct Case<'a> {
    name: &'a str,
    method: &'a str,
    weight: &'a str,
    of_recording: &'a Value,
    expected: &'a Value,
}

fn check(case: &Case<'_>) {
    let integer = |key: &str| case.of_recording[key].as_u64().unwrap().to_string();
    let csv = data(&format!("chiuso_picci_{}.csv.gz", case.name));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.json");
    let path = path.to_str().unwrap();
    Command::cargo_bin("innovant")
        .unwrap()
        .args(["identify", csv.to_str().unwrap(), "--dt", "1"])
        .args(["--method", case.method, "--weight", case.weight])
        .args(["--order", &integer("n"), "--past", &integer("P")])
        .args(["--future", &integer("f"), "--detrend", "none"])
        .args(["--output", path])
        .assert()
        .success();
    let model: Value = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
    assert_eq!(model["method"], case.method);
    assert_eq!(model["polished"], false);

    let expected = case.expected;
    let mut worst = 0.0_f64;
    let mut close = |what: &str, found: &[f64], expected: &[f64]| {
        let error = difference(found, expected);
        let place = format!("{} {} {} {what}", case.name, case.method, case.weight);
        assert!(error < TOLERANCE, "{place}: off by {error:.1e}");
        worst = worst.max(error);
    };
    let singular = numbers(&expected["sv"]);
    let found = numbers(&model["diagnostics"]["singular_values"]);
    close("singular values", &found[..singular.len()], &singular);
    let lambda = numbers(&model["innovation_covariance"]);
    close("innovation covariance", &lambda, &numbers(&expected["Lam"]));

    let frequencies: Vec<String> = numbers(&case.of_recording["w"])
        .iter()
        .map(ToString::to_string)
        .collect();
    let at = frequencies.join(",");
    let shown = run(&["show", path, "--format", "json", "--at", &at]);
    let (outputs, inputs) = (
        model["C"].as_array().unwrap().len(),
        model["B"][0].as_array().unwrap().len(),
    );
    let points = shown["frequency_response"].as_array().unwrap();
    for (k, w) in numbers(&case.of_recording["w"]).into_iter().enumerate() {
        for entry in 0..outputs * inputs {
            let (output, input) = (entry % outputs + 1, entry / outputs + 1);
            let point = points
                .iter()
                .find(|p| {
                    p["output"] == format!("y{output}")
                        && p["input"] == format!("u{input}")
                        && (p["rad_s"].as_f64().unwrap() - w).abs() < 1e-9
                })
                .unwrap();
            let response = [&point["real"], &point["imag"]].map(|v| v.as_f64().unwrap());
            let [real, imag] =
                ["F_re", "F_im"].map(|key| expected[key][k][entry].as_f64().unwrap());
            close(&format!("F({w})"), &response, &[real, imag]);
            let c = &point["covariance"];
            let covariance = [&c[0][0], &c[0][1], &c[1][1]].map(|v| v.as_f64().unwrap());
            close(
                &format!("covariance of F({w})"),
                &covariance,
                &numbers(&expected["F_cov"][k][entry]),
            );
        }
    }
    let poles = shown["poles"].as_array().unwrap();
    for (k, re) in numbers(&expected["poles_re"]).into_iter().enumerate() {
        let im = expected["poles_im"][k].as_f64().unwrap();
        let nearest = poles
            .iter()
            .map(|p| {
                let [a, b] = ["real", "imag"].map(|key| p[key].as_f64().unwrap());
                let c = &p["covariance"];
                let trace = c[0][0].as_f64().unwrap() + c[1][1].as_f64().unwrap();
                ((a - re).hypot(b - im), [a, b], trace)
            })
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .unwrap();
        close("pole", &nearest.1, &[re, im]);
        let variance = expected["pole_var"][k].as_f64().unwrap();
        close("variance of a pole", &[nearest.2], &[variance]);
    }
    println!(
        "{} {} {}: largest relative error {worst:.1e}",
        case.name, case.method, case.weight
    );
}

const METHODS: [(&str, &str); 2] = [("wf", "whitening"), ("ie", "innovation-estimation")];
const WEIGHTS: [(&str, &str); 2] = [("I", "identity"), ("cva", "cva")];

#[test]
fn command_line_reproduces_the_reference_values() {
    let reference = reference();
    for name in ["ex1", "ex2", "mimo"] {
        let of_recording = &reference[name];
        for (short, method) in METHODS {
            for (short_weight, weight) in WEIGHTS {
                check(&Case {
                    name,
                    method,
                    weight,
                    of_recording,
                    expected: &of_recording[format!("{short}_{short_weight}")],
                });
            }
        }
    }
}

/// The asymptotic covariance of the true system. In example 2 the past window of 25 truncates (0.8^25 = 0.4 %), and
/// what is left out at which place is a matter of convention of that size: the reference keeps the transient of the
/// Kalman gain in the next state of innovation estimation, and here the limit is used throughout.
#[test]
fn true_asymptotic_covariance_is_that_of_the_reference() {
    let reference = reference();
    let coupled = ClosedLoop {
        innovation_covariance: DMatrix::from_row_slice(2, 2, &[1.0, 0.4, 0.4, 0.5]),
        ..ClosedLoop::from(&van_wingerden_one())
    };
    for (name, closed_loop, tolerances) in [
        ("ex1", chiuso_picci_one(), [1e-8; 3]),
        ("mimo", coupled, [1e-8; 3]),
        ("ex2", chiuso_picci_two(), [1e-6, 1e-2, 1e-5]),
    ] {
        let of_recording = &reference[name];
        let integer = |key: &str| of_recording[key].as_u64().unwrap() as usize;
        let methods = [
            ("wf", AsymptoticMethod::Nested(Prediction::Whitening)),
            (
                "ie",
                AsymptoticMethod::Nested(Prediction::InnovationEstimation),
            ),
            ("opt", AsymptoticMethod::PbsidOpt),
        ];
        for ((short, method), tolerance) in methods.into_iter().zip(tolerances) {
            for (short_weight, weight) in [("I", Weight::Identity), ("cva", Weight::Cva)] {
                let covariance =
                    asymptotic_covariance(&closed_loop, method, weight, integer("P"), integer("f"))
                        .unwrap();
                let expected = &of_recording[format!("{short}_{short_weight}")];
                let mut worst = 0.0_f64;
                for (k, w) in numbers(&of_recording["w"]).into_iter().enumerate() {
                    let found =
                        frequency_response_covariance(&closed_loop.plant, &covariance, w).unwrap();
                    for (entry, c) in found.iter().enumerate() {
                        let expected = numbers(&expected["true_asy_F_cov_N1"][k][entry]);
                        let found = [c[0][0], c[0][1], c[1][1]];
                        worst = worst.max(difference(&found, &expected));
                    }
                }
                println!("{name} {short} {short_weight}: {worst:.1e}");
                assert!(
                    worst < tolerance,
                    "{name} {short} {short_weight}: {worst:e}"
                );
            }
        }
    }
}
