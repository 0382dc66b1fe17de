//! The command line run from tests.

use assert_cmd::Command;
use serde_json::Value;

/// Runs `innovant` with these arguments, which must succeed, and reads the JSON that it prints.
pub fn run(arguments: &[&str]) -> Value {
    let output = Command::cargo_bin("innovant")
        .unwrap()
        .args(arguments)
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    serde_json::from_slice(&output.stdout).unwrap()
}
