//! `innovant identify --simulator`: programs as simulators. The simulator here is a small Python 3 script.

use std::collections::BTreeSet;
use std::fs;

use crate::folder::{Folder, Run};
use innovant::physics::{Excitation, Hold, Plant, parse};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde_json::Value;

/// A tank: level by flow of the pump and opening of the outlet.
const TEXT: &str = "model Tank
  parameter Real k(min=0.01, max=0.2) = 0.04;
  parameter Real a(min=0.01, max=0.5) = 0.08;
  input Real u;
  output Real y;
  Real h(start=1.5, fixed=true);
equation
  der(h) = k*u - a*sqrt(max(h, 0));
  y = h;
end Tank;";

const PARAMETERS: &str = r#"{
  "k": {"value": 0.04, "min": 0.01, "max": 0.2, "unit": "m/s"},
  "a": {"value": 0.08, "min": 0.01, "max": 0.5, "description": "opening"}
}"#;

/// The same tank as a program. Its first argument says how it misbehaves; each run adds a line to `runs.txt`.
const SCRIPT: &str = r#"
import csv, hashlib, json, math, sys, time

mode, inputs, outputs, parameters = sys.argv[1:]
text = open(inputs).read()
values = json.load(open(parameters))
with open("runs.txt", "a") as file:
    file.write(hashlib.sha256((text + repr(sorted(values.items()))).encode()).hexdigest() + "\n")
rows = list(csv.DictReader(text.splitlines()))
k, a = values["k"], values["a"]
if mode == "fails":
    print("reading the tables", file=sys.stderr)
    sys.exit("no licence for the tank")
if mode == "hangs":
    print("solver started", flush=True)
    time.sleep(60)
if mode == "unlucky" and sum(1 for line in open("runs.txt")) % 9 == 0:
    sys.exit("no licence is free")
level = 1.5
with open(outputs, "w") as file:
    file.write("time,other,y\n" if mode != "columns" else "time,level\n")
    for i, row in enumerate(rows):
        if mode == "short" and i == 100:
            break
        digits = {"rounded": "%.4f"}.get(mode, "%.17g")
        shown = "nan" if mode == "nan" and i == 2 else "oops" if mode == "text" and i == 2 else digits % level
        clock = float(row["t"]) * (2 if mode == "clock" else 1)
        file.write(f"{clock},0,{shown}\n" if mode != "columns" else f"{clock},{shown}\n")
        u, n = float(row["u"]), 4
        f = lambda h: k * u - a * math.sqrt(max(h, 0.0))
        for _ in range(n):
            d = 1.0 / n
            k1 = f(level); k2 = f(level + d / 2 * k1); k3 = f(level + d / 2 * k2); k4 = f(level + d * k3)
            level += d / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
if mode == "silent":
    import os
    os.remove(outputs)
"#;

const TRUTH: [f64; 2] = [0.05, 0.1];

/// A folder with a recording, the program, its parameters and the equations.
fn folder(samples: usize) -> Folder {
    let folder = Folder::new();
    folder.text("simulator.py", SCRIPT);
    folder.text("parameters.json", PARAMETERS);
    folder.text("tank.mo", TEXT);
    folder.text("log.csv", &recording(samples, 1));
    folder
}

fn recording(samples: usize, seed: u64) -> String {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let u: Vec<f64> = (0..samples.div_ceil(20))
        .flat_map(|_| [random.random_range(1.0..4.0); 20])
        .take(samples)
        .collect();
    let plant = Plant::new(parse(TEXT).unwrap());
    let mut point = plant.nominal();
    point.parameters = TRUTH.to_vec();
    let excitation = Excitation {
        inputs: &[&u],
        length: samples,
        sample_time: 1.0,
        start_time: 0.0,
        hold: Hold::Zero,
    };
    let run = plant.simulate(&point, &excitation, None).unwrap();
    let mut text = "t [s],u [l/s],y [m]\n".to_owned();
    for (k, y) in run.outputs[0].iter().enumerate() {
        let noise: f64 = StandardNormal.sample(&mut random);
        text += &format!("{k},{},{}\n", u[k], y + 0.02 * noise);
    }
    text
}

/// Messages of programs and of clap have several lines.
trait Fails {
    fn fails(self) -> String;
}

impl Fails for Run {
    fn fails(self) -> String {
        assert_eq!(self.code, 2, "{self:?}");
        self.stderr
    }
}

