//! Questions that `innovant explain` cannot answer end in exit code 2 and one message that says where and what to do,
//! and leave no file behind; so do explanations that cannot be simulated.

use innovant::internal::systems;
use innovant::model::StateSpace;
use serde_json::Value;

use crate::folder::{Folder, json};

const SAMPLES: usize = 600;

fn servo() -> StateSpace {
    systems::servo().system
}

/// Recorded inputs and outputs, and simulated outputs.
struct Signals {
    u: Vec<f64>,
    y: Vec<f64>,
    simulated: Vec<f64>,
}

fn signals(samples: usize) -> Signals {
    let log = systems::servo().record(samples, 3);
    let (u, y) = (log.input_data[0].clone(), log.output_data[0].clone());
    let simulated = servo().simulate(&[&u], None).unwrap().remove(0);
    Signals { u, y, simulated }
}

fn table(header: &str, sample_time: f64, columns: &[&[f64]]) -> String {
    let mut text = format!("{header}\n");
    for k in 0..columns[0].len() {
        text.push_str(&(k as f64 * sample_time).to_string());
        for column in columns {
            text.push_str(&format!(",{}", column[k]));
        }
        text.push('\n');
    }
    text
}

fn model_json(system: &StateSpace) -> String {
    let rows = |m: &nalgebra::DMatrix<f64>| -> Vec<Vec<f64>> {
        m.row_iter().map(|r| r.iter().copied().collect()).collect()
    };
    serde_json::json!({
        "A": rows(&system.a),
        "B": rows(&system.b),
        "C": rows(&system.c),
        "D": rows(&system.d),
        "dt": system.sample_time,
    })
    .to_string()
}

const DT: f64 = 1e-3;

/// A folder with a recording and a simulation that go together.
fn good() -> Folder {
    let folder = Folder::new();
    let s = signals(SAMPLES);
    folder.text("recording.csv", &table("t,u1,y1", DT, &[&s.u, &s.y]));
    folder.text("simulated.csv", &table("t,y1", DT, &[&s.simulated]));
    folder.text("model.json", &model_json(&servo()));
    folder
}

/// The message of `explain RECORDING --simulation SIMULATION`, which leaves nothing behind.
#[track_caller]
fn about(folder: &Folder, recordings: &[&str], simulations: &[&str], flags: &[&str]) -> String {
    let before = folder.files();
    let mut arguments = vec!["explain"];
    arguments.extend(recordings);
    arguments.push("--simulation");
    arguments.extend(simulations);
    arguments.extend(flags);
    arguments.extend(["--output", "explanation.json", "--report", "page.html"]);
    let message = folder.run(&arguments).error();
    assert_eq!(folder.files(), before, "{message}");
    message
}

#[track_caller]
fn says(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "`{part}` is not in: {message}");
    }
}

#[test]
fn simulations_of_another_length() {
    let folder = good();
    let s = signals(SAMPLES - 100);
    folder.text("short.csv", &table("t,y1", DT, &[&s.simulated]));
    // What both have is compared, and it is said how much that leaves out.
    let run = folder.run(&[
        "explain",
        "recording.csv",
        "--simulation",
        "short.csv",
        "--output",
        "explanation.json",
    ]);
    says(
        &run.stderr,
        &["short.csv: 100 samples of recording.csv are outside"],
    );
    run.ok();
    let explanation = json(&folder.join("explanation.json"));
    assert_eq!(explanation["recordings"][0]["samples"], SAMPLES - 100);
}

#[test]
fn simulations_of_another_sampling() {
    let folder = good();
    let s = signals(SAMPLES);
    folder.text("slow.csv", &table("t,y1", 2.0 * DT, &[&s.simulated]));
    says(
        &about(&folder, &["recording.csv"], &["slow.csv"], &[]),
        &[
            "slow.csv: the simulation has a sample every 0.002 s",
            "recording.csv every 0.001 s",
            "simulate at",
            "--resample 0.002",
        ],
    );
    let slow = StateSpace {
        sample_time: 2.0 * DT,
        ..servo()
    };
    folder.text("slow.json", &model_json(&slow));
    says(
        &about(&folder, &["recording.csv"], &["slow.json"], &[]),
        &["slow.json: sample time 0.002 s", "0.001 s", "simulate at"],
    );
}

