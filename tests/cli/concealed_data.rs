//! The cases of `data/concealed/` through the command line: what is said of them, that documents keep to their
//! schema, and that an explanation that was written simulates as the one in memory.

use std::fs;
use std::path::{Path, PathBuf};

use innovant::explain::{
    ExplainError, Explanation, FitFigure, Options, Simulation, Verdict, explain,
};
use innovant::log::{Log, RoleNeed, Roles, Source};
use innovant::report::{parse_explanation, schema};
use rayon::prelude::*;
use serde_json::Value;

use crate::folder::{Folder, columns, json};

/// How many cases there are, and how many must be answered rightly.
const CASES: usize = 12;
const RIGHT: usize = 10;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data/concealed")
}

fn cases() -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder())
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.starts_with("case_"))
        .collect();
    names.sort();
    names
}

fn text(path: &Path) -> String {
    path.to_str().unwrap().to_owned()
}

/// What was said of a case.
struct Said {
    case: String,
    right: bool,
    line: String,
}

fn ask(case: &str, validator: &jsonschema::Validator) -> Said {
    let data = folder().join(case);
    let truth = json(&folder().join("truth").join(format!("{case}.json")));
    let scratch = Folder::new();
    let recording = text(&data.join("recording.csv"));
    let simulation = ["simulation.csv", "simulation.json"]
        .map(|name| data.join(name))
        .into_iter()
        .find(|path| path.exists())
        .unwrap();
    let printed = scratch
        .run(&[
            "explain",
            &recording,
            "--simulation",
            &text(&simulation),
            "--output",
            "explanation.json",
        ])
        .ok();
    assert!(!printed.is_empty(), "{case}");

    let written = fs::read_to_string(scratch.join("explanation.json")).unwrap();
    let document: Value = serde_json::from_str(&written).unwrap();
    let errors: Vec<String> = validator
        .iter_errors(&document)
        .map(|error| format!("{}: {error}", error.instance_path()))
        .collect();
    assert!(errors.is_empty(), "{case}: {errors:?}");
    let explanation = parse_explanation("explanation.json", &written).unwrap();
    assert_eq!(
        serde_json::to_value(&explanation).unwrap(),
        document,
        "{case}"
    );
    round_trip(case, &data, &scratch, &explanation);
    figures_agree(case, &explanation);

    let verdict = document["verdict"].as_str().unwrap().to_owned();
    let ids = |value: &Value, key: Option<&str>| -> Vec<String> {
        value
            .as_array()
            .unwrap()
            .iter()
            .map(|v| key.map_or(v, |k| &v[k]).as_str().unwrap().to_owned())
            .collect()
    };
    for effect in document["effects"].as_array().unwrap() {
        let (signal, sentence) = (&effect["signal"], &effect["sentence"]);
        let (signal, sentence) = (signal.as_str().unwrap(), sentence.as_str().unwrap());
        assert!(
            ["u1", "u2", "y1", "y2"].contains(&signal),
            "{case}: {signal}"
        );
        assert!(sentence.contains(signal), "{case}: {sentence}");
    }
    let named = ids(&document["effects"], Some("effect"));
    let real = ids(&truth["effects"], None);
    let sorted = |mut list: Vec<String>| {
        list.sort();
        list
    };
    let right = if real.is_empty() {
        verdict == "consistent" || verdict == "parameters"
    } else {
        (verdict == "named" || verdict == "family") && sorted(named.clone()) == sorted(real.clone())
    };
    Said {
        line: format!("{case}: {real:?}, said {verdict} {named:?}"),
        case: case.to_owned(),
        right,
    }
}

/// What is said in one place of a document follows from what stands in another.
fn figures_agree(case: &str, said: &Explanation) {
    let close = |a: f64, b: f64| (a - b).abs() <= 1e-9 * (1.0 + a.abs().max(b.abs()));
    let train = &said.fit.train;
    let left = 1.0 - train.parameters_only.fit_percent / 100.0;
    let share = (1.0 - left * left).clamp(0.0, 1.0);
    let size = &said.effect_size;
    assert!(
        close(size.linear_share, share),
        "{case}: {size:?} {train:?}"
    );
    let kept = train.augmented.rmse / train.parameters_only.rmse;
    let removed = (1.0 - kept * kept).clamp(0.0, 1.0);
    assert!(close(size.removed_share, removed), "{case}: {size:?}");
    // Error and fit are of one spread.
    let spread = |f: &FitFigure| f.rmse / (1.0 - f.fit_percent / 100.0);
    for steps in [Some(train), said.fit.heldout.as_ref()]
        .into_iter()
        .flatten()
    {
        for figure in [&steps.simulation, &steps.augmented] {
            let (a, b) = (spread(figure), spread(&steps.parameters_only));
            assert!((a / b - 1.0).abs() < 1e-6, "{case}: {steps:?}");
        }
        assert!(
            steps.augmented.rmse < 1.02 * steps.parameters_only.rmse,
            "{case}: {steps:?}"
        );
    }
    if let Some(heldout) = &said.fit.heldout {
        let gain = heldout.parameters_only.rmse - heldout.augmented.rmse;
        assert!(close(size.heldout_gain, gain), "{case}: {size:?}");
        if let Some([low, high]) = heldout.improvement_95 {
            assert!(low <= gain && gain <= high, "{case}: {gain} {heldout:?}");
        }
    }
    // A name stands on blocks that were never fitted; but a frozen sensor is seen as it is.
    let fitted = said.effects.first().filter(|e| e.effect != "sensor_freeze");
    if let (Verdict::Named, Some(first)) = (said.verdict, fitted) {
        let evidence = &first.evidence;
        assert!(
            evidence.criterion_gain > evidence.criterion_needed,
            "{case}"
        );
        assert!(
            evidence.heldout_gain.is_none_or(|g| g > 0.0),
            "{case}: {evidence:?}"
        );
        assert!(size.heldout_gain > 0.0, "{case}: {size:?}");
        for (name, quantity) in &first.parameters {
            assert!(
                quantity.std.is_some_and(|std| std > 0.0 && std.is_finite()),
                "{case}: {name} {quantity:?}"
            );
        }
        assert!(
            said.fit.train.noise_floor.rmse < 1.05 * train.augmented.rmse,
            "{case}"
        );
        for alternative in &said.alternatives {
            let share = alternative.criterion_gain / evidence.criterion_gain;
            assert!(
                close(alternative.support, share.clamp(0.0, 1.0)),
                "{case}: {alternative:?}"
            );
        }
    }
    let remaining = &said.remaining;
    assert!(
        (0.0..=1.0).contains(&remaining.p_value),
        "{case}: {remaining:?}"
    );
    // Equations have score tests of their own, with another level.
    if said.plant.is_some() {
        return;
    }
    let quiet = remaining.sentence.starts_with("Nothing is left that");
    assert!(!quiet || remaining.adequate, "{case}: {remaining:?}");
    assert!(
        remaining.features == 0 || quiet == (remaining.p_value >= 0.01),
        "{case}: {remaining:?}"
    );
}

