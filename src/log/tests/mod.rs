//! Tests of the module as a whole; each file one idea.

mod error_tests;
mod reading_tests;
mod sampling_tests;
mod writing_tests;

use std::io::{self, Cursor, Read, Write};

use super::{Log, LogError, Roles};

/// Reads text with the default roles.
fn read(csv: &str) -> Result<Log, LogError> {
    read_as(csv, &Roles::default())
}

fn read_as(csv: &str, roles: &Roles) -> Result<Log, LogError> {
    Log::from_reader("run.csv", Cursor::new(csv.as_bytes().to_vec()), roles)
}

/// Roles by name; an empty list leaves them to the headers.
fn roles(inputs: &str, outputs: &str) -> Roles {
    let names =
        |list: &str| (!list.is_empty()).then(|| list.split(',').map(str::to_owned).collect());
    Roles {
        inputs: names(inputs),
        outputs: names(outputs),
        ..Roles::default()
    }
}

/// Asserts that `result` failed with a message that has all of `parts`.
#[track_caller]
fn fails<T: std::fmt::Debug>(result: Result<T, LogError>, parts: &[&str]) {
    let message = result.expect_err("this should fail").to_string();
    for part in parts {
        assert!(message.contains(part), "no `{part}` in: {message}");
    }
}

/// Gives 1, 2, ... 7 bytes a read, round and round.
struct Drip {
    bytes: Cursor<Vec<u8>>,
    size: usize,
}

impl Drip {
    fn new(bytes: &[u8]) -> Self {
        Self {
            bytes: Cursor::new(bytes.to_vec()),
            size: 0,
        }
    }
}

impl Read for Drip {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.size = self.size % 7 + 1;
        let room = self.size.min(buffer.len());
        self.bytes.read(&mut buffer[..room])
    }
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// A long recording, `rows` rows at 100 Hz.
fn long_csv(rows: usize) -> String {
    let mut csv = "t,u [V],comment,y [rad]\n".to_owned();
    for k in 0..rows {
        let (u, y) = ((k as f64 * 0.37).sin(), (k as f64 * 0.11).cos() * 1e-3);
        csv.push_str(&format!("{},{u:.6},row {k},{y}\n", k as f64 * 0.01));
    }
    csv
}
