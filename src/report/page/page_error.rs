//! What can go wrong with a page.

use crate::covariance::CovarianceError;
use crate::model::ModelError;

/// A page that cannot be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PageError {
    /// The template and what it is given do not fit together.
    #[error("the page cannot be written: {0}; this is a mistake in innovant, please report it")]
    Template(#[from] minijinja::Error),
    /// What follows from the model cannot be computed.
    #[error("the page cannot be written: {0}")]
    Covariance(#[from] CovarianceError),
    /// The poles of the model cannot be computed.
    #[error("the page cannot be written: {0}")]
    Model(#[from] ModelError),
}
