//! What a killed process, a full disk and an input that goes away leave behind: the old output or the whole new one, no
//! parts that pile up, and one message that says what to do.
//!
//! `INNOVANT_FAULT_KILLS=200 cargo test --release --test faults` for more kills than the few of every day.

#![cfg(unix)]

#[path = "support/folder.rs"]
mod folder;

use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use folder::{Folder, json};
use innovant::internal::systems;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Kills in a test of every day; each of the four commands gets its share.
const KILLS: usize = 12;
/// What stands in an output before.
const OLD: &str = "what was there before\n";
/// Logs in the batch that is killed.
const LOGS: usize = 6;

fn kills() -> usize {
    let asked = std::env::var("INNOVANT_FAULT_KILLS").ok();
    asked.map_or(KILLS, |text| text.parse().expect("a number of kills"))
}

fn innovant(folder: &Folder, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_innovant"));
    command
        .current_dir(folder.path())
        .env("LC_ALL", "C")
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    command
}

/// Files that are only on their way, in `folder`.
fn parts(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else {
        return Vec::new();
    };
    entries
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "part"))
        .collect()
}

/// When to kill.
enum Moment {
    After(Duration),
    /// As soon as a part is seen: the moment that matters most, and a short one.
    WhileWriting,
}

/// Kills a process at that moment; whether it was still running.
fn kill(mut child: Child, moment: &Moment, outputs: &Path) -> bool {
    match moment {
        Moment::After(time) => std::thread::sleep(*time),
        Moment::WhileWriting => {
            while parts(outputs).is_empty() && child.try_wait().unwrap().is_none() {}
        }
    }
    // SIGKILL; no error when it has ended already.
    child.kill().unwrap();
    let status = child.wait().unwrap();
    assert!(status.code().is_none_or(|code| code == 0), "{status}");
    status.code().is_none()
}

/// A command with one output, killed again and again.
fn killed(
    folder: &Folder,
    arguments: &[&str],
    output: &str,
    kills: usize,
    random: &mut ChaCha8Rng,
) {
    let place = folder.join("out");
    fs::create_dir_all(&place).unwrap();
    let path = place.join(output);
    let named = format!("out/{output}");
    let whole = [arguments, &[named.as_str()]].concat();
    let started = Instant::now();
    assert!(innovant(folder, &whole).status().unwrap().success());
    let duration = started.elapsed();
    let new = fs::read(&path).unwrap();
    let mut died = 0;
    for round in 0..kills {
        fs::write(&path, OLD).unwrap();
        let moment = if round % 2 == 0 {
            Moment::WhileWriting
        } else {
            Moment::After(duration.mul_f64(random.random_range(0.0..1.2)))
        };
        let child = innovant(folder, &whole).spawn().unwrap();
        died += usize::from(kill(child, &moment, &place));
        let found = fs::read(&path).unwrap();
        assert!(
            found == OLD.as_bytes() || found == new,
            "{arguments:?}: neither the old nor the new output, but {} bytes",
            found.len()
        );
        // A run leaves one part at most, and clears those of the runs before it.
        assert!(
            parts(&place).len() <= 1,
            "{arguments:?}: {:?}",
            parts(&place)
        );
    }
    assert!(
        kills < 4 || died > 0,
        "{arguments:?}: nothing was killed in time"
    );
    assert!(innovant(folder, &whole).status().unwrap().success());
    assert_eq!(fs::read(&path).unwrap(), new);
    assert_eq!(parts(&place), Vec::<PathBuf>::new());
}

#[test]
fn a_killed_command_leaves_the_old_output_or_the_whole_new_one() {
    let mut random = ChaCha8Rng::seed_from_u64(6);
    let folder = Folder::new();
    folder.recording("log.csv", &systems::van_wingerden_one(), 2000, 1);
    let share = kills() / 4;
    killed(
        &folder,
        &["identify", "log.csv", "-q", "--output"],
        "model.json",
        share,
        &mut random,
    );
    killed(
        &folder,
        &["identify", "log.csv", "-q", "--report"],
        "page.html",
        share,
        &mut random,
    );
    let case = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/concealed/case_006");
    let file = |name: &str| case.join(name).display().to_string();
    killed(
        &folder,
        &[
            "explain",
            &file("recording.csv"),
            "--simulation",
            &file("simulation.csv"),
            "-q",
            "--output",
        ],
        "explanation.json",
        share,
        &mut random,
    );
}