#[test]
fn simulations_with_other_channels() {
    let folder = good();
    let s = signals(SAMPLES);
    let two = table("t,y1,y2", DT, &[&s.simulated, &s.y]);
    folder.text(
        "two.csv",
        &table("t,u1,y1,y2", DT, &[&s.u, &s.y, &s.simulated]),
    );
    says(
        &about(&folder, &["two.csv"], &["simulated.csv"], &[]),
        &[
            "simulated.csv: no simulated output `y2`",
            "`y1`, `y2`",
            "`--map 'SIMULATED=y2'`",
        ],
    );
    folder.text("others.csv", &two.replace("y1,y2", "y3,y4"));
    says(
        &about(&folder, &["recording.csv"], &["others.csv"], &[]),
        &[
            "others.csv: no simulated output `y1`",
            "`y3`, `y4`",
            "--map",
        ],
    );
    folder.text("model2.json", &model_json(&systems::two_by_two().system));
    says(
        &about(&folder, &["recording.csv"], &["model2.json"], &[]),
        &["model2.json", "2 inputs", "recording.csv has 1"],
    );
}

#[test]
fn units_that_contradict() {
    let folder = Folder::new();
    let s = signals(SAMPLES);
    folder.text(
        "recording.csv",
        &table("t,u1 [V],y1 [m]", DT, &[&s.u, &s.y]),
    );
    folder.text("simulated.csv", &table("t,y1 [mm]", DT, &[&s.simulated]));
    says(
        &about(&folder, &["recording.csv"], &["simulated.csv"], &[]),
        &[
            "simulated.csv: the units of y1 contradict each other",
            "it is in mm",
            "in m (1 mm is 0.001",
            "convert",
        ],
    );
}

#[test]
fn units_that_are_only_spelled_differently() {
    let folder = Folder::new();
    let s = signals(SAMPLES);
    folder.text(
        "recording.csv",
        &table("t,u1 [V],y1 [ls-1]", DT, &[&s.u, &s.y]),
    );
    for unit in ["l/s", "l s^-1", "counts"] {
        let header = format!("t,y1 [{unit}]");
        folder.text("simulated.csv", &table(&header, DT, &[&s.simulated]));
        let arguments = [
            "explain",
            "recording.csv",
            "--simulation",
            "simulated.csv",
            "-o",
            "e.json",
        ];
        folder.run(&arguments).ok();
    }
}

/// A car that coasts: speed under rolling resistance and drag.
fn coasting(drag: f64) -> Vec<f64> {
    let mut v = 8.0;
    let fine = 100;
    (0..200)
        .map(|_| {
            let now = v;
            for _ in 0..fine {
                v -= (0.02 + drag * v * v) / f64::from(fine);
            }
            now
        })
        .collect()
}

#[test]
fn a_free_decay_has_no_inputs() {
    let folder = Folder::new();
    let noisy: Vec<f64> = coasting(8e-4)
        .iter()
        .enumerate()
        .map(|(k, v)| v + 0.01 * (7.3 * (k * k % 97) as f64).sin())
        .collect();
    let simulated = coasting(0.0);
    folder.text("coast.csv", &table("t,speed [m/s]", 1.0, &[&noisy]));
    folder.text("simulated.csv", &table("t,speed", 1.0, &[&simulated]));
    let plain = [
        "explain",
        "coast.csv",
        "--simulation",
        "simulated.csv",
        "--outputs",
        "speed",
        "-o",
        "e.json",
    ];
    folder.run(&plain).ok();
    let found = json(&folder.join("e.json"));
    assert_ne!(found["verdict"], "consistent", "{}", found["summary"]);
    assert!(
        found["plant"]["modelica"].is_string(),
        "{}",
        found["summary"]
    );
    folder
        .run(&["simulate", "e.json", "coast.csv", "-o", "out.csv"])
        .ok();

    // A further column may be an input.
    let zeros = vec![0.0; 200];
    folder.text("brake.csv", &table("t,brake,speed", 1.0, &[&zeros, &noisy]));
    let arguments = [
        "explain",
        "brake.csv",
        "--simulation",
        "simulated.csv",
        "--outputs",
        "speed",
    ];
    let message = folder.run(&arguments).error();
    says(&message, &["brake.csv: no inputs", "`--inputs none`"]);
    folder
        .run(&[&arguments[..], &["--inputs", "none", "-o", "e.json"]].concat())
        .ok();
}

