//! First-order errors of parameters and vector ARX coefficients, in the same noise.

use nalgebra::DMatrix;

use crate::covariance::ParameterLayout;

/// First-order errors as a linear function of white noise `w` of unit covariance.
#[derive(Debug, Clone)]
pub struct Propagation {
    /// How the parameters are laid out.
    pub layout: ParameterLayout,
    /// Errors of the parameters, `theta x w`: `Cov = P P'`.
    pub parameters: DMatrix<f64>,
    /// Errors of the vector ARX coefficients, `vec` of an `l x m` matrix, in the same noise.
    pub coefficients: DMatrix<f64>,
}
