//! One recording written in the ways of many loggers gives one model, and what was recognised is said.

use std::fmt::Write;

use innovant::internal::systems;
use serde_json::Value;

use crate::folder::{Folder, json};

/// Samples of the recording.
const SAMPLES: usize = 1200;
/// Sample time in seconds, so that whole seconds have several samples.
const STEP: f64 = 0.25;

struct Rows(Vec<(f64, f64, f64)>);

impl Rows {
    fn new() -> Self {
        let log = systems::servo().record(SAMPLES, 3);
        let row = |k: usize| (k as f64 * STEP, log.input_data[0][k], log.output_data[0][k]);
        Self((0..SAMPLES).map(row).collect())
    }

    /// Each row by `write`, after `header`.
    fn text(&self, header: &str, write: impl Fn(usize, f64, f64, f64) -> String) -> String {
        let mut text = format!("{header}\n");
        for (k, (t, u, y)) in self.0.iter().enumerate() {
            let row = write(k, *t, *u, *y);
            if !row.is_empty() {
                writeln!(text, "{row}").unwrap();
            }
        }
        text
    }
}

fn comma(value: f64) -> String {
    value.to_string().replace('.', ",")
}

/// Hours, minutes and seconds from ten o'clock.
fn clock(t: f64) -> String {
    let (minutes, seconds) = ((t / 60.0).floor(), t % 60.0);
    format!("10:{minutes:02}:{seconds:06.3}")
}

const ROLES: [&str; 4] = ["--inputs", "Motor Voltage (V)", "--outputs", "speed"];

/// The model of a file, and what was said of it.
fn model(bytes: &[u8], flags: &[&str]) -> (Value, String) {
    let folder = Folder::new();
    folder.bytes("log.csv", bytes);
    let mut arguments = vec![
        "identify",
        "log.csv",
        "--output",
        "model.json",
        "--order",
        "2",
        "--past",
        "10",
    ];
    arguments.extend(ROLES);
    arguments.extend(flags);
    let run = folder.run(&arguments);
    let said = run.stderr.clone();
    run.ok();
    (json(&folder.join("model.json")), said)
}

/// Largest difference of the entries of A, relative to the largest entry.
fn apart(a: &Value, b: &Value) -> f64 {
    let poles = |model: &Value| -> Vec<f64> {
        let rows = model["A"].as_array().unwrap();
        let entry = |i: usize, j: usize| rows[i][j].as_f64().unwrap();
        vec![
            entry(0, 0) + entry(1, 1),
            entry(0, 0) * entry(1, 1) - entry(0, 1) * entry(1, 0),
        ]
    };
    let (a, b) = (poles(a), poles(b));
    a.iter()
        .zip(&b)
        .map(|(x, y)| (x - y).abs())
        .fold(0.0, f64::max)
}