#[test]
fn an_input_that_never_changes_is_named() {
    let folder = Folder::new();
    let s = signals(SAMPLES);
    let rest = vec![1.0; SAMPLES];
    folder.text("recording.csv", &table("t,u1,y1", DT, &[&rest, &s.y]));
    folder.text("simulated.csv", &table("t,y1", DT, &[&s.simulated]));
    says(
        &about(&folder, &["recording.csv"], &["simulated.csv"], &[]),
        &[
            "no dynamic model",
            "the input `u1` never changes",
            "--inputs none",
        ],
    );
}

#[test]
fn recordings_that_say_too_little() {
    let folder = good();
    let s = signals(100);
    folder.text("short.csv", &table("t,u1,y1", DT, &[&s.u, &s.y]));
    folder.text("short_simulated.csv", &table("t,y1", DT, &[&s.simulated]));
    for simulation in ["short_simulated.csv", "model.json"] {
        says(
            &about(&folder, &["short.csv"], &[simulation], &[]),
            &["short.csv: 100 samples are too few", "150", "record longer"],
        );
    }
    let s = signals(SAMPLES);
    let still = vec![2.5; SAMPLES];
    folder.text("still.csv", &table("t,u1,y1", DT, &[&s.u, &still]));
    says(
        &about(&folder, &["still.csv"], &["model.json"], &[]),
        &["still.csv", "y1", "is constant"],
    );
}

/// A short recording is asked what is left of it, about less.
#[test]
fn short_recordings_are_tested_too() {
    let folder = Folder::new();
    let Signals { u, y, simulated } = signals(200);
    folder.text("recording.csv", &table("t,u1,y1", DT, &[&u, &y]));
    folder.text("simulation.csv", &table("t,u1,y1", DT, &[&u, &simulated]));
    let arguments = [
        "recording.csv",
        "--simulation",
        "simulation.csv",
        "--output",
    ];
    let arguments = [&["explain"], &arguments[..], &["answer.json"]].concat();
    folder.run(&arguments).ok();
    let answer = json(&folder.join("answer.json"));
    let features = answer["remaining"]["features"].as_u64().unwrap();
    assert!((8..=50).contains(&features), "{}", answer["remaining"]);
}

#[test]
fn simulations_without_dynamics() {
    let folder = good();
    let mut system = servo();
    system.c *= 0.0;
    system.d.fill(2.0);
    folder.text("static.json", &model_json(&system));
    says(
        &about(&folder, &["recording.csv"], &["static.json"], &[]),
        &["static.json: no output shows any state", "give a model"],
    );
}

#[test]
fn simulations_that_run_away() {
    let folder = good();
    let mut system = servo();
    system.a *= 1.3;
    folder.text("unstable.json", &model_json(&system));
    says(
        &about(&folder, &["recording.csv"], &["unstable.json"], &[]),
        &[
            "unstable.json: the simulation is unstable",
            "spectral radius 1.2",
            "stable model",
        ],
    );
}

#[test]
fn documents_that_are_no_simulation() {
    let folder = good();
    for (text, parts) in [
        (
            "{\"A\": [[0.5]],\n \"B\": [[1",
            &["garbage.json, line 2", "not whole"][..],
        ),
        (
            "hello",
            &["garbage.json: this is not a JSON document", "`hello`"],
        ),
        ("", &["garbage.json", "the file is empty"]),
        ("[1, 2]", &["garbage.json", "not a JSON document"]),
        (
            "{\"A\": [[0.5]], \"dt\": 1}",
            &["garbage.json", "there is no key `B`"],
        ),
        (
            "{\"A\": 0.5, \"B\": 1, \"C\": \"x\", \"dt\": 0.001}",
            &["garbage.json", "key `C"],
        ),
    ] {
        folder.text("garbage.json", text);
        let message = about(&folder, &["recording.csv"], &["garbage.json"], &[]);
        says(&message, parts);
    }
    says(
        &about(&folder, &["recording.csv"], &["nowhere.csv"], &[]),
        &["nowhere.csv: cannot open", "check the path"],
    );
    // Outputs that have nothing to do with the inputs.
    let noise = systems::servo().record(SAMPLES, 99);
    folder.text("noise.csv", &table("t,y1", DT, &[&noise.input_data[0]]));
    says(
        &about(&folder, &["recording.csv"], &["noise.csv"], &[]),
        &[
            "noise.csv: no dynamic model reproduces",
            "simulated with these inputs",
        ],
    );
}

