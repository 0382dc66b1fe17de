//! What can go wrong when uncertainty is propagated.

use crate::linalg::LinalgError;
use crate::model::ModelError;

/// A covariance that does not belong to the model, or a factorisation that failed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CovarianceError {
    /// The layout speaks of another number of states, inputs or outputs.
    #[error(
        "the covariance is for {states} states, {inputs} inputs, {outputs} outputs, but the model has {model_states}, {model_inputs}, {model_outputs}"
    )]
    Layout {
        /// States in the layout.
        states: usize,
        /// Inputs in the layout.
        inputs: usize,
        /// Outputs in the layout.
        outputs: usize,
        /// States of the model.
        model_states: usize,
        /// Inputs of the model.
        model_inputs: usize,
        /// Outputs of the model.
        model_outputs: usize,
    },
    /// The matrix does not have a row and a column per parameter.
    #[error("the covariance is {rows} x {columns}, but there are {parameters} parameters")]
    Size {
        /// Rows of the matrix.
        rows: usize,
        /// Columns of the matrix.
        columns: usize,
        /// Parameters in the layout.
        parameters: usize,
    },
    /// The matrix holds a NaN or an infinity.
    #[error("the covariance holds a value that is not finite")]
    NotFinite,
    /// The names do not match the channels.
    #[error("{given} {kind} names were given for {expected} {kind}s")]
    Names {
        /// `input` or `output`.
        kind: &'static str,
        /// Names given.
        given: usize,
        /// Channels of the model.
        expected: usize,
    },
    /// The model itself.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A factorisation failed.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}
