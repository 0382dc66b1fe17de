//! What can be wrong with a model or with the data handed to it.

use crate::linalg::LinalgError;

/// A model that is not one, or data that do not fit it.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// A matrix does not fit the others.
    #[error(
        "{matrix} is {rows} x {columns}, but must be {expected_rows} x {expected_columns}: {reason}"
    )]
    Shape {
        /// Name of the matrix.
        matrix: &'static str,
        /// Its rows.
        rows: usize,
        /// Its columns.
        columns: usize,
        /// Rows that fit.
        expected_rows: usize,
        /// Columns that fit.
        expected_columns: usize,
        /// Where the expected size comes from.
        reason: &'static str,
    },
    /// A matrix holds a NaN or an infinity.
    #[error("{matrix}[{row}, {column}] is {value}, not a finite number (counted from 1)")]
    NotFinite {
        /// Name of the matrix.
        matrix: &'static str,
        /// Row of the first such entry, from 1.
        row: usize,
        /// Column of the first such entry, from 1.
        column: usize,
        /// The entry.
        value: f64,
    },
    /// The sample time is not a positive number.
    #[error(
        "the sample time must be a positive number of seconds, between 1e-18 and 1e18, not {value}"
    )]
    SampleTime {
        /// The sample time given.
        value: f64,
    },
    /// The model has no output.
    #[error("a model needs at least one output, but C has no rows")]
    NoOutput,
    /// The number of channels differs from what the model has.
    #[error("the model has {expected} {kind}, but the data have {given}")]
    Channels {
        /// `inputs`, `outputs` or `innovations`.
        kind: &'static str,
        /// Channels in the data.
        given: usize,
        /// Channels of the model.
        expected: usize,
    },
    /// Channels of different length.
    #[error(
        "channel {channel} of the {kind} has {given} samples, but {expected} were expected as in the first channel"
    )]
    Length {
        /// `inputs`, `outputs` or `innovations`.
        kind: &'static str,
        /// Number of the channel, from 1.
        channel: usize,
        /// Its samples.
        given: usize,
        /// Samples of the first channel.
        expected: usize,
    },
    /// The initial state has the wrong length.
    #[error("the initial state has {given} entries, but the model has {expected} states")]
    InitialState {
        /// Entries given.
        given: usize,
        /// States of the model.
        expected: usize,
    },
    /// A change of basis that cannot be undone.
    #[error("the change of basis T ({rows} x {columns}) has no inverse")]
    Transformation {
        /// Rows of `T`.
        rows: usize,
        /// Columns of `T`.
        columns: usize,
    },
    /// A simulation that left the range of numbers.
    #[error(
        "the simulation diverges: output {output} leaves the range of numbers at sample {sample}, t = {time} s; the \
         model is unstable (spectral radius {spectral_radius:.6}): identify it again with --stable, or simulate fewer \
         samples"
    )]
    Diverges {
        /// Name of the output.
        output: String,
        /// First sample that is no number, from 0.
        sample: usize,
        /// Its time in seconds.
        time: f64,
        /// Largest modulus of a pole.
        spectral_radius: f64,
    },
    /// A factorisation failed.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}