#[test]
fn options_that_are_not_possible() {
    let folder = good();
    says(
        &about(
            &folder,
            &["recording.csv"],
            &["simulated.csv"],
            &["--without", "coulomb_friction,colomb_friction"],
        ),
        &["no effect called colomb_friction", "--help"],
    );
    folder.recording("recording2.csv", &systems::servo(), SAMPLES, 4);
    says(
        &about(
            &folder,
            &["recording.csv", "recording2.csv"],
            &["simulated.csv"],
            &[],
        ),
        &[
            "2 recordings and 1 simulations",
            "for each recording",
            "same order",
        ],
    );
    says(
        &about(
            &folder,
            &["recording.csv"],
            &["simulated.csv", "model.json"],
            &[],
        ),
        &["--simulation takes one model", "one CSV a recording"],
    );
    says(
        &about(&folder, &["recording.csv"], &["recording.csv"], &[]),
        &["recording.csv", "given twice"],
    );
    let same = folder
        .run(&[
            "explain",
            "recording.csv",
            "--simulation",
            "model.json",
            "--output",
            "same",
            "--report",
            "same",
        ])
        .error();
    says(&same, &["same", "--output and --report"]);
    let over = folder
        .run(&[
            "explain",
            "recording.csv",
            "--simulation",
            "model.json",
            "--output",
            "model.json",
        ])
        .error();
    says(&over, &["model.json"]);
    assert_eq!(json(&folder.join("model.json"))["dt"], DT);
}

/// The help lists what `--without` takes.
#[test]
fn the_help_lists_the_effects() {
    let help = Folder::new().run(&["explain", "--help"]).ok();
    let mut missing: Vec<&str> = innovant::internal::effects::library()
        .map(|d| d.id)
        .filter(|id| !help.contains(id))
        .collect();
    missing.dedup();
    assert!(missing.is_empty(), "not in the help: {missing:?}");
}

#[test]
fn simulations_belong_to_explanations() {
    let folder = good();
    let before = folder.files();
    let message = folder
        .run(&[
            "simulate",
            "model.json",
            "recording.csv",
            "--simulation",
            "simulated.csv",
            "--output",
            "out.csv",
        ])
        .error();
    says(
        &message,
        &[
            "model.json",
            "--simulation belongs to an explanation",
            "leave it out",
        ],
    );
    assert_eq!(folder.files(), before);
}

/// An explanation, to be damaged.
struct Whole {
    folder: Folder,
    document: Value,
}

impl Whole {
    fn new() -> Self {
        let folder = good();
        let made = folder.run(&[
            "explain",
            "recording.csv",
            "--simulation",
            "model.json",
            "--output",
            "explanation.json",
        ]);
        assert_eq!(made.code, 0, "{}", made.stderr);
        let document = json(&folder.join("explanation.json"));
        Self { folder, document }
    }

    /// The message about a text in place of the explanation.
    fn about(&self, text: &str) -> String {
        self.folder.text("damaged.json", text);
        let before = self.folder.files();
        let message = self
            .folder
            .run(&["simulate", "damaged.json", "recording.csv", "-o", "out.csv"])
            .error();
        assert_eq!(self.folder.files(), before, "{message}");
        message
    }

    /// The message about the explanation after a change.
    fn spoilt(&self, change: impl Fn(&mut Value)) -> String {
        let mut document = self.document.clone();
        change(&mut document);
        self.about(&document.to_string())
    }
}

#[test]
fn explanations_without_a_key() {
    let whole = Whole::new();
    let inner = whole.spoilt(|d| {
        d["model"].as_object_mut().unwrap().remove("A");
    });
    says(
        &inner,
        &["damaged.json, line 1", "there is no key `A`", "key `model"],
    );
    let outer = whole.spoilt(|d| {
        d.as_object_mut().unwrap().remove("model");
    });
    says(&outer, &["damaged.json, line 1", "there is no key `model`"]);
    // Where the whole format is to be found.
    for message in [inner, outer] {
        says(&message, &["innovant schema explanation"]);
    }
}

