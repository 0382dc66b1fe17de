//! The same input gives the same bytes: twice, and on any number of threads. Where a document says where it comes from is
//! the only place in which it may differ.

use std::fs;
use std::path::Path;

use innovant::internal::systems;

use crate::folder::{Folder, json};

fn concealed(case: &str, name: &str) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/concealed");
    folder.join(case).join(name).display().to_string()
}

/// The documents of every command that computes, by name.
fn documents(folder: &Folder, threads: &str) -> Vec<(&'static str, String)> {
    let run = |arguments: &[&str]| {
        let run = folder.run(&[arguments, &["--threads", threads]].concat());
        assert!(run.code <= 1, "{run:?}");
        run.stdout
    };
    let mut made = vec![
        ("model", run(&["identify", "log.csv", "--output", "-"])),
        (
            "model with a robust covariance",
            run(&[
                "identify",
                "log.csv",
                "--covariance",
                "robust",
                "--output",
                "-",
            ]),
        ),
        ("page", run(&["identify", "log.csv", "--report", "-"])),
        (
            "validation",
            run(&["validate", "model.json", "fresh.csv", "--format", "json"]),
        ),
        (
            "responses",
            run(&["show", "model.json", "--format", "json"]),
        ),
        ("simulation", run(&["simulate", "model.json", "fresh.csv"])),
    ];
    for (name, case, simulated) in [
        ("explanation", "case_006", "simulation.csv"),
        ("explanation of two outputs", "case_004", "simulation.json"),
    ] {
        let recording = concealed(case, "recording.csv");
        let simulation = concealed(case, simulated);
        made.push((
            name,
            run(&[
                "explain",
                &recording,
                "--simulation",
                &simulation,
                "--output",
                "-",
            ]),
        ));
    }
    made
}

#[test]
fn documents_do_not_depend_on_the_run_or_on_threads() {
    let folder = Folder::new();
    let system = systems::van_wingerden_one();
    folder.recording("log.csv", &system, 1500, 1);
    folder.recording("fresh.csv", &system, 800, 2);
    folder
        .run(&["identify", "log.csv", "-q", "--output", "model.json"])
        .ok();
    let one = documents(&folder, "1");
    for ((name, one), (_, two)) in one.iter().zip(documents(&folder, "2")) {
        assert!(one.len() > 1000, "{name}: {one}");
        assert!(
            *one == two,
            "{name}: one thread and two give different bytes"
        );
    }
}

#[test]
fn models_differ_in_their_provenance_only() {
    let folder = Folder::new();
    folder.recording("log.csv", &systems::van_wingerden_one(), 1000, 1);
    fs::create_dir(folder.join("elsewhere")).unwrap();
    fs::copy(folder.join("log.csv"), folder.join("elsewhere/copy.csv")).unwrap();
    let model = |log: &str, more: &[&str], output: &str| {
        folder
            .run(&[&["identify", log, "-q", "--output", output], more].concat())
            .ok();
        json(&folder.join(output))
    };
    let first = model("log.csv", &[], "first.json");
    let mut copy = model("elsewhere/copy.csv", &[], "second.json");
    // Roles that are named are those that are found.
    let mut named = model(
        "log.csv",
        &["--inputs", "u1,u2", "--outputs", "y1,y2"],
        "third.json",
    );
    for (what, other) in [("another name", &mut copy), ("another request", &mut named)] {
        assert_ne!(first["provenance"], other["provenance"], "{what}");
        other["provenance"] = first["provenance"].clone();
        assert_eq!(first, *other, "{what}");
    }
}

#[test]
fn explanations_differ_in_the_names_of_their_files_only() {
    let folder = Folder::new();
    for name in ["recording.csv", "simulation.csv"] {
        fs::copy(concealed("case_006", name), folder.join(name)).unwrap();
        fs::copy(
            concealed("case_006", name),
            folder.join(&format!("copy_of_{name}")),
        )
        .unwrap();
    }
    let explain = |recording: &str, simulation: &str, output: &str| {
        folder
            .run(&[
                "explain",
                recording,
                "--simulation",
                simulation,
                "-q",
                "--output",
                output,
            ])
            .ok();
        json(&folder.join(output))
    };
    let first = explain("recording.csv", "simulation.csv", "first.json");
    let mut other = explain(
        "copy_of_recording.csv",
        "copy_of_simulation.csv",
        "second.json",
    );
    assert_ne!(first["recordings"], other["recordings"]);
    other["recordings"] = first["recordings"].clone();
    for key in first.as_object().unwrap().keys() {
        assert!(first[key] == other[key], "`{key}` differs");
    }
    assert!(first == other);
}