#[test]
fn every_way_of_writing_gives_the_same_model() {
    let rows = Rows::new();
    let plain = rows.text("Time [s],Motor Voltage (V),speed (rpm)", |_, t, u, y| {
        format!("{t},{u},{y}")
    });
    let (clean, said) = model(plain.as_bytes(), &[]);
    assert!(
        !said.contains("log.csv:"),
        "nothing is said of a plain file: {said}"
    );
    assert_eq!(clean["inputs"][0]["unit"], "V");
    let semicolons = rows.text("Zeit;Motor Voltage (V);speed", |_, t, u, y| {
        format!(
            "23.11.2026 {};{};{}",
            clock(t).replace('.', ","),
            comma(u),
            comma(y)
        )
    });
    let iso = rows.text("Timestamp,Motor Voltage (V),speed", |_, t, u, y| {
        format!("2026-11-23T{}Z,{u},{y}", clock(t))
    });
    let whole_seconds = rows.text("Time,Motor Voltage,speed", |_, t, u, y| {
        format!("2026-11-23 {},{u},{y}", &clock(t)[..8])
    });
    let american = rows.text("Time,Motor Voltage,speed", |_, t, u, y| {
        format!("11/23/2026 {} AM,{u},{y}", clock(t))
    });
    let nanoseconds = rows.text("Time,Motor Voltage,speed", |_, t, u, y| {
        format!(
            "{},{u},{y}",
            1_764_237_600_000_000_000_i64 + (t * 1e9) as i64
        )
    });
    let named = rows.text("time_ms,Motor Voltage,speed", |_, t, u, y| {
        format!("{},{u},{y}", t * 1e3)
    });
    let units = rows.text("Time;Motor Voltage;speed\n[s];[V];[rpm]", |_, t, u, y| {
        format!("{};{};{}", comma(t), comma(u), comma(y))
    });
    let preamble = format!("Logger;7\nSerial;20417\n\n{units}End of data\n");
    let twice = rows.text("Time,Motor Voltage,speed", |k, t, u, y| {
        let row = format!("{t},{u},{y}");
        if k % 100 == 7 {
            format!("{row}\n{row}")
        } else {
            row
        }
    });
    let stamps = rows.text("Time,Motor Voltage,speed", |k, t, u, y| {
        format!("{},{u},{y}", if k % 100 == 7 { t - STEP } else { t })
    });
    let jitter = rows.text("Time,Motor Voltage,speed", |k, t, u, y| {
        format!(
            "{:.6},{u},{y}",
            t + 0.2 * STEP * ((k * 7919 % 1000) as f64 / 500.0 - 1.0)
        )
    });
    let quoted = rows.text("\"Time\",\"Motor Voltage\",\"speed\"", |_, t, u, y| {
        format!("\"{}\",\"{}\",\"{}\"", comma(t), comma(u), comma(y))
    });
    let utf_16 = |text: &str| -> Vec<u8> {
        format!("\u{feff}{text}")
            .encode_utf16()
            .flat_map(u16::to_le_bytes)
            .collect()
    };
    let degree: Vec<u8> = plain
        .replace("speed (rpm)", "speed [\u{b0}C]")
        .chars()
        .map(|c| c as u8)
        .collect();
    for (what, bytes, flags, words) in [
        (
            "semicolons",
            semicolons.into_bytes(),
            ["--time", "Zeit"],
            "decimal commas",
        ),
        (
            "iso",
            iso.into_bytes(),
            ["--time", "Timestamp"],
            "time zero is 2026-11-23 10:00:00 UTC",
        ),
        (
            "whole seconds",
            whole_seconds.into_bytes(),
            ["--time", "Time"],
            "each shared by 4 rows",
        ),
        (
            "american",
            american.into_bytes(),
            ["--time", "Time"],
            "month/day/year",
        ),
        (
            "nanoseconds",
            nanoseconds.into_bytes(),
            ["--time", "Time"],
            "nanoseconds by their size",
        ),
        (
            "milliseconds",
            named.into_bytes(),
            ["--time", "time_ms"],
            "in ms",
        ),
        (
            "preamble",
            preamble.into_bytes(),
            ["--time", "Time"],
            "units in line 5",
        ),
        (
            "rows twice",
            twice.into_bytes(),
            ["--time", "Time"],
            "12 rows written twice",
        ),
        (
            "stamps twice",
            stamps.into_bytes(),
            ["--time", "Time"],
            "12 time stamps repaired",
        ),
        (
            "jitter",
            jitter.into_bytes(),
            ["--time", "Time"],
            "% of a sample",
        ),
        (
            "bars",
            plain.replace(',', "|").into_bytes(),
            ["--time", "Time"],
            "vertical bars",
        ),
        (
            "quoted",
            quoted.into_bytes(),
            ["--time", "Time"],
            "decimal commas",
        ),
        ("UTF-16", utf_16(&plain), ["--time", "Time"], "UTF-16"),
        ("Windows", degree, ["--time", "Time [s]"], "Windows-1252"),
        (
            "line ends",
            plain.replace('\n', "\r").into_bytes(),
            ["--time", "Time"],
            "",
        ),
        (
            "separators",
            plain.replace('\n', ",\n").into_bytes(),
            ["--time", "Time"],
            "",
        ),
        (
            "unit",
            plain.replace("[s]", "[ms]").into_bytes(),
            ["--time-unit", "s"],
            "",
        ),
    ] {
        let (found, said) = model(&bytes, &flags);
        assert!(said.contains(words), "{what}: {said}");
        let off = apart(&found, &clean);
        assert!(off < 1e-7, "{what}: {off}");
        let step = found["sample_time"].as_f64().unwrap();
        assert!((step / STEP - 1.0).abs() < 1e-4, "{what}: {step}");
    }
}