/// The models of a batch by name.
fn models(folder: &Folder) -> BTreeMap<String, Vec<u8>> {
    let Ok(entries) = fs::read_dir(folder.join("models")) else {
        return BTreeMap::new();
    };
    entries
        .map(|entry| entry.unwrap())
        .filter(|entry| entry.path().extension().is_some_and(|e| e == "json"))
        .map(|e| {
            (
                e.file_name().into_string().unwrap(),
                fs::read(e.path()).unwrap(),
            )
        })
        .collect()
}

/// Log and status of each row of the summary.
fn summary(folder: &Folder) -> Vec<(String, String)> {
    csv::Reader::from_path(folder.join("models/summary.csv"))
        .unwrap()
        .records()
        .map(|row| row.unwrap())
        .map(|row| (row[0].to_owned(), row[1].to_owned()))
        .collect()
}

#[test]
fn a_killed_batch_goes_on_where_it_was() {
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let folder = Folder::new();
    let names: Vec<String> = (0..LOGS).map(|i| format!("log{i}.csv")).collect();
    for (i, name) in names.iter().enumerate() {
        folder.recording(name, &systems::van_wingerden_one(), 1500, i as u64);
    }
    let mut arguments = vec!["batch", "-q", "--output-dir", "models"];
    arguments.extend(names.iter().map(String::as_str));
    let started = Instant::now();
    assert!(innovant(&folder, &arguments).status().unwrap().success());
    let duration = started.elapsed();
    let all = models(&folder);
    assert_eq!(all.len(), LOGS);
    for round in 0..kills() / 4 {
        fs::remove_dir_all(folder.join("models")).unwrap();
        let moment = if round % 2 == 0 {
            Moment::WhileWriting
        } else {
            Moment::After(duration.mul_f64(random.random_range(0.0..1.2)))
        };
        let child = innovant(&folder, &arguments).spawn().unwrap();
        kill(child, &moment, &folder.join("models"));
        let made = models(&folder);
        for (name, model) in &made {
            assert!(all[name] == *model, "{name} is not whole");
        }
        assert!(innovant(&folder, &arguments).status().unwrap().success());
        assert!(models(&folder) == all, "not every model is there and right");
        assert_eq!(parts(&folder.join("models")), Vec::<PathBuf>::new());
        let expected: Vec<(String, String)> = names
            .iter()
            .map(|log| {
                let model = log.replace(".csv", ".json");
                let status = if made.contains_key(&model) {
                    "kept"
                } else {
                    "identified"
                };
                (log.clone(), status.to_owned())
            })
            .collect();
        assert_eq!(summary(&folder), expected);
    }
}

/// Runs `innovant` where no file may be larger than `kilobytes`, as on a disk that is full after so many.
fn with_little_space(folder: &Folder, kilobytes: usize, arguments: &[&str]) -> (i32, String) {
    // Blocks of 512 bytes in every POSIX shell but bash, where it is posix mode that makes them so. The signal that
    // comes with the limit would end the process: a full disk sends none.
    let script = format!("trap '' XFSZ; ulimit -f {} && exec \"$@\"", 2 * kilobytes);
    let run = Command::new("sh")
        .current_dir(folder.path())
        .env("LC_ALL", "C")
        .args(["-c", &script, "sh", env!("CARGO_BIN_EXE_innovant")])
        .args(arguments)
        .output()
        .unwrap();
    (
        run.status.code().expect("ended by a signal"),
        String::from_utf8(run.stderr).unwrap(),
    )
}

