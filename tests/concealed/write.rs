//! Cases as files, in the layout of the shared sets.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::Path;

use super::case::{Case, Simulation};
use super::numbers::text_of;

impl Case {
    /// Writes `case_NNN/` with what the program may see, and `truth/case_NNN.json` and `_fresh.csv`.
    pub fn write(&self, folder: &Path, number: usize) -> io::Result<()> {
        let name = format!("case_{number:03}");
        let seen = folder.join(&name);
        let hidden = folder.join("truth");
        fs::create_dir_all(&seen)?;
        fs::create_dir_all(&hidden)?;
        let (time, digits) = (&self.recording.time, self.digits);
        let (u, y) = (&self.recording.inputs, &self.recording.outputs);
        let table = |path: &Path, parts: &[(&str, &[Vec<f64>], &str)]| {
            write_table(path, time, parts, digits)
        };
        table(&seen.join("recording.csv"), &[("u", u, ""), ("y", y, "")])?;
        match &self.simulation {
            Simulation::Model(model) => {
                fs::write(seen.join("simulation.json"), serde_json::to_vec(model)?)?;
            }
            Simulation::Column(columns) => {
                table(&seen.join("simulation.csv"), &[("y", columns, "")])?;
            }
        }
        table(
            &seen.join("fresh_input.csv"),
            &[("u", &self.fresh_input, "")],
        )?;
        if let Some(columns) = &self.fresh_simulation {
            table(&seen.join("fresh_simulation.csv"), &[("y", columns, "")])?;
        }
        let mut truth = self.truth.clone();
        truth.case = number;
        fs::write(
            hidden.join(format!("{name}.json")),
            serde_json::to_vec(&truth)?,
        )?;
        table(
            &hidden.join(format!("{name}_fresh.csv")),
            &[
                ("y", &self.fresh_truth, ""),
                ("y", &self.fresh_ideal, "_sim"),
            ],
        )
    }
}

/// Columns with time; the rows are those of the shortest column.
fn write_table(
    path: &Path,
    time: &[f64],
    parts: &[(&str, &[Vec<f64>], &str)],
    digits: usize,
) -> io::Result<()> {
    const TIME_DIGITS: usize = 12;
    let mut out = BufWriter::new(File::create(path)?);
    write!(out, "t")?;
    for (letter, columns, tail) in parts {
        for i in 1..=columns.len() {
            write!(out, ",{letter}{i}{tail}")?;
        }
    }
    writeln!(out)?;
    let columns: Vec<&Vec<f64>> = parts.iter().flat_map(|(_, columns, _)| *columns).collect();
    let rows = columns.iter().map(|c| c.len()).min().unwrap_or(0);
    for (k, t) in time.iter().enumerate().take(rows) {
        write!(out, "{}", text_of(*t, TIME_DIGITS))?;
        for column in &columns {
            write!(out, ",{}", text_of(column[k], digits))?;
        }
        writeln!(out)?;
    }
    out.flush()
}
