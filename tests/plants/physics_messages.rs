//! What the command line says about plants: warnings, several errors, columns that are missing.

use std::path::{Path, PathBuf};
use std::process::Output;

const PENDULUM: &str = "data/plants/pendulum";

fn here(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn plant(name: &str) -> String {
    here(&format!("{PENDULUM}.{name}")).display().to_string()
}

fn innovant(arguments: &[&str]) -> Output {
    assert_cmd::Command::cargo_bin("innovant")
        .expect("the command is built")
        .args(arguments)
        .output()
        .expect("the command runs")
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A file that holds `text`, in a folder that is removed with it.
fn file(name: &str, text: &str) -> (tempfile::TempDir, String) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join(name);
    std::fs::write(&path, text).expect("the file is written");
    (folder, path.display().to_string())
}

#[test]
fn check_says_that_units_agree_and_lists_constants() {
    let output = innovant(&["check", &plant("mo")]);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success());
    assert!(text.contains("\nUnits agree\n"), "{text}");
    assert!(text.contains("  l        0.3   m"), "{text}");
    let (_folder, path) = file(
        "a.mo",
        "model A parameter Real k = 1; Real x(unit=\"radd\", min=-2); equation der(x) = -k*x; end A;",
    );
    let output = innovant(&["check", &path]);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success());
    let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(
        words.contains(
            "Units were not checked; 1 variable has no unit and fits everything: k; 1 variable has a unit that is not known and \
             fits everything: x"
        ),
        "{text}"
    );
    let warning = format!(
        "warning: {path}:1:36: the unit `radd` of `x` is not known and not compared; did you mean `rad`?\n"
    );
    assert_eq!(said(&output), warning);
    assert_eq!(said(&innovant(&["check", "-q", &path])), "");
}

#[test]
fn check_reports_several_errors() {
    let text =
        "model A\n  Real x(strat=1);\n  Real y\nequation\n  der(x) = -x;\n  y = 2**x;\nend A;\n";
    let (_folder, path) = file("a.mo", text);
    let output = innovant(&["check", &path]);
    assert_eq!(output.status.code(), Some(2));
    let said = said(&output);
    for part in [
        ":2:10: `strat`",
        ":3:8: a `;` is missing",
        ":6:9: a power",
        "\n3 errors\n",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
}

#[test]
fn a_value_outside_its_bounds_is_simulated_with_a_warning() {
    let (_folder, out) = file("out.csv", "");
    let output = innovant(&[
        "simulate",
        &plant("mo"),
        &plant("csv"),
        "--parameters",
        "J=5,d=0.03",
        "--output",
        &out,
    ]);
    assert!(output.status.success());
    assert_eq!(
        said(&output),
        "warning: --parameters: J = 5 is outside its bounds in the text, 0.001 to 0.03; it is used all the same\n"
    );
}

#[test]
fn a_column_that_is_missing_is_said_with_the_columns_and_the_flags() {
    let text = std::fs::read_to_string(plant("csv")).expect("the recording");
    let (_folder, path) = file("a.csv", &text.replacen(",y [", ",angle [", 1));
    for arguments in [
        vec!["identify", &path, "--structure", &plant("mo")],
        vec![
            "simulate",
            &plant("mo"),
            &path,
            "--initial-state",
            "estimate",
        ],
    ] {
        let output = innovant(&arguments);
        assert_eq!(output.status.code(), Some(2));
        assert_eq!(
            said(&output),
            format!(
                "error: {path}: no column `y`; the columns are `t [s]`, `u [V]`, `angle [rad]`; where the file has other \
                 names than the plant, list its columns with `--inputs` for u and with `--outputs` for y, in this order\n"
            )
        );
    }
}

#[test]
fn a_file_that_is_no_text_is_called_so() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("a.mo");
    std::fs::write(&path, [0xff, 0xfe, 0, 1]).expect("the file is written");
    let path = path.display().to_string();
    assert_eq!(
        said(&innovant(&["check", &path])),
        format!("error: {path}: this is no plant: the file is not text in UTF-8\n")
    );
}
