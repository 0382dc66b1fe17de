//! What is done with a model: simulate, validate, show, and the small commands.

use std::fs;

use innovant::internal::systems;
use innovant::log::Log;

use crate::folder::{Folder, columns};

const BARE: &str =
    r#"{"A": 0.5, "B": [[1]], "C": 1, "dt": 0.1, "unknown": {"keys": "are ignored"}}"#;

/// A recording about an operating point that is not zero, with names and units.
fn about_an_operating_point(samples: usize, seed: u64) -> Log {
    let mut log = systems::servo().record(samples, seed);
    log.inputs[0].name = "voltage".into();
    log.inputs[0].unit = Some("V".into());
    log.outputs[0].name = "speed".into();
    log.input_data[0].iter_mut().for_each(|u| *u += 12.0);
    log.output_data[0].iter_mut().for_each(|y| *y += 300.0);
    log
}

#[test]
fn identify_simulate_validate() {
    let folder = Folder::new();
    folder.log("log.csv", &about_an_operating_point(4000, 1));
    folder.log("fresh.csv", &about_an_operating_point(3000, 2));
    let roles = ["--inputs", "voltage", "--outputs", "speed"];
    folder
        .run(&[&["identify", "log.csv", "-o", "model.json"], &roles[..]].concat())
        .ok();

    // In the user's units, with the names and the unit of the model.
    let zero = folder.run(&["simulate", "model.json", "fresh.csv"]).ok();
    let (header, simulated) = columns(&zero);
    assert_eq!(header, ["t [s]", "speed"]);
    assert_eq!(simulated[1].len(), 3000);
    let mean = simulated[1].iter().sum::<f64>() / 3000.0;
    assert!((mean - 300.0).abs() < 2.0, "{mean}");
    folder
        .run(&[
            "simulate",
            "model.json",
            "fresh.csv",
            "--initial-state",
            "estimate",
            "-o",
            "out.csv.gz",
        ])
        .ok();
    assert_eq!(
        fs::read(folder.join("out.csv.gz")).unwrap()[..2],
        [0x1F, 0x8B]
    );

    // Accepted on its own recording, which is recognised, and on a fresh one.
    let own = folder
        .run(&["validate", "model.json", "log.csv", "--format", "json"])
        .json();
    assert_eq!(
        (&own["relation"], &own["rejected"]),
        (&"estimation".into(), &false.into())
    );
    let fresh = folder
        .run(&["validate", "model.json", "fresh.csv", "--format", "json"])
        .json();
    assert_eq!(
        (&fresh["relation"], &fresh["rejected"]),
        (&"fresh".into(), &false.into())
    );
    let table = folder.run(&["validate", "model.json", "fresh.csv"]).ok();
    assert!(
        table.starts_with("Model accepted on a recording it has not seen (3000 samples)"),
        "{table}"
    );
    assert!(
        table.lines().all(|line| line.chars().count() <= 100),
        "{table}"
    );
}

#[test]
fn a_wrong_model_is_rejected_with_exit_code_1() {
    let folder = Folder::new();
    folder.recording("log.csv", &systems::servo(), 3000, 1);
    folder
        .run(&["identify", "log.csv", "--order", "1", "-o", "model.json"])
        .ok();
    let run = folder.run(&["validate", "model.json", "log.csv"]);
    assert_eq!(run.code, 1, "{}", run.stderr);
    assert!(run.stdout.starts_with("Model rejected"), "{}", run.stdout);
    assert!(run.stdout.contains("finding: "), "{}", run.stdout);
    assert_eq!(run.stderr, "");
    let quiet = folder.run(&["validate", "-q", "model.json", "log.csv"]);
    assert_eq!((quiet.code, quiet.stdout.as_str()), (1, ""));
}

