//! `innovant batch`, from the outside.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use innovant::internal::systems;
use serde_json::Value;

use crate::folder::{Folder, Run, json};

/// A batch of these logs into `models`.
fn batch(folder: &Folder, logs: &[&str], more: &[&str]) -> Run {
    let mut arguments = vec!["batch"];
    arguments.extend(logs);
    arguments.extend(["--output-dir", "models"]);
    arguments.extend(more);
    folder.run(&arguments)
}

/// The summary by log: status, order, message.
fn summary(folder: &Folder) -> Vec<(String, String, String, String)> {
    let mut reader = csv::Reader::from_path(folder.join("models/summary.csv")).unwrap();
    let headers: Vec<String> = reader
        .headers()
        .unwrap()
        .iter()
        .map(str::to_owned)
        .collect();
    assert_eq!(
        headers.join(","),
        "name,status,order,samples,fit_percent,free_run_fit_percent,verdict,findings,seconds,message"
    );
    let field = |r: &csv::StringRecord, name: &str| {
        r[headers.iter().position(|h| h == name).unwrap()].to_owned()
    };
    reader
        .records()
        .map(|r| {
            let r = r.unwrap();
            (
                field(&r, "name"),
                field(&r, "status"),
                field(&r, "order"),
                field(&r, "message"),
            )
        })
        .collect()
}

fn three_logs() -> Folder {
    let folder = Folder::new();
    for (name, seed) in [("a.csv", 1), ("b.csv.gz", 2), ("c.csv", 3)] {
        folder.recording(name, &systems::van_wingerden_one(), 1000, seed);
    }
    folder
}

#[test]
fn a_bad_log_does_not_stop_the_good_ones() {
    let folder = three_logs();
    folder.text("bad.csv", "t,u,y\n0,1,2\n1,x,3\n");
    let run = batch(
        &folder,
        &["a.csv", "bad.csv", "b.csv.gz", "none.csv", "c.csv"],
        &[],
    );
    assert_eq!(run.code, 1, "{run:?}");
    assert_eq!(
        run.stdout,
        "3 identified, 0 kept from before, 2 failed; written to models/summary.csv\n"
    );
    assert!(
        run.stderr.contains("error: bad.csv, line 3"),
        "{}",
        run.stderr
    );
    assert!(run.stderr.contains("error: none.csv"), "{}", run.stderr);
    let rows = summary(&folder);
    let status: Vec<&str> = rows.iter().map(|r| r.1.as_str()).collect();
    assert_eq!(
        status,
        ["identified", "failed", "identified", "failed", "identified"]
    );
    assert_eq!((rows[0].0.as_str(), rows[0].2.as_str()), ("a.csv", "4"));
    assert!(rows[1].3.contains("line 3") && rows[1].2.is_empty());
    let names = |path: &Path| {
        let mut names: Vec<String> = fs::read_dir(path)
            .unwrap()
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    };
    assert_eq!(
        names(&folder.join("models")),
        ["a.json", "b.json", "c.json", "summary.csv"]
    );
}

#[test]
fn each_model_is_that_of_identify_whatever_the_threads() {
    let folder = three_logs();
    let logs = ["a.csv", "b.csv.gz", "c.csv"];
    let options = ["--order", "2..5", "--covariance", "robust"];
    batch(
        &folder,
        &logs,
        &[&options[..], &["--threads", "2"]].concat(),
    )
    .ok();
    for (log, model) in [("a.csv", "a.json"), ("b.csv.gz", "b.json")] {
        let mut single = vec!["identify", log, "--threads", "1", "-q", "--output", model];
        single.extend(options);
        folder.run(&single).ok();
        assert_eq!(
            fs::read_to_string(folder.join(model)).unwrap(),
            fs::read_to_string(folder.join("models").join(model)).unwrap()
        );
    }
}

