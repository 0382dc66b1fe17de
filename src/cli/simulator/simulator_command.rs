//! An external simulator as a program: files in, files out, a time limit.

use std::fs::File;
use std::io::{self, BufWriter, Read, Seek, SeekFrom};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use anyhow::Context;

use crate::log::Channel;
use crate::physics::Excitation;
use crate::physics::external::{ExternalSimulator, Failure};

/// What stands for the names of the files.
const INPUT: &str = "{input}";
const OUTPUT: &str = "{output}";
const PARAMETERS: &str = "{parameters}";
/// Lines of messages that are shown, and how far back they are looked for.
const MESSAGE_LINES: usize = 8;
const MESSAGE_BYTES: u64 = 4096;
/// How often a program is asked whether it has ended: often at first, for there are fast ones.
const FIRST_PAUSE: Duration = Duration::from_millis(1);
const LONGEST_PAUSE: Duration = Duration::from_millis(50);
/// Names of a time column in the output.
const TIME_NAMES: [&str; 3] = ["t", "time", "Time"];
/// Part of a sample by which times may differ: simulators add steps up.
const SAME_TIME: f64 = 0.01;

/// A command that reads inputs and parameters from files and writes its outputs to one.
#[derive(Debug)]
pub(super) struct SimulatorCommand {
    /// As given.
    pub(super) text: String,
    words: Vec<String>,
    inputs: Vec<String>,
    outputs: Vec<String>,
    time_limit: Duration,
}

impl SimulatorCommand {
    /// Splits a command into words as a POSIX shell does; no shell runs it, so nothing else of a shell works.
    pub(crate) fn new(
        text: &str,
        inputs: Vec<String>,
        outputs: Vec<String>,
        time_limit: Duration,
    ) -> anyhow::Result<Self> {
        let words = shlex::split(text)
            .filter(|w| !w.is_empty())
            .with_context(|| {
                format!("--simulator: `{text}` cannot be split into words: a quote is not closed")
            })?;
        for place in [INPUT, OUTPUT, PARAMETERS] {
            if !words.iter().any(|w| w.contains(place)) {
                anyhow::bail!(
                    "--simulator: the command holds no {place}; write it where the program takes that file, for example \
                     --simulator 'python3 simulator.py {INPUT} {OUTPUT} {PARAMETERS}'"
                );
            }
        }
        Ok(Self {
            text: text.to_owned(),
            words,
            inputs,
            outputs,
            time_limit,
        })
    }

    /// Writes the inputs: time `t`, then a column for each input.
    fn write_input(&self, path: &Path, excitation: &Excitation) -> io::Result<()> {
        let mut writer = csv::Writer::from_writer(BufWriter::new(File::create(path)?));
        let names = self.inputs.iter().map(String::as_str);
        writer.write_record(std::iter::once("t").chain(names))?;
        for k in 0..excitation.length {
            let values = excitation.inputs.iter().map(|c| c[k]);
            let row = std::iter::once(time(excitation, k)).chain(values);
            writer.write_record(row.map(|v| v.to_string()))?;
        }
        writer.flush()
    }

    /// Runs the program on files in `folder`.
    fn run(&self, folder: &Path) -> Result<(), Failure> {
        let file = |name: &str| folder.join(name).display().to_string();
        let mut words = self.words.iter().map(|word| {
            word.replace(INPUT, &file("input.csv"))
                .replace(OUTPUT, &file("output.csv"))
                .replace(PARAMETERS, &file("parameters.json"))
        });
        let program = words.next().unwrap_or_default();
        let (out, err) = (folder.join("stdout"), folder.join("stderr"));
        let started = File::create(&out).and_then(|o| Ok((o, File::create(&err)?)));
        let (o, e) = started.map_err(files)?;
        // Files, not pipes: a program that writes much never waits for a reader.
        let child = Command::new(&program)
            .args(words)
            .stdin(Stdio::null())
            .stdout(o)
            .stderr(e)
            .spawn()
            .map_err(|error| Failure::NotStarted {
                program,
                reason: error.to_string(),
            })?;
        let status = wait(child, self.time_limit).map_err(files)?;
        let messages = || {
            let said = last_lines(&err);
            if said.is_empty() {
                last_lines(&out)
            } else {
                said
            }
        };
        match status {
            None => Err(Failure::TimedOut {
                seconds: self.time_limit.as_secs_f64(),
                messages: messages(),
            }),
            Some(status) if !status.success() => Err(Failure::Exit {
                status: status.to_string(),
                messages: messages(),
            }),
            Some(_) if !folder.join("output.csv").exists() => Err(Failure::NoOutput {
                messages: messages(),
            }),
            Some(_) => Ok(()),
        }
    }