/// The prediction of the command line for the fresh input is that of the library.
fn round_trip(case: &str, data: &Path, scratch: &Folder, explanation: &Explanation) {
    let fresh = text(&data.join("fresh_input.csv"));
    let answer = data.join("fresh_simulation.csv");
    let mut arguments = vec!["simulate", "explanation.json", &fresh];
    let (answer_text, exists) = (text(&answer), answer.exists());
    if exists {
        arguments.extend(["--simulation", &answer_text]);
    }
    let (header, printed) = columns(&scratch.run(&arguments).ok());

    let read = |path: &Path, need| {
        Log::read_with(&Source::from(path.to_owned()), &Roles::default(), need).unwrap()
    };
    let input = read(&data.join("fresh_input.csv"), RoleNeed::InputsOnly);
    let inputs: Vec<&[f64]> = input.input_data.iter().map(Vec::as_slice).collect();
    let simulated = exists.then(|| read(&answer, RoleNeed::OutputsOnly));
    let simulated = simulated.as_ref().map(|log| log.output_data.as_slice());
    let outputs = match (&explanation.model, &explanation.plant) {
        (Some(model), _) => {
            let simulated: Option<Vec<&[f64]>> =
                simulated.map(|columns| columns.iter().map(Vec::as_slice).collect());
            model.simulate(&inputs, None, simulated.as_deref()).unwrap()
        }
        (None, Some(plant)) => plant.simulate(&input, simulated).unwrap(),
        (None, None) => panic!("{case}: nothing to simulate"),
    };
    assert_eq!(header.len(), outputs.len() + 1, "{case}");
    for (ours, theirs) in outputs.iter().zip(&printed[1..]) {
        assert_eq!(ours, theirs, "{case}");
    }
}

#[test]
fn concealed_cases_are_answered() {
    let schema: Value =
        serde_json::from_str(&schema::<innovant::explain::Explanation>().unwrap()).unwrap();
    let printed: Value = Folder::new().run(&["schema", "explanation"]).json();
    assert_eq!(schema, printed);
    let validator = jsonschema::draft202012::new(&schema).unwrap();
    let said: Vec<Said> = cases()
        .par_iter()
        .map(|case| ask(case, &validator))
        .collect();
    assert_eq!(said.len(), CASES);
    for s in &said {
        println!("{} {}", if s.right { "right" } else { "WRONG" }, s.line);
    }
    let wrong: Vec<&str> = said
        .iter()
        .filter(|s| !s.right)
        .map(|s| s.case.as_str())
        .collect();
    assert!(wrong.len() <= CASES - RIGHT, "not right: {wrong:?}");
}

/// What is left out of the library is not named, and what is not in it cannot be left out.
#[test]
fn effects_that_are_left_out() {
    let data = folder().join("case_003");
    let source = Source::from(data.join("recording.csv"));
    let recording = Log::read(&source, &Roles::default()).unwrap();
    let simulation = ["simulation.csv", "simulation.json"]
        .map(|name| data.join(name))
        .into_iter()
        .find(|path| path.exists())
        .unwrap();
    let scratch = Folder::new();
    let arguments = [
        &text(&data.join("recording.csv")),
        "--simulation",
        &text(&simulation),
    ];
    for (left_out, named) in [("quadratic_drag", true), ("cubic_stiffness", false)] {
        let flags = ["--without", left_out, "--output", "explanation.json"];
        scratch
            .run(&[&["explain"], &arguments[..], &flags].concat())
            .ok();
        let document = json(&scratch.join("explanation.json"));
        let effects = document["effects"].as_array().unwrap();
        let found = effects.iter().any(|e| e["effect"] == "cubic_stiffness");
        assert_eq!(found, named, "without {left_out}: {effects:?}");
    }
    let options = Options {
        without: vec!["nothing".to_owned()],
        ..Options::default()
    };
    let simulated = Simulation::Outputs(vec![recording.clone()]);
    assert!(matches!(
        explain(&[recording], &simulated, &options),
        Err(ExplainError::UnknownEffect { id }) if id == "nothing"
    ));
}
