//! What a test needs to know of the sensitivity of the residuals.

use nalgebra::DMatrix;

/// A regressor: channel (inputs, then residuals) and lag.
pub(crate) type Regressor = (usize, usize);

/// Averages of tested regressors times sensitivities, both whitened.
#[derive(Debug, Clone)]
pub(crate) struct Averages {
    /// `E[w_white (x) t_white-sensitivity]`, `dimension x m`.
    pub(super) cross: DMatrix<f64>,
    /// Mean square error of one entry of `cross Cov^(1/2)`, from the scatter of batches.
    pub(crate) error: f64,
    /// `E[psi' Lambda^-1 psi]`, `m x m`.
    pub(crate) information: DMatrix<f64>,
    /// Mean square of what the first order misses in one whitened score.
    pub(super) remainder: f64,
    /// Samples averaged over.
    pub(crate) samples: usize,
}