#[test]
fn a_full_disk_leaves_what_was_there_and_says_so() {
    let folder = Folder::new();
    folder.recording("log.csv", &systems::van_wingerden_one(), 1000, 1);
    folder
        .run(&["identify", "log.csv", "--output", "model.json"])
        .ok();
    let case = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/concealed/case_006");
    let file = |name: &str| case.join(name).display().to_string();
    let (recording, simulation) = (file("recording.csv"), file("simulation.csv"));
    let explain = [
        "explain",
        &recording,
        "--simulation",
        &simulation,
        "--output",
        "old",
    ];
    for arguments in [
        &["identify", "log.csv", "--output", "old"][..],
        &["identify", "log.csv", "--report", "old"],
        &["simulate", "model.json", "log.csv", "--output", "old"],
        &explain,
    ] {
        folder.text("old", OLD);
        let (code, stderr) = with_little_space(&folder, 4, arguments);
        assert_eq!(code, 2, "{arguments:?}: {stderr}");
        assert!(
            stderr.starts_with("error: old: cannot write: File too large")
                && stderr.contains("check permissions and free space")
                && stderr.trim_end().lines().count() == 1,
            "{arguments:?}: {stderr}"
        );
        assert_eq!(fs::read_to_string(folder.join("old")).unwrap(), OLD);
        assert_eq!(parts(folder.path()), Vec::<PathBuf>::new());
    }
    if Path::new("/dev/full").exists() {
        let message = folder
            .run(&["identify", "log.csv", "-q", "--output", "/dev/full"])
            .error();
        assert!(
            message.starts_with("/dev/full: cannot write: No space left on device"),
            "{message}"
        );
    }
}

#[test]
fn a_full_disk_does_not_cost_a_batch_its_models() {
    let folder = Folder::new();
    let system = systems::van_wingerden_one();
    folder.recording("log.csv", &system, 1000, 1);
    let batch = ["batch", "log.csv", "--output-dir", "models", "--order", "4"];
    folder.run(&batch).ok();
    let before = models(&folder);
    let rows = summary(&folder);
    // Another request, for which there is no space: the summary cannot be written either.
    let (code, stderr) = with_little_space(&folder, 4, &[&batch[..4], &["--order", "3"]].concat());
    assert!(
        stderr.contains("error: log.csv: models/log.json: cannot write"),
        "{stderr}"
    );
    assert_eq!(code, 1, "{stderr}");
    assert!(models(&folder) == before, "the model of before is gone");
    assert_eq!(parts(&folder.join("models")), Vec::<PathBuf>::new());
    assert_eq!(summary(&folder)[0].0, rows[0].0);
    assert_eq!(summary(&folder)[0].1, "failed");
}

#[test]
fn logs_and_folders_that_vanish_stop_only_what_needs_them() {
    let folder = Folder::new();
    let system = systems::van_wingerden_one();
    for (i, name) in ["a.csv", "b.csv", "c.csv"].iter().enumerate() {
        folder.recording(name, &system, 1000, i as u64);
    }
    let batch = [
        "batch",
        "a.csv",
        "b.csv",
        "c.csv",
        "--output-dir",
        "models",
        "--threads",
        "1",
    ];
    folder.run(&batch).ok();
    let before = models(&folder);
    // A log that is away for a while keeps its model; one that is cut loses it, for it is another log now.
    fs::remove_file(folder.join("a.csv")).unwrap();
    let text = fs::read_to_string(folder.join("b.csv")).unwrap();
    folder.text("b.csv", &text[..text.len() / 2]);
    let run = folder.run(&batch);
    assert_eq!(run.code, 1, "{run:?}");
    for expected in [
        "error: a.csv: cannot open: No such file or directory (os error 2); check the path",
        "error: b.csv, line ",
        "the file ends in the middle of this line: delete it",
    ] {
        assert!(run.stderr.contains(expected), "{}", run.stderr);
    }
    let after = models(&folder);
    assert_eq!(after.keys().collect::<Vec<_>>(), ["a.json", "c.json"]);
    assert!(after["a.json"] == before["a.json"] && after["c.json"] == before["c.json"]);

    // The folder of the models goes away while the batch works.
    let mut random = ChaCha8Rng::seed_from_u64(8);
    let many: Vec<String> = (0..30).map(|i| format!("many{i}.csv")).collect();
    for name in &many {
        folder.recording(name, &system, 1000 + random.random_range(0..100), 1);
    }
    let mut arguments = vec!["batch", "--output-dir", "gone", "--threads", "1"];
    arguments.extend(many.iter().map(String::as_str));
    let mut command = innovant(&folder, &arguments);
    let child = command.stderr(Stdio::piped()).spawn().unwrap();
    while !folder.join("gone/many0.json").exists() {}
    // New models may come while the old ones are deleted.
    while fs::remove_dir_all(folder.join("gone")).is_err() {}
    let run = child.wait_with_output().unwrap();
    let stderr = String::from_utf8(run.stderr).unwrap();
    assert_eq!(run.status.code(), Some(2), "{stderr}");
    assert!(
        stderr.contains("error: gone/summary.csv: cannot write: No such file or directory"),
        "{stderr}"
    );
}