#[test]
fn damaged_explanations() {
    let whole = Whole::new();
    let version = whole.spoilt(|d| d["format"] = "innovant-explanation/9".into());
    says(
        &version,
        &[
            "damaged.json",
            "`innovant-explanation/9`",
            "explain the recording again",
        ],
    );
    let shape = whole.spoilt(|d| d["model"]["B"] = serde_json::json!([[1.0]]));
    says(&shape, &["damaged.json", "B is 1 x 1", "not 3 x 1"]);
    let time = whole.spoilt(|d| d["model"]["sample_time"] = (-1.0).into());
    says(&time, &["damaged.json", "sample time"]);
    let unknown = whole.spoilt(|d| {
        d["model"]["effects"] = serde_json::json!([{
            "effect": "phlogiston", "channel": 0, "looks_at": {"output": 0}, "parameters": [],
        }]);
    });
    says(&unknown, &["damaged.json", "`phlogiston`", "does not know"]);
    let text = whole.document.to_string();
    let half = text[..text.len() / 2].rfind(',').unwrap();
    says(&whole.about(&text[..=half]), &["damaged.json", "not whole"]);
}

/// An explanation is no model, and says so.
#[test]
fn explanations_are_no_models() {
    let folder = good();
    folder.text("e.json", "{\"format\": \"innovant-explanation/1\"}");
    let message = about(&folder, &["recording.csv"], &["e.json"], &[]);
    says(&message, &["e.json", "an explanation and not a model"]);
}

/// Another zero of the clock moves every time that is said, and nothing else.
#[test]
fn times_are_those_of_the_recording() {
    let folder = Folder::new();
    let case = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("data/concealed/case_001");
    let later = |name: &str, by: f64| {
        let text = std::fs::read_to_string(case.join(name)).unwrap();
        let mut lines = text.lines();
        let header = lines.next().unwrap().to_owned();
        let moved = lines.map(|line| {
            let (t, rest) = line.split_once(',').unwrap();
            format!("{},{rest}", t.parse::<f64>().unwrap() + by)
        });
        let moved: Vec<String> = std::iter::once(header).chain(moved).collect();
        folder.text(&format!("{by}_{name}"), &(moved.join("\n") + "\n"));
    };
    let said = |by: f64| -> Value {
        later("recording.csv", by);
        later("simulation.csv", by);
        let (recording, simulation) = (
            format!("{by}_recording.csv"),
            format!("{by}_simulation.csv"),
        );
        let arguments = [
            "explain",
            &recording,
            "--simulation",
            &simulation,
            "--output",
            "e.json",
        ];
        let run = folder.run(&arguments);
        assert_eq!(run.code, 0, "{}", run.stderr);
        json(&folder.join("e.json"))
    };
    let (early, late) = (said(0.0), said(640.0));
    let numbers = |v: &Value| -> Vec<f64> {
        v.as_array()
            .unwrap()
            .iter()
            .map(|v| v.as_f64().unwrap())
            .collect()
    };
    let moved = |path: &str| {
        let (a, b) = (
            numbers(early.pointer(path).unwrap()),
            numbers(late.pointer(path).unwrap()),
        );
        assert!(!a.is_empty() && a.len() == b.len(), "{path}");
        for (a, b) in a.iter().zip(&b) {
            assert!((b - a - 640.0).abs() < 1e-3, "{path}: {a} {b}");
        }
    };
    moved("/signals/0/time");
    for path in [
        "/where/time/0/0",
        "/where/time/0/1",
        "/effects/0/parameters/from/value",
    ] {
        let at = |e: &Value| e.pointer(path).unwrap().as_f64().unwrap();
        assert!((at(&late) - at(&early) - 640.0).abs() < 1e-3, "{path}");
    }
    // What is drawn at a time is what was recorded then.
    let text = std::fs::read_to_string(case.join("recording.csv")).unwrap();
    let recorded: Vec<f64> = text
        .lines()
        .skip(1)
        .map(|line| line.rsplit(',').next().unwrap().parse().unwrap())
        .collect();
    let picture = &late["signals"][0];
    for (t, y) in numbers(&picture["time"])
        .iter()
        .zip(numbers(&picture["recorded"]))
    {
        let k = ((t - 640.0) / 0.01).round() as usize;
        assert!((recorded[k] - y).abs() < 1e-12, "{t}");
    }
    let share = |e: &Value| e["remaining"]["share"].as_f64().unwrap();
    assert!((share(&late) - share(&early)).abs() < 1e-6);
}