#[test]
fn what_is_there_is_kept_and_what_changed_is_done_again() {
    let folder = three_logs();
    let logs = ["a.csv", "b.csv.gz"];
    batch(&folder, &logs, &[]).ok();
    let before = fs::read(folder.join("models/a.json")).unwrap();
    let told = batch(&folder, &["a.csv", "b.csv.gz", "c.csv"], &["-v"]);
    assert!(told.stderr.contains("a.csv: kept"), "{}", told.stderr);
    assert_eq!(
        told.ok(),
        "1 identified, 2 kept from before, 0 failed; written to models/summary.csv\n"
    );
    assert_eq!(fs::read(folder.join("models/a.json")).unwrap(), before);
    // The row of a model from before says the same as that of a new one.
    let rows = summary(&folder);
    assert_eq!((rows[0].1.as_str(), rows[0].2.as_str()), ("kept", "4"));

    // A changed log, another option, a damaged model, and asking for it.
    folder.recording("a.csv", &systems::van_wingerden_one(), 1000, 9);
    assert!(
        batch(&folder, &logs, &[])
            .ok()
            .starts_with("1 identified, 1 kept")
    );
    assert!(
        batch(&folder, &logs, &["--order", "4"])
            .ok()
            .starts_with("2 identified, 0 kept")
    );
    folder.text("models/b.json", "{\"A\": [[");
    assert!(
        batch(&folder, &logs, &["--order", "4"])
            .ok()
            .starts_with("1 identified, 1 kept")
    );
    assert!(
        batch(&folder, &logs, &["--order", "4", "--again"])
            .ok()
            .starts_with("2 identified, 0 kept")
    );
    // A log that turned bad leaves no model that is not its own.
    folder.text("a.csv", "t,u,y\n0,1,2\n");
    assert_eq!(batch(&folder, &logs, &["--order", "4"]).code, 1);
    assert!(!folder.join("models/a.json").exists());
}

#[test]
fn killed_midway_it_leaves_whole_files_and_goes_on() {
    let folder = Folder::new();
    let names: Vec<String> = (0..24).map(|i| format!("{i}.csv")).collect();
    for (seed, name) in names.iter().enumerate() {
        folder.recording(name, &systems::van_wingerden_one(), 4000, seed as u64);
    }
    let mut child = Command::new(env!("CARGO_BIN_EXE_innovant"))
        .current_dir(folder.path())
        .args(["batch", "--output-dir", "models", "--threads", "1"])
        .args(&names)
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let models = || -> Vec<Value> {
        let Ok(entries) = fs::read_dir(folder.join("models")) else {
            return Vec::new();
        };
        entries
            .map(|e| e.unwrap().path())
            .filter(|path| path.extension().is_some_and(|e| e == "json"))
            .map(|path| json(&path))
            .collect()
    };
    let started = Instant::now();
    while models().len() < 3 {
        assert!(started.elapsed() < Duration::from_secs(60), "no model came");
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let done = models().len();
    assert!((3..24).contains(&done), "{done} of 24 before it was killed");
    assert!(!folder.join("models/summary.csv").exists());
    let logs: Vec<&str> = names.iter().map(String::as_str).collect();
    let said = batch(&folder, &logs, &[]).ok();
    assert_eq!(
        said,
        format!(
            "{} identified, {done} kept from before, 0 failed; written to models/summary.csv\n",
            24 - done
        )
    );
    assert_eq!(summary(&folder).len(), 24);
}

#[test]
fn what_cannot_be_begun_is_refused() {
    let folder = three_logs();
    fs::create_dir(folder.join("other")).unwrap();
    fs::copy(folder.join("c.csv"), folder.join("other/a.csv")).unwrap();
    let error = batch(&folder, &["a.csv", "other/a.csv"], &[]).error();
    assert!(
        error.contains("a.csv and other/a.csv would both become models/a.json"),
        "{error}"
    );
    assert!(
        batch(&folder, &["a.csv", "a.csv"], &[])
            .error()
            .contains("given twice")
    );
    assert!(batch(&folder, &["-"], &[]).error().contains("reads files"));
    folder.text("models", "a file");
    assert!(
        batch(&folder, &["a.csv"], &[])
            .error()
            .contains("cannot make this directory")
    );
}