#[test]
fn bare_models_simulate_by_hand() {
    let folder = Folder::new();
    folder.text("bare.json", BARE);
    folder.text("in.csv", "t,u1\n0,1\n0.1,0\n0.2,0\n0.3,0\n");
    let out = folder.run(&["simulate", "bare.json", "in.csv"]).ok();
    assert_eq!(out, "t [s],y1\n0,0\n0.1,1\n0.2,0.5\n0.3,0.25\n");
    let stdin = folder.run_with_input(
        &["simulate", "bare.json", "-"],
        b"t,u1\n0,1\n0.1,0\n".to_vec(),
    );
    assert_eq!(stdin.ok(), "t [s],y1\n0,0\n0.1,1\n");
    let model = folder.run_with_input(&["simulate", "-", "in.csv"], BARE.into());
    assert_eq!(model.ok(), out);

    // Levels and delays: before the first sample the input stands still.
    let delayed = r#"{"A": 0, "B": 1, "C": 1, "sample_time": 0.1,
        "inputs": [{"name": "u", "level": 10, "delay": 2}], "outputs": [{"name": "y", "unit": "m", "level": 5}]}"#;
    folder.text("delayed.json", delayed);
    let out = folder.run_with_input(
        &["simulate", "delayed.json", "-"],
        b"t,u\n0,11\n0.1,12\n0.2,13\n0.3,14\n0.4,15\n".to_vec(),
    );
    assert_eq!(out.ok(), "t [s],y [m]\n0,5\n0.1,6\n0.2,6\n0.3,6\n0.4,7\n");
}

#[test]
fn the_initial_state_is_estimated_from_the_outputs() {
    let folder = Folder::new();
    folder.text("bare.json", BARE);
    folder.text("log.csv", "t,u1,y1\n0,0,8\n0.1,0,4\n0.2,0,2\n0.3,0,1\n");
    let estimate = [
        "simulate",
        "bare.json",
        "log.csv",
        "--initial-state",
        "estimate",
    ];
    let (_, simulated) = columns(&folder.run(&estimate).ok());
    for (y, expected) in simulated[1].iter().zip([8.0, 4.0, 2.0, 1.0]) {
        assert!((y - expected).abs() < 1e-9);
    }
    folder.text("log.csv", "t,u1\n0,0\n0.1,0\n");
    let error = folder.run(&estimate).error();
    assert!(error.contains("needs the recorded outputs y1"), "{error}");
}