fn identify(folder: &Folder, mode: &str, more: &[&str]) -> Run {
    let command = format!("python3 simulator.py {mode} {{input}} {{output}} {{parameters}}");
    let mut arguments = vec![
        "identify",
        "log.csv",
        "--simulator",
        &command,
        "--simulator-parameters",
        "parameters.json",
        "--output",
        "fit.json",
    ];
    arguments.extend(more);
    folder.run(&arguments)
}

fn document(folder: &Folder, name: &str) -> Value {
    serde_json::from_str(&fs::read_to_string(folder.join(name)).unwrap()).unwrap()
}

/// Value and standard deviation of each parameter.
fn estimates(document: &Value) -> Vec<(String, f64, f64)> {
    let of = |p: &Value| {
        let number = |key: &str| p[key].as_f64().unwrap_or(f64::NAN);
        (
            p["name"].as_str().unwrap().to_owned(),
            number("value"),
            number("std"),
        )
    };
    document["parameters"]
        .as_array()
        .unwrap()
        .iter()
        .map(of)
        .collect()
}

#[test]
fn a_program_is_estimated_as_its_equations_are() {
    let folder = folder(500);
    let said = identify(&folder, "well", &[]).ok();
    for words in [
        "Simulator from 500 samples: 2 parameters",
        "values given",
        "The simulator was run",
    ] {
        assert!(said.contains(words), "{said}");
    }
    let found = document(&folder, "fit.json");
    let schema: Value = serde_json::from_str(&folder.run(&["schema", "plant"]).ok()).unwrap();
    let validator = jsonschema::draft202012::new(&schema).unwrap();
    assert!(validator.is_valid(&found));
    folder
        .run(&[
            "identify",
            "log.csv",
            "--structure",
            "tank.mo",
            "--form",
            "free-run",
            "-o",
            "mo.json",
        ])
        .ok();
    let of_equations = estimates(&document(&folder, "mo.json"));
    for (((name, value, std), (_, expected, expected_std)), truth) in
        estimates(&found).iter().zip(&of_equations).zip(TRUTH)
    {
        assert!(
            (value - truth).abs() < 3.0 * std,
            "{name} = {value} +- {std}"
        );
        assert!(
            (value - expected).abs() < 0.05 * expected_std,
            "{name}: {value}, {expected}"
        );
        assert!(
            (std / expected_std - 1.0).abs() < 0.02,
            "{name}: {std}, {expected_std}"
        );
    }
    // No values were run twice, and the document counts the runs.
    let runs = fs::read_to_string(folder.join("runs.txt")).unwrap();
    let all: Vec<&str> = runs.lines().collect();
    assert_eq!(all.iter().collect::<BTreeSet<_>>().len(), all.len());
    assert_eq!(found["simulator"]["runs"], all.len());
    assert!(all.len() < 120, "{} runs", all.len());
    // It holds all parameters, and says that it has no equations.
    assert_eq!(
        found["simulator"]["parameters"][1]["description"],
        "opening"
    );
    let error = folder.run(&["check", "fit.json"]).fails();
    assert!(error.contains("no equations"), "{error}");
    let error = folder.run(&["simulate", "fit.json", "log.csv"]).fails();
    assert!(error.contains("no equations"), "{error}");
}

#[test]
fn rounded_output_is_good_enough() {
    let folder = folder(500);
    identify(&folder, "well", &[]).ok();
    let exact = estimates(&document(&folder, "fit.json"));
    identify(&folder, "rounded", &[]).ok();
    let rounded = estimates(&document(&folder, "fit.json"));
    for ((name, value, std), (_, other, other_std)) in exact.iter().zip(&rounded) {
        assert!(
            (value - other).abs() < 0.1 * std,
            "{name}: {value}, {other}"
        );
        assert!(
            (std / other_std - 1.0).abs() < 0.05,
            "{name}: {std}, {other_std}"
        );
    }
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let folder = folder(300);
    for (threads, name) in [("1", "one.json"), ("4", "four.json")] {
        identify(&folder, "well", &["--threads", threads]).ok();
        fs::rename(folder.join("fit.json"), folder.join(name)).unwrap();
    }
    assert_eq!(
        document(&folder, "one.json"),
        document(&folder, "four.json")
    );
}

#[test]
fn some_parameters_and_several_recordings() {
    let folder = folder(300);
    folder.text("second.csv", &recording(300, 2));
    folder.text("parameters.json", &PARAMETERS.replace("0.08", "0.1"));
    identify(
        &folder,
        "well",
        &["second.csv", "--fix", "a", "--least-squares"],
    )
    .ok();
    let found = document(&folder, "fit.json");
    assert_eq!(estimates(&found).len(), 1);
    assert_eq!(found["simulator"]["parameters"][1]["value"], 0.1);
    assert_eq!(found["recordings"].as_array().unwrap().len(), 2);
    let error = identify(&folder, "well", &["--free", "b"]).fails();
    assert!(error.contains("no parameter `b`"), "{error}");
}