#[test]
fn an_input_that_changes_is_told_from_one_that_does_not() {
    let folder = Folder::new();
    let system = systems::van_wingerden_one();
    folder.recording("log.csv", &system, 20_000, 1);
    let whole = folder.run(&["identify", "log.csv", "--output", "-"]).json();

    // A logger goes on writing: the recording is the whole lines that were there when it was opened.
    let text = fs::read(folder.join("log.csv")).unwrap();
    let lines: Vec<&[u8]> = text.split_inclusive(|byte| *byte == b'\n').collect();
    folder.bytes("grows.csv", &lines[..15_001].concat());
    let mut growing = fs::OpenOptions::new()
        .append(true)
        .open(folder.join("grows.csv"))
        .unwrap();
    let mut command = innovant(&folder, &["identify", "grows.csv", "--output", "-"]);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let child = command.spawn().unwrap();
    for line in &lines[15_001..] {
        growing.write_all(line).unwrap();
    }
    let run = child.wait_with_output().unwrap();
    let stderr = String::from_utf8_lossy(&run.stderr);
    assert!(run.status.success(), "{stderr}");
    let model: serde_json::Value = serde_json::from_slice(&run.stdout).unwrap();
    let samples = model["samples"].as_u64().unwrap();
    assert!(
        (15_000..=whole["samples"].as_u64().unwrap()).contains(&samples),
        "{samples}"
    );

    // A pipe whose writer dies in the middle of a line.
    let fifo = folder.join("pipe.csv");
    assert!(
        Command::new("mkfifo")
            .arg(&fifo)
            .status()
            .unwrap()
            .success()
    );
    let mut command = innovant(&folder, &["identify", "pipe.csv", "--output", "model.json"]);
    let child = command.stderr(Stdio::piped()).spawn().unwrap();
    let mut writer = fs::OpenOptions::new().write(true).open(&fifo).unwrap();
    writer.write_all(&text[..text.len() / 2 - 3]).unwrap();
    drop(writer);
    let run = child.wait_with_output().unwrap();
    let stderr = String::from_utf8(run.stderr).unwrap();
    // The cut is within a number of the last column or before it; only the latter can be seen.
    if run.status.code() == Some(2) {
        assert!(
            stderr.contains("the file ends in the middle of this line"),
            "{stderr}"
        );
        assert!(!folder.join("model.json").exists());
    } else {
        assert!(json(&folder.join("model.json"))["samples"].as_u64() < Some(20_000));
    }
}

#[test]
fn what_may_not_be_read_or_written_is_said() {
    use std::os::unix::fs::PermissionsExt;
    let folder = Folder::new();
    folder.recording("log.csv", &systems::van_wingerden_one(), 500, 1);
    let mode = |name: &str, mode: u32| {
        fs::set_permissions(folder.join(name), fs::Permissions::from_mode(mode)).unwrap();
    };
    mode(".", 0o755);
    fs::create_dir(folder.join("closed")).unwrap();
    mode("closed", 0o555);
    fs::copy(folder.join("log.csv"), folder.join("secret.csv")).unwrap();
    mode("secret.csv", 0o000);
    let root = Command::new("id").arg("-u").output().unwrap().stdout == b"0\n";
    for (arguments, expected) in [
        (
            &["identify", "secret.csv", "-q"][..],
            "error: secret.csv: cannot open: Permission denied (os error 13); check the path and its permissions",
        ),
        (
            &["identify", "log.csv", "-q", "--output", "closed/model.json"],
            "error: closed/model.json: cannot write: Permission denied",
        ),
    ] {
        let mut command = innovant(&folder, arguments);
        if root {
            // Root may do everything, nobody may not.
            command.uid(65_534);
        }
        // A build in a folder that only root may enter cannot be started by nobody.
        let Ok(child) = command.stderr(Stdio::piped()).spawn() else {
            assert!(root);
            continue;
        };
        let run = child.wait_with_output().unwrap();
        let stderr = String::from_utf8(run.stderr).unwrap();
        assert_eq!(run.status.code(), Some(2), "{stderr}");
        assert!(stderr.starts_with(expected), "{stderr}");
        assert_eq!(stderr.trim_end().lines().count(), 1, "{stderr}");
    }
    mode("closed", 0o755);
}