#[test]
fn simulations_that_cannot_be() {
    let folder = Folder::new();
    folder.text("bare.json", BARE);
    folder.text("in.csv", "t,force\n0,1\n0.1,0\n");
    let unknown = folder
        .run(&["simulate", "bare.json", "in.csv", "-o", "out.csv"])
        .error();
    assert!(
        unknown.contains("u1") && unknown.contains("`force`"),
        "{unknown}"
    );
    folder
        .run(&["simulate", "bare.json", "in.csv", "--inputs", "force"])
        .ok();
    let two = folder
        .run(&["simulate", "bare.json", "in.csv", "--inputs", "a,b"])
        .error();
    assert!(
        two.contains("--inputs names 2 columns, but the model has 1: u1"),
        "{two}"
    );
    folder.text("slow.csv", "t,u1\n0,1\n0.2,0\n");
    let sampling = folder
        .run(&["simulate", "bare.json", "slow.csv", "-o", "out.csv"])
        .error();
    assert!(
        sampling.contains("slow.csv: the sample time is 0.2 s"),
        "{sampling}"
    );

    folder.text("unstable.json", r#"{"A": 10, "B": 1, "C": 1, "dt": 1}"#);
    let rows: String = (0..400).map(|k| format!("{k},1\n")).collect();
    folder.text("long.csv", &format!("t,u1\n{rows}"));
    let diverges = folder
        .run(&["simulate", "unstable.json", "long.csv", "-o", "out.csv"])
        .error();
    assert!(
        diverges
            .contains("diverges: output y1 leaves the range of numbers at sample 310, t = 310 s"),
        "{diverges}"
    );
    assert!(!folder.join("out.csv").exists());
    let own = folder
        .run(&["simulate", "bare.json", "in.csv", "-o", "bare.json"])
        .error();
    assert!(own.contains("would destroy it"), "{own}");
}

#[test]
fn bare_models_are_validated_and_shown() {
    let folder = Folder::new();
    folder.text("bare.json", BARE);
    let mut system = systems::servo();
    system.system.sample_time = 0.1;
    folder.recording("log.csv", &system, 1000, 1);
    let run = folder.run(&["validate", "bare.json", "log.csv"]);
    assert_eq!(run.code, 1, "{}", run.stderr);
    let text = folder.run(&["show", "bare.json"]).ok();
    assert!(
        text.starts_with("Order 1 model of 1 output from 1 input, sampled every 0.1 s"),
        "{text}"
    );
    let json = folder
        .run(&["show", "bare.json", "--format", "json", "--at", "0"])
        .json();
    assert_eq!(json["frequency_response"][0]["magnitude"], 2.0);
    assert_eq!(json["poles"][0]["real"], 0.5);
    assert_eq!(json["static_gain"][0]["value"], 2.0);
    assert!(json["poles"][0]["covariance"].is_null());
}

#[test]
fn show_has_the_keys_of_the_design() {
    let folder = Folder::new();
    folder.recording("log.csv", &systems::servo(), 2000, 1);
    folder.run(&["identify", "log.csv", "-o", "m.json"]).ok();
    let json = folder
        .run(&["show", "m.json", "--format", "json", "--at", "10,30.5"])
        .json();
    for key in [
        "real",
        "imag",
        "covariance",
        "natural_frequency_hz",
        "natural_frequency_std",
        "damping",
        "damping_std",
        "time_constant_s",
    ] {
        assert!(!json["poles"][0][key].is_null(), "{key}");
        assert!(json["zeros"].is_array());
    }
    let point = &json["frequency_response"][1];
    assert_eq!(
        (&point["rad_s"], &point["output"], &point["input"]),
        (&30.5.into(), &"y1".into(), &"u1".into())
    );
    for key in [
        "hz",
        "real",
        "imag",
        "covariance",
        "magnitude",
        "magnitude_95",
        "magnitude_99",
        "phase_rad",
        "phase_95",
        "phase_99",
    ] {
        assert!(!point[key].is_null(), "{key}");
    }
    assert_eq!(json["noise_response"][0]["input"], "e(y1)");
    assert_eq!(json["armax"]["a"].as_array().unwrap().len(), 4);

    let csv = folder
        .run(&["show", "m.json", "--format", "csv", "--at", "10,30"])
        .ok();
    assert!(csv.starts_with("rad_s,hz,output,input,real,imag,"), "{csv}");
    assert_eq!(csv.lines().count(), 5);
    let text = folder.run(&["show", "m.json"]).ok();
    assert!(text.contains("Frequency response from u1 to y1"), "{text}");
    assert!(
        text.lines().all(|line| line.chars().count() <= 100),
        "{text}"
    );
    let beyond = folder.run(&["show", "m.json", "--at", "1e6"]).error();
    assert!(beyond.contains("Nyquist frequency"), "{beyond}");
}

#[test]
fn help_version_completions_and_schema() {
    let folder = Folder::new();
    assert!(folder.run(&["--version"]).ok().starts_with("innovant "));
    let help = folder.run(&[]).ok();
    assert!(help.contains("Usage: innovant"), "{help}");
    assert!(folder.run(&["help"]).ok().contains("Usage: innovant"));
    for command in [
        "identify",
        "validate",
        "simulate",
        "show",
        "schema",
        "completions",
    ] {
        let help = folder.run(&[command, "--help"]).ok();
        assert!(help.contains("Example"), "{help}");
    }
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        assert!(
            folder
                .run(&["completions", shell])
                .ok()
                .contains("identify")
        );
    }
    let schema = folder.run(&["schema", "model"]).json();
    assert_eq!(
        schema["$schema"],
        "https://json-schema.org/draft/2020-12/schema"
    );
}

