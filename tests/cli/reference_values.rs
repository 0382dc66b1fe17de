//! The command line against the reference values of the derivation (numpy, 1 BLAS thread): Example I of van
//! Wingerden, repaired, `default_rng(1)`, N = 2000, p = f = 10, n = 4, all columns, degrees of freedom in
//! the innovation covariance, corrected sign. The CSV holds the very samples, in shortest round-trip form.

use assert_cmd::Command;
use serde_json::Value;

use crate::command::run;

const TOLERANCE: f64 = 1e-6;

fn close(found: f64, expected: f64, what: &str) {
    let error = (found - expected).abs() / expected.abs().max(1.0);
    assert!(error < TOLERANCE, "{what}: {found} instead of {expected}");
}

/// Reference values are printed with five digits where no more are given.
fn close_to_digits(found: f64, expected: f64, digits: i32, what: &str) {
    let error = (found / expected - 1.0).abs();
    assert!(
        error < 10_f64.powi(1 - digits),
        "{what}: {found} instead of {expected}"
    );
}

#[test]
fn command_line_reproduces_the_reference_values() {
    let folder = tempfile::tempdir().unwrap();
    let model_path = folder.path().join("model.json");
    let model_path = model_path.to_str().unwrap();
    let csv = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/tests/data/pbsid_reference.csv"
    );
    Command::cargo_bin("innovant")
        .unwrap()
        .args([
            "identify", csv, "--order", "4", "--past", "10", "--future", "10",
        ])
        .args([
            "--polish",
            "never",
            "--detrend",
            "none",
            "--output",
            model_path,
        ])
        .assert()
        .success();
    let model: Value = serde_json::from_slice(&std::fs::read(model_path).unwrap()).unwrap();

    let singular_values = &model["diagnostics"]["singular_values"];
    let expected = [285.74318, 253.10865, 78.97419, 65.53437, 6.97043];
    for (i, value) in expected.iter().enumerate() {
        close_to_digits(
            singular_values[i].as_f64().unwrap(),
            *value,
            6,
            "singular value",
        );
    }
    let covariance = &model["innovation_covariance"];
    close(covariance[0][0].as_f64().unwrap(), 0.99626403, "Lambda");
    close(covariance[0][1].as_f64().unwrap(), -0.0074164, "Lambda");
    close(covariance[1][1].as_f64().unwrap(), 0.97025618, "Lambda");

    let shown = run(&["show", model_path, "--format", "json", "--at", "0.7"]);
    for (real, imag, square) in [
        (0.6695081, 0.66811691, 1.3332e-4),
        (-0.65352043, 0.6771223, 1.534e-4),
    ] {
        let pole = shown["poles"]
            .as_array()
            .unwrap()
            .iter()
            .find(|p| {
                (p["real"].as_f64().unwrap() - real).abs() < 0.1
                    && p["imag"].as_f64().unwrap() > 0.0
            })
            .unwrap();
        close(pole["real"].as_f64().unwrap(), real, "pole");
        close(pole["imag"].as_f64().unwrap(), imag, "pole");
        let covariance = &pole["covariance"];
        let trace = covariance[0][0].as_f64().unwrap() + covariance[1][1].as_f64().unwrap();
        close_to_digits(trace, square, 4, "E|dlambda|^2");
    }
    let expected = [
        ("y1", "u1", -1.02191339, -0.99177021, 0.23434521),
        ("y1", "u2", -3.78281132, 0.83877442, 0.57900261),
        ("y2", "u1", -5.0055483, -0.621738, 0.66068454),
        ("y2", "u2", -9.9512098, 8.124162, 1.63314771),
    ];
    for (output, input, real, imag, deviation) in expected {
        let point = shown["frequency_response"]
            .as_array()
            .unwrap()
            .iter()
            .find(|p| p["output"] == output && p["input"] == input)
            .unwrap();
        close(point["real"].as_f64().unwrap(), real, "G");
        close(point["imag"].as_f64().unwrap(), imag, "G");
        let covariance = &point["covariance"];
        let trace = covariance[0][0].as_f64().unwrap() + covariance[1][1].as_f64().unwrap();
        close(trace.sqrt(), deviation, "sqrt(E|dG|^2)");
    }
}
