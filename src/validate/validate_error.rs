//! Why a model cannot be judged on a record.

use crate::linalg::LinalgError;
use crate::model::ModelError;

/// Data or options that do not allow a judgement.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ValidateError {
    /// There is no record.
    #[error("there is no recording to validate the model on")]
    NoRecord,
    /// Too few samples for the tests.
    #[error(
        "{samples} samples are too few to judge the model: testing {lags} lags needs at least {needed}; \
         record longer or test fewer lags"
    )]
    TooShort {
        /// Samples left once the start-up of the predictor is dropped.
        samples: usize,
        /// Lags to be tested.
        lags: usize,
        /// Samples that would do.
        needed: usize,
    },
    /// An output that does not move has no fit.
    #[error(
        "output {name} is constant in the recording: there is nothing that a model could explain; \
         leave it out or use a recording in which it moves"
    )]
    ConstantOutput {
        /// Name of the output.
        name: String,
    },
    /// A sample is NaN or infinite.
    #[error("{name} holds {value} at sample {sample} of recording {record} (counted from 1)")]
    NotFinite {
        /// Name of the channel.
        name: String,
        /// Number of the recording, from 1.
        record: usize,
        /// Number of the sample, from 1.
        sample: usize,
        /// The sample.
        value: f64,
    },
    /// The one-step predictor runs away.
    #[error(
        "the one-step prediction of the model runs away on recording {record}: the spectral radius of A - K C is \
         {spectral_radius:.6}, so errors of the initial state grow; a model can only be judged with a gain K \
         that makes its predictor stable"
    )]
    PredictorDiverges {
        /// Number of the recording, from 1.
        record: usize,
        /// Largest modulus of the eigenvalues of `A - K C`.
        spectral_radius: f64,
    },
    /// A covariance that does not belong to the system.
    #[error("the {what} is {rows} x {columns}, but the model needs {expected} x {expected}")]
    Covariance {
        /// Which covariance.
        what: &'static str,
        /// Its rows.
        rows: usize,
        /// Its columns.
        columns: usize,
        /// Order that fits.
        expected: usize,
    },
    /// A level that is no probability.
    #[error("the level of the tests must be between 0 and 0.5, for example 0.01, not {level}")]
    Level {
        /// The level given.
        level: f64,
    },
    /// No lag to test.
    #[error("at least one lag must be tested")]
    NoLag,
    /// Channels that do not fit the model.
    #[error("recording {record}: {source}")]
    Data {
        /// Number of the recording, from 1.
        record: usize,
        /// What does not fit.
        source: ModelError,
    },
    /// A factorisation failed.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}