    /// Reads the outputs by their names.
    fn read_output(&self, path: &Path, excitation: &Excitation) -> Result<Vec<Vec<f64>>, Failure> {
        let unreadable = |error: csv::Error| Failure::Unreadable {
            reason: error.to_string(),
        };
        let mut reader = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .from_path(path)
            .map_err(unreadable)?;
        let header: Vec<String> = reader
            .headers()
            .map_err(unreadable)?
            .iter()
            .map(|h| Channel::parse(h.trim_start_matches('\u{feff}')).name)
            .collect();
        let places: Vec<usize> = self
            .outputs
            .iter()
            .map(|name| {
                let place = header.iter().position(|h| h == name);
                place.ok_or_else(|| Failure::MissingColumn {
                    output: name.clone(),
                    found: header.iter().filter(|h| !h.is_empty()).cloned().collect(),
                })
            })
            .collect::<Result<_, _>>()?;
        let clock = TIME_NAMES
            .iter()
            .filter(|name| !self.outputs.iter().any(|o| o == *name))
            .find_map(|name| header.iter().position(|h| h == name));
        let mut columns = vec![Vec::with_capacity(excitation.length); places.len()];
        for (k, row) in reader.records().enumerate() {
            let row = row.map_err(unreadable)?;
            if k >= excitation.length {
                continue;
            }
            let expected = time(excitation, k);
            let at = |place: usize| row.get(place).unwrap_or_default();
            for ((column, &place), name) in columns.iter_mut().zip(&places).zip(&self.outputs) {
                let value = at(place).parse().map_err(|_| Failure::NotANumber {
                    output: name.clone(),
                    row: k + 1,
                    time: expected,
                    text: match at(place) {
                        "" => "empty".to_owned(),
                        text => format!("`{text}`"),
                    },
                })?;
                column.push(value);
            }
            // A time that cannot be read is not compared: it may be a date.
            if let Some(found) = clock.and_then(|c| at(c).parse::<f64>().ok())
                && (found - expected).abs() > SAME_TIME * excitation.sample_time
            {
                return Err(Failure::Time {
                    row: k + 1,
                    expected,
                    found,
                });
            }
        }
        let rows = reader.position().record().saturating_sub(1) as usize;
        if rows != excitation.length {
            return Err(Failure::Rows {
                expected: excitation.length,
                found: rows,
            });
        }
        Ok(columns)
    }
}

impl ExternalSimulator for SimulatorCommand {
    fn simulate(
        &self,
        excitation: &Excitation,
        parameters: &[(String, f64)],
    ) -> Result<Vec<Vec<f64>>, Failure> {
        // Removed with all that the program left in it.
        let folder = tempfile::Builder::new()
            .prefix("innovant-simulator-")
            .tempdir()
            .map_err(files)?;
        let values: serde_json::Map<String, serde_json::Value> = parameters
            .iter()
            .map(|(name, value)| (name.clone(), (*value).into()))
            .collect();
        self.write_input(&folder.path().join("input.csv"), excitation)
            .map_err(files)?;
        let text = serde_json::Value::Object(values).to_string();
        std::fs::write(folder.path().join("parameters.json"), text + "\n").map_err(files)?;
        self.run(folder.path())?;
        self.read_output(&folder.path().join("output.csv"), excitation)
    }
}

fn files(error: io::Error) -> Failure {
    Failure::Files {
        reason: error.to_string(),
    }
}

/// Time of a sample; where the rate is a whole number it divides, for 3 * 0.1 is not 0.3.
fn time(excitation: &Excitation, sample: usize) -> f64 {
    let rate = (1.0 / excitation.sample_time).round();
    let passed = if 1.0 / rate == excitation.sample_time {
        sample as f64 / rate
    } else {
        sample as f64 * excitation.sample_time
    };
    excitation.start_time + passed
}

/// How a program ended; none where it was stopped at the limit.
fn wait(mut child: Child, limit: Duration) -> io::Result<Option<ExitStatus>> {
    let began = Instant::now();
    let mut pause = FIRST_PAUSE;
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        let left = limit.saturating_sub(began.elapsed());
        if left.is_zero() {
            child.kill()?;
            child.wait()?;
            return Ok(None);
        }
        sleep(pause.min(left));
        pause = (pause * 2).min(LONGEST_PAUSE);
    }
}

/// The last lines of a file; empty where there is nothing to read.
fn last_lines(path: &Path) -> String {
    let read = || -> io::Result<String> {
        let mut file = File::open(path)?;
        let length = file.metadata()?.len();
        file.seek(SeekFrom::Start(length.saturating_sub(MESSAGE_BYTES)))?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)?;
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    };
    let text = read().unwrap_or_default();
    let lines: Vec<&str> = text.lines().filter(|l| !l.trim().is_empty()).collect();
    lines[lines.len().saturating_sub(MESSAGE_LINES)..].join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn command(text: &str) -> anyhow::Result<SimulatorCommand> {
        SimulatorCommand::new(text, Vec::new(), Vec::new(), Duration::from_secs(1))
    }

    #[test]
    fn words_are_split_without_a_shell() {
        let split =
            command(r#"'my program' --in={input} "{output}" {parameters} ';' '$HOME'"#).unwrap();
        let expected = [
            "my program",
            "--in={input}",
            "{output}",
            "{parameters}",
            ";",
            "$HOME",
        ];
        assert_eq!(split.words, expected);
        for (wrong, words) in [
            ("sim {input} {output}", "holds no {parameters}"),
            (
                "sim '{input} {output} {parameters}",
                "a quote is not closed",
            ),
            ("", "cannot be split"),
        ] {
            let error = command(wrong).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
    }
}
