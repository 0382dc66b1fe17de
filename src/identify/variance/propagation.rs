//! First-order errors of parameters and vector ARX coefficients, in the same noise.

use nalgebra::DMatrix;

use crate::covariance::ParameterLayout;

/// First-order errors as a linear function of white noise `w` of unit covariance.
#[derive(Debug, Clone)]
pub(crate) struct Propagation {
    /// How the parameters are laid out.
    pub(crate) layout: ParameterLayout,
    /// Errors of the parameters, `theta x w`: `Cov = P P'`.
    pub(crate) parameters: DMatrix<f64>,
    /// Errors of the vector ARX coefficients, `vec` of an `l x m` matrix, in the same noise.
    pub(crate) coefficients: DMatrix<f64>,
}
