//! Why an external simulator gave no answer.

use std::fmt;

/// What went wrong in a run.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Failure {
    /// The program cannot be started.
    #[error("the simulator `{program}` cannot be started: {reason}")]
    NotStarted {
        /// First word of the command.
        program: String,
        /// What the system says.
        reason: String,
    },
    /// Its files cannot be written.
    #[error("the files of the simulator cannot be written: {reason}")]
    Files {
        /// What the system says.
        reason: String,
    },
    /// The program reported a failure.
    #[error("the simulator failed with {status}{}", messages_of(messages))]
    Exit {
        /// Exit code or signal.
        status: String,
        /// The last lines that it wrote.
        messages: String,
    },
    /// The program took too long.
    #[error(
        "the simulator was stopped at its time limit of {seconds} s{}",
        messages_of(messages)
    )]
    TimedOut {
        /// The limit.
        seconds: f64,
        /// The last lines that it wrote.
        messages: String,
    },
    /// The program ended without writing its output.
    #[error(
        "the simulator ended without writing its output file{}",
        messages_of(messages)
    )]
    NoOutput {
        /// The last lines that it wrote.
        messages: String,
    },
    /// The output is not a table of numbers.
    #[error("the output of the simulator cannot be read: {reason}")]
    Unreadable {
        /// Where and why.
        reason: String,
    },
    /// An output is missing.
    #[error(
        "the simulator wrote no column `{output}`, which the recording has; it wrote {}",
        list(found)
    )]
    MissingColumn {
        /// Name of the output.
        output: String,
        /// Columns that are there.
        found: Vec<String>,
    },
    /// Another number of outputs.
    #[error("the simulator gave {found} outputs instead of {expected}")]
    Outputs {
        /// Of the recording.
        expected: usize,
        /// Of the simulator.
        found: usize,
    },
    /// Another number of rows.
    #[error("the simulator gave {found} rows of outputs for {expected} rows of inputs")]
    Rows {
        /// Of the input.
        expected: usize,
        /// Of the output.
        found: usize,
    },
    /// The output is on another time base.
    #[error(
        "row {row} of the simulator's output is at t = {found} s, that of the input at {expected} s"
    )]
    Time {
        /// Counted from 1.
        row: usize,
        /// Of the input.
        expected: f64,
        /// Of the output.
        found: f64,
    },
    /// A value is missing or not a number.
    #[error("the simulator's output `{output}` is {text} in row {row} (t = {time} s)")]
    NotANumber {
        /// Name of the output.
        output: String,
        /// Counted from 1.
        row: usize,
        /// When.
        time: f64,
        /// What stands there.
        text: String,
    },
    /// A function raised an exception.
    #[error("the simulator raised {0}")]
    Raised(String),
}

impl Failure {
    /// Whether it has nothing to do with the values of the parameters, so that other values would fail alike.
    pub(crate) fn is_final(&self) -> bool {
        matches!(
            self,
            Self::NotStarted { .. }
                | Self::Files { .. }
                | Self::MissingColumn { .. }
                | Self::Outputs { .. }
                | Self::Raised(_)
        )
    }
}

/// A failed run, with the parameters it was given.
#[derive(Debug, Clone, PartialEq)]
pub struct ExternalError {
    /// What went wrong.
    pub failure: Failure,
    /// Names and values.
    pub parameters: Vec<(String, f64)>,
}

impl fmt::Display for ExternalError {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}", self.failure)?;
        if self.parameters.is_empty() {
            return Ok(());
        }
        let values: Vec<String> = self
            .parameters
            .iter()
            .map(|(name, value)| format!("{name} = {value}"))
            .collect();
        write!(f, "\nwith {}", values.join(", "))
    }
}

impl std::error::Error for ExternalError {}

/// Messages of a program behind what is said of it, indented.
fn messages_of(messages: &str) -> String {
    if messages.is_empty() {
        return " and wrote no message".to_owned();
    }
    let lines: Vec<String> = messages.lines().map(|l| format!("  | {l}")).collect();
    format!("; its last messages:\n{}", lines.join("\n"))
}

fn list(names: &[String]) -> String {
    if names.is_empty() {
        return "no column".to_owned();
    }
    let quoted: Vec<String> = names.iter().map(|n| format!("`{n}`")).collect();
    quoted.join(", ")
}