#[test]
fn missing_samples_are_bridged_split_or_refused() {
    let rows = Rows::new();
    let header = "Time,Motor Voltage,speed";
    let cells = rows.text(header, |k, t, u, y| {
        if k % 150 == 20 {
            format!("{t},{u},NaN")
        } else {
            format!("{t},{u},{y}")
        }
    });
    let (found, said) = model(cells.as_bytes(), &[]);
    assert!(
        said.contains("8 missing values of `speed` interpolated"),
        "{said}"
    );
    assert_eq!(
        found["provenance"]["recordings"].as_array().unwrap().len(),
        1
    );
    let gap = rows.text(header, |k, t, u, y| {
        if (500..540).contains(&k) {
            String::new()
        } else {
            format!("{t},{u},{y}")
        }
    });
    let (found, said) = model(gap.as_bytes(), &[]);
    assert!(
        said.contains("into 2 recordings: 500 samples from 0 s, 660 samples from 135 s"),
        "{said}"
    );
    assert_eq!(
        found["provenance"]["recordings"].as_array().unwrap().len(),
        2
    );
    let (found, _) = model(gap.as_bytes(), &["--missing", "interpolate"]);
    assert_eq!(
        found["provenance"]["recordings"].as_array().unwrap().len(),
        1
    );
    let folder = Folder::new();
    folder.text("log.csv", &gap);
    let mut arguments = vec!["identify", "log.csv", "--missing", "error"];
    arguments.extend(ROLES);
    let message = folder.run(&arguments).error();
    assert!(message.contains("a gap of 10.25 s"), "{message}");
    let mut arguments = vec!["identify", "log.csv", "--dt", "0.1"];
    arguments.extend(ROLES);
    let message = folder.run(&arguments).error();
    assert!(
        message.contains("0.25 s") && message.contains("--dt says 0.1 s"),
        "{message}"
    );
}

#[test]
fn another_rate_is_anti_aliased() {
    let rows = Rows::new();
    let text = rows.text("Time,Motor Voltage,speed", |_, t, u, y| {
        format!("{t},{u},{y}")
    });
    let (found, said) = model(text.as_bytes(), &["--resample", "0.5"]);
    assert!(said.contains("low-pass filtered"), "{said}");
    assert_eq!(found["sample_time"], 0.5);
}

#[test]
fn a_simulation_is_compared_by_time() {
    let log = systems::servo().record(1500, 5);
    let quiet = &log.input_data[0];
    let mut y = 0.0;
    let simulated: Vec<f64> = quiet
        .iter()
        .map(|u| {
            let now = y;
            y = 0.8 * y + 0.2 * u;
            now
        })
        .collect();
    let mut recording = "Time [s],u,speed (rpm)\n".to_owned();
    let mut simulation = "t,speed\n".to_owned();
    for (k, (u, y)) in quiet.iter().zip(&simulated).enumerate() {
        let noise = 0.02 * ((k * 7919 % 1000) as f64 / 500.0 - 1.0);
        if !(700..720).contains(&k) {
            writeln!(recording, "{},{u},{}", 100.0 + k as f64 * 0.1, y + noise).unwrap();
        }
        writeln!(simulation, "{},{y}", 100.0 + k as f64 * 0.1).unwrap();
    }
    let folder = Folder::new();
    folder.text("recording.csv", &recording);
    folder.text("simulation.csv", &simulation);
    let explain = |simulation: &str, more: &[&str]| {
        let mut all = vec![
            "explain",
            "recording.csv",
            "--simulation",
            simulation,
            "--inputs",
            "u",
            "--outputs",
            "speed",
        ];
        all.extend(["--output", "e.json"]);
        all.extend(more);
        folder.run(&all)
    };
    let run = explain("simulation.csv", &[]);
    assert!(run.stderr.contains("into 2 recordings"), "{}", run.stderr);
    run.ok();
    let parts = &json(&folder.join("e.json"))["recordings"];
    assert_eq!(parts.as_array().unwrap().len(), 2);
    folder.text("other.csv", &simulation.replace("t,speed", "t,y9"));
    let message = explain("other.csv", &["--quiet"]).error();
    assert!(
        message.contains("`speed [rpm]`") && message.contains("`y9`") && message.contains("--map"),
        "{message}"
    );
    explain("other.csv", &["--map", "y9=speed"]).ok();
    folder.text("later.csv", "t,speed\n0,1\n0.1,2\n0.2,1\n");
    let message = explain("later.csv", &["--quiet"]).error();
    assert!(message.contains("does not overlap"), "{message}");
}