#[cfg(unix)]
#[test]
fn a_reader_that_leaves_is_no_error() {
    let folder = Folder::new();
    folder.recording("log.csv", &systems::servo(), 20_000, 1);
    folder.text("bare.json", &BARE.replace("0.1", "0.001"));
    let program = assert_cmd::cargo::cargo_bin("innovant");
    let script = format!(
        "set -o pipefail; '{}' simulate bare.json log.csv | head -1",
        program.display()
    );
    let output = std::process::Command::new("bash")
        .args(["-c", &script])
        .current_dir(folder.path())
        .output()
        .unwrap();
    assert!(output.status.success(), "{output:?}");
    assert_eq!(output.stdout, b"t [s],y1\n");
    assert_eq!(output.stderr, b"");
}

const LAG: &str = "model Lag parameter Real tau(unit=\"s\", min=1, max=100) = 10;
  input Real u(unit=\"W\"); output Real y(unit=\"m/s\"); Real x(unit=\"m/s\", start=0);
equation tau*der(x) = 0.01*u - x; y = x; end Lag;
";

/// A step through the lag; the outputs from `known` on are missing.
fn step(header: &str, scale: f64, known: usize) -> String {
    let mut text = format!("{header}\n");
    for k in 0..100 {
        let y = 1.0 - (-(k as f64) / 10.0).exp() + 0.01 * (7.3 * k as f64).sin();
        let y = match k < known {
            true => (scale * y).to_string(),
            false => String::new(),
        };
        text += &format!("{k},100,{y}\n");
    }
    text
}

#[test]
fn a_log_in_another_scale_than_the_plant_is_refused() {
    let folder = Folder::new();
    folder.text("lag.mo", LAG);
    folder.text("kmh.csv", &step("t,u [W],y [km/h]", 3.6, 100));
    let explain = ["explain", "kmh.csv", "--simulation", "lag.mo"];
    let identify = ["identify", "kmh.csv", "--structure", "lag.mo"];
    for arguments in [&explain, &identify] {
        let message = folder.run(arguments).error();
        assert!(message.contains("column `y` is in km/h"), "{message}");
        assert!(message.contains("1 m/s is 3.6 km/h"), "{message}");
        assert!(message.contains("divide the column by 3.6"), "{message}");
    }
    // Other spellings of the same unit, and those that nobody knows.
    for header in ["t,u [W],y [ms-1]", "t,u [watt],y [counts]"] {
        folder.text("alike.csv", &step(header, 1.0, 100));
        let run = folder.run(&["simulate", "lag.mo", "alike.csv", "-o", "out.csv"]);
        assert!(!run.stderr.contains("column"), "{}", run.stderr);
        run.ok();
    }
    // Another quantity may be misread: a warning, also in the explanation.
    folder.text("volts.csv", &step("t,u [V],y [m/s]", 1.0, 100));
    let run = folder.run(&["explain", "volts.csv", "--simulation", "lag.mo"]);
    let words = "column `u` is in V, and `u` of the plant in W, which is another quantity";
    assert!(run.stderr.contains(words), "{}", run.stderr);
    assert!(run.stdout.contains("Warning: volts.csv"), "{}", run.stdout);
}

#[test]
fn a_plant_in_days_is_told_that_time_is_in_seconds() {
    let folder = Folder::new();
    let text = LAG.replace("unit=\"s\"", "unit=\"d\"");
    folder.text("lag.mo", &text);
    let run = folder.run(&["check", "lag.mo"]);
    assert_eq!(run.stderr.matches("warning").count(), 1, "{}", run.stderr);
    assert!(
        run.stderr
            .contains("`tau` is in d: the factor 86400 is missing"),
        "{}",
        run.stderr
    );
    folder.text("lag.mo", &text.replace("tau*der", "86400*tau*der"));
    let run = folder.run(&["check", "lag.mo"]);
    assert_eq!(run.stderr, "");
}

#[test]
fn rows_without_outputs_are_simulated_from_an_estimated_state() {
    let folder = Folder::new();
    folder.text("lag.mo", LAG);
    folder.text("past.csv", &step("t,u,y", 1.0, 40));
    let run = folder.run(&[
        "simulate",
        "lag.mo",
        "past.csv",
        "--initial-state",
        "estimate",
    ]);
    assert!(
        run.stderr
            .contains("from the 40 samples that have outputs; all 100 are simulated"),
        "{}",
        run.stderr
    );
    let (_, simulated) = columns(&run.ok());
    assert_eq!(simulated[1].len(), 100);
    assert!(
        (simulated[1][99] - 1.0).abs() < 0.01,
        "{}",
        simulated[1][99]
    );

    // A linear model starts from the outputs of the first rows.
    folder.text(
        "bare.json",
        r#"{"A": 0.9, "B": [[0.001]], "C": 1, "dt": 1}"#,
    );
    let past = [
        "past.csv",
        "--inputs",
        "u",
        "--outputs",
        "y",
        "--initial-state",
        "estimate",
    ];
    let run = folder.run(&[&["simulate", "bare.json"], &past[..]].concat());
    assert!(
        run.stderr.contains("from the 40 samples up to"),
        "{}",
        run.stderr
    );
    assert_eq!(columns(&run.ok()).1[1].len(), 100);
}

#[test]
fn an_explanation_remembers_the_names_of_the_columns() {
    let folder = Folder::new();
    folder.text("lag.mo", LAG);
    folder.text("other.csv", &step("t,heater [W],speed [m/s]", 1.0, 100));
    folder
        .run(&[
            "explain",
            "other.csv",
            "--simulation",
            "lag.mo",
            "--inputs",
            "heater",
            "--outputs",
            "speed",
            "-o",
            "e.json",
        ])
        .ok();
    let by_own_names = folder.run(&["simulate", "e.json", "other.csv"]).ok();
    assert!(
        by_own_names.starts_with("t [s],speed [m/s]"),
        "{by_own_names}"
    );
    folder.text("plain.csv", &step("t,u,y", 1.0, 100));
    assert_eq!(
        folder.run(&["simulate", "e.json", "plain.csv"]).ok(),
        by_own_names
    );
    folder.text("third.csv", &step("t,power,y", 1.0, 100));
    let message = folder.run(&["simulate", "e.json", "third.csv"]).error();
    assert!(message.contains("`--inputs` for u"), "{message}");
}

/// A lag of 2 s after a step of its input at the first of these times, as a recording.
fn lag_at(times: &[f64]) -> String {
    let mut text = "t,u,y\n".to_owned();
    for t in times {
        let y = 1.0 - (-(t - times[0]) / 2.0).exp();
        text.push_str(&format!("{t},100,{y:.9}\n"));
    }
    text
}

#[test]
fn a_simulation_has_the_rows_of_its_input() {
    let folder = Folder::new();
    folder.text("lag.mo", LAG);
    // Irregular times, and times with a gap.
    let irregular = [0.0, 0.13, 0.31, 0.44, 0.9, 1.0, 1.37, 1.8, 2.6, 2.9, 3.05];
    let even: Vec<f64> = (0..60).map(|k| 0.1 * f64::from(k)).collect();
    let gap = |t: &&f64| !(2.05..3.15).contains(*t);
    let gap: Vec<f64> = even.iter().filter(gap).copied().collect();
    for (name, times) in [("irregular.csv", &irregular[..]), ("gap.csv", &gap)] {
        folder.text(name, &lag_at(times));
        let said = folder.run(&["simulate", "lag.mo", name, "--parameters", "tau=2"]);
        let (_, simulated) = columns(&said.ok());
        assert_eq!(simulated[0], times, "{name}");
        for (t, y) in times.iter().zip(&simulated[1]) {
            let expected = 1.0 - (-t / 2.0).exp();
            assert!(
                (y - expected).abs() < 1e-4,
                "{name}: {y} at {t}, {expected}"
            );
        }
    }
}
