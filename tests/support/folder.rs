//! What the tests of the command line share.

// Not every test file uses all of it.
#![allow(dead_code)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use assert_cmd::Command;
use innovant::internal::systems::TestSystem;
use innovant::log::Log;
use serde_json::Value;
use tempfile::TempDir;

/// A folder for one test, gone at its end.
pub struct Folder(TempDir);

impl Folder {
    pub fn new() -> Self {
        Self(TempDir::new().unwrap())
    }

    pub fn path(&self) -> &Path {
        self.0.path()
    }

    pub fn join(&self, name: &str) -> PathBuf {
        self.path().join(name)
    }

    /// Writes a text file.
    pub fn text(&self, name: &str, text: &str) -> PathBuf {
        self.bytes(name, text.as_bytes())
    }

    pub fn bytes(&self, name: &str, bytes: &[u8]) -> PathBuf {
        fs::write(self.join(name), bytes).unwrap();
        self.join(name)
    }

    /// Writes a recording of a test system.
    pub fn recording(&self, name: &str, system: &TestSystem, samples: usize, seed: u64) -> PathBuf {
        self.log(name, &system.record(samples, seed))
    }

    pub fn log(&self, name: &str, log: &Log) -> PathBuf {
        log.write_csv(&self.join(name)).unwrap();
        self.join(name)
    }

    /// Names of the files that are there, sorted.
    pub fn files(&self) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(self.path())
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    /// Explains the recording `log` against the plant in equations `plant`; gives the document, which is `e.json`.
    pub fn explained(&self, log: &str, plant: &str, more: &[&str]) -> Value {
        let explain = ["explain", log, "--simulation", plant, "--output", "e.json"];
        self.run(&[&explain[..], more].concat()).ok();
        json(&self.join("e.json"))
    }

    /// Runs `innovant` in this folder.
    pub fn run(&self, arguments: &[&str]) -> Run {
        self.run_with_input(arguments, Vec::new())
    }

    /// Runs `innovant` in this folder with bytes on standard input.
    pub fn run_with_input(&self, arguments: &[&str], input: Vec<u8>) -> Run {
        let mut command = Command::cargo_bin("innovant").unwrap();
        command
            .current_dir(self.path())
            .env("LC_ALL", "C")
            .args(arguments)
            .write_stdin(input);
        Run::new(command.output().unwrap())
    }
}

/// What a run of the command line left.
#[derive(Debug)]
pub struct Run {
    pub code: i32,
    pub stdout: String,
    pub stderr: String,
}

impl Run {
    fn new(output: Output) -> Self {
        let run = Self {
            code: output.status.code().expect("ended by a signal"),
            stdout: String::from_utf8(output.stdout).unwrap(),
            stderr: String::from_utf8(output.stderr).unwrap(),
        };
        assert!(!run.stderr.contains("panicked"), "{}", run.stderr);
        run
    }

    /// The run ended well: what it printed.
    pub fn ok(self) -> String {
        assert_eq!(self.code, 0, "{}", self.stderr);
        self.stdout
    }

    /// The run ended in an error, told in exactly one message: that message.
    pub fn error(self) -> String {
        assert_eq!(self.code, 2, "{self:?}");
        assert_eq!(
            self.stdout, "",
            "an error prints nothing on standard output"
        );
        assert_eq!(self.stderr.matches("error: ").count(), 1, "{}", self.stderr);
        let message = self.stderr.strip_prefix("error: ").unwrap().trim_end();
        assert_eq!(message.lines().count(), 1, "{message}");
        message.to_owned()
    }

    /// The document that was printed.
    pub fn json(self) -> Value {
        serde_json::from_str(&self.ok()).unwrap()
    }
}

/// The document in a file.
pub fn json(path: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

/// Names of the effects of an explanation, in its order.
pub fn effects(explanation: &Value) -> Vec<&str> {
    explanation["effects"]
        .as_array()
        .unwrap()
        .iter()
        .map(|e| e["effect"].as_str().unwrap())
        .collect()
}

/// The columns of a CSV file with a header.
pub fn columns(text: &str) -> (Vec<String>, Vec<Vec<f64>>) {
    let mut lines = text.lines();
    let header: Vec<String> = lines
        .next()
        .unwrap()
        .split(',')
        .map(str::to_owned)
        .collect();
    let mut columns = vec![Vec::new(); header.len()];
    for line in lines {
        for (column, cell) in columns.iter_mut().zip(line.split(',')) {
            column.push(cell.parse().unwrap());
        }
    }
    (header, columns)
}