#[test]
fn a_parameter_without_influence_is_said() {
    let folder = folder(300);
    folder.text(
        "parameters.json",
        &PARAMETERS.replacen('{', r#"{"idle": 3, "#, 1),
    );
    for mode in ["well", "rounded"] {
        let said = identify(&folder, mode, &[]).ok();
        assert!(said.contains("`idle` has no influence"), "{said}");
    }
}

#[test]
fn values_that_fail_are_not_taken() {
    let folder = folder(300);
    let run = identify(&folder, "unlucky", &["--threads", "1"]);
    let error = run.stderr.clone();
    run.ok();
    assert!(
        error.contains("no licence is free") && error.contains("gave no answer"),
        "{error}"
    );
    let found = document(&folder, "fit.json");
    assert!(found["simulator"]["failed_runs"].as_u64().unwrap() > 0);
    for ((name, value, std), truth) in estimates(&found).iter().zip(TRUTH) {
        assert!(
            (value - truth).abs() < 3.0 * std,
            "{name} = {value} +- {std}"
        );
    }
}

#[test]
fn failures_say_what_went_wrong() {
    let folder = folder(150);
    for (mode, words) in [
        (
            "fails",
            vec![
                "exit status: 1",
                "no licence for the tank",
                "reading the tables",
                "with k = 0.04, a = 0.08",
            ],
        ),
        ("hangs", vec!["time limit of 1.5 s", "solver started"]),
        (
            "nan",
            vec!["`y` is NaN in row 3 (t = 2 s)", "with k = 0.04"],
        ),
        ("text", vec!["`y` is `oops` in row 3"]),
        ("short", vec!["100 rows of outputs for 150 rows of inputs"]),
        ("columns", vec!["no column `y`", "it wrote `time`, `level`"]),
        (
            "clock",
            vec!["row 2 of the simulator's output is at t = 2 s, that of the input at 1 s"],
        ),
        ("silent", vec!["without writing its output file"]),
    ] {
        let _ = fs::remove_file(folder.join("runs.txt"));
        let error = identify(&folder, mode, &["--simulator-timeout", "1.5"]).fails();
        for words in words {
            assert!(error.contains(words), "{mode}: {error}");
        }
        // Values that fail at the start are not searched from.
        let runs = fs::read_to_string(folder.join("runs.txt")).unwrap();
        assert_eq!(runs.lines().count(), 1, "{mode}");
        assert!(!folder.join("fit.json").exists());
    }
}

#[test]
fn wrong_flags_say_what_to_type() {
    let folder = folder(150);
    let simulator = "python3 simulator.py well {input} {output} {parameters}";
    for (arguments, words) in [
        (
            vec!["--simulator", simulator],
            "--simulator-parameters <FILE>",
        ),
        (
            vec![
                "--simulator",
                "sim {input} {output}",
                "--simulator-parameters",
                "parameters.json",
            ],
            "holds no {parameters}",
        ),
        (
            vec![
                "--simulator",
                "no-such-program {input} {output} {parameters}",
                "--simulator-parameters",
                "parameters.json",
            ],
            "`no-such-program` cannot be started",
        ),
        (
            vec![
                "--simulator",
                simulator,
                "--simulator-parameters",
                "log.csv",
            ],
            "log.csv: these are no parameters",
        ),
        (
            vec![
                "--simulator",
                simulator,
                "--simulator-parameters",
                "nowhere.json",
            ],
            "nowhere.json: cannot be read",
        ),
        (
            vec![
                "--simulator",
                simulator,
                "--simulator-parameters",
                "parameters.json",
                "--structure",
                "tank.mo",
            ],
            "cannot be used with",
        ),
        (
            vec![
                "--simulator",
                simulator,
                "--simulator-parameters",
                "parameters.json",
                "--form",
                "innovation",
            ],
            "cannot be used with",
        ),
        (
            vec![
                "--simulator",
                simulator,
                "--simulator-parameters",
                "parameters.json",
                "--report",
                "page.html",
            ],
            "leave it out with --simulator",
        ),
        (
            vec!["--fix", "a"],
            "--structure <PLANT>|--simulator <COMMAND>",
        ),
    ] {
        let mut all = vec!["identify", "log.csv"];
        all.extend(&arguments);
        let error = folder.run(&all).fails();
        assert!(error.contains(words), "{arguments:?}: {error}");
    }
}
