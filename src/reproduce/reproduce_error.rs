//! What can go wrong in a reproduction.

use crate::covariance::CovarianceError;
use crate::identify::IdentifyError;
use crate::linalg::LinalgError;
use crate::model::ModelError;

/// A reproduction that cannot be carried out.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub(crate) enum ReproduceError {
    /// Statistics over runs need runs.
    #[error(
        "{runs} runs are too few for statistics over runs; ask for at least {least} with --runs"
    )]
    TooFewRuns {
        /// How many were asked for.
        runs: usize,
        /// How many are needed.
        least: usize,
    },
    /// A method failed in too many runs.
    #[error(
        "{method} failed in {failed} of {runs} runs, so that nothing can be said of it; the first failure: {first}"
    )]
    Failed {
        /// Which method.
        method: String,
        /// Runs in which it failed.
        failed: usize,
        /// All runs.
        runs: usize,
        /// What it said.
        first: String,
    },
    /// A table of numbers could not be written.
    #[error("the numbers cannot be written as CSV: {0}")]
    Csv(#[from] csv::Error),
    /// An identification failed.
    #[error(transparent)]
    Identify(#[from] IdentifyError),
    /// A covariance could not be computed.
    #[error(transparent)]
    Covariance(#[from] CovarianceError),
    /// A test system could not be analysed.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A factorisation failed.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}
