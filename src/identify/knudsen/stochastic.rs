//! `K` and the innovation covariance from the covariance of the residuals: the stochastic step of Knudsen's
//! methods, for any deterministic part.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::future_regression::Regression;
use super::observability::{LeastSquares, Observability};
use crate::identify::IdentifyError;
use crate::linalg::{
    LinalgError, cholesky_upper, solve_upper, solve_upper_transposed, spectral_radius,
    stabilising_observer_gain,
};

/// Residual variance, relative to that of the (scaled) outputs, below which a recording is noise-free to rounding.
const NOISE_FREE: f64 = 1e-16;

/// How the residual covariance is read.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum ResidualStep {
    /// Its first block column, (35)-(36): the paper's tk.
    FirstColumn,
    /// Its Cholesky factor, a Toeplitz matrix but for the bias, most of which `Gamma_perp` removes, (37)-(40): the
    /// paper's tk-chol.
    #[default]
    Cholesky,
}

/// The stochastic part of a model.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct NoiseModel {
    /// Observer gain, `n x l`.
    pub(crate) k: DMatrix<f64>,
    /// Covariance of the innovations, `l x l`.
    pub(crate) innovation_covariance: DMatrix<f64>,
}

/// `K` and `R` for given `A`, `C` from the residual covariance `P` of the regression.
///
/// A noise-free recording has `K = 0` and `R = 0`. The predictor `A - K C` may be unstable: see [`minimum_phase`].
///
/// # Errors
/// [`IdentifyError::SingularRegression`] when the horizon is too short, [`IdentifyError::Linalg`] when `P` or the
/// estimate of `G` is singular.
pub(crate) fn stochastic(
    regression: &Regression,
    observability: &Observability,
    a: &DMatrix<f64>,
    c: &DMatrix<f64>,
    step: ResidualStep,
) -> Result<NoiseModel, IdentifyError> {
    let outputs = regression.outputs;
    let residual = &regression.residual_covariance;
    if residual.diagonal().iter().all(|v| *v < NOISE_FREE) {
        return Ok(NoiseModel {
            k: DMatrix::zeros(a.nrows(), outputs),
            innovation_covariance: DMatrix::zeros(outputs, outputs),
        });
    }
    match step {
        ResidualStep::FirstColumn => first_column(residual, observability),
        ResidualStep::Cholesky => {
            let factor = cholesky_upper(residual)?.transpose();
            let (g, m) = gain_of_factor(&factor, observability, a, c)?;
            Ok(NoiseModel {
                k: right_quotient(&m, &g)?,
                innovation_covariance: &g * g.transpose(),
            })
        }
    }
}

/// (35)-(36): `P[:, 0] = [R; Gamma^u K R]`.
fn first_column(
    residual: &DMatrix<f64>,
    observability: &Observability,
) -> Result<NoiseModel, IdentifyError> {
    let outputs = observability.outputs;
    let innovation_covariance = residual.view((0, 0), (outputs, outputs)).into_owned();
    let below = residual
        .view((outputs, 0), (residual.nrows() - outputs, outputs))
        .into_owned();
    let kr = LeastSquares::new(&observability.upper(), "the observability matrix")?.solve(&below);
    let upper = cholesky_upper(&innovation_covariance)?;
    // K = (K R) R^-1 with R = U' U.
    let k = solve_upper(&upper, &solve_upper_transposed(&upper, &kr.transpose())).transpose();
    Ok(NoiseModel {
        k,
        innovation_covariance,
    })
}

/// `G` (lower triangular) and `M = K G` of (38), column by column: column `c` of `[G; M]` has no entries above the
/// diagonal of `G`, so the first `c` columns of the regressor drop out.
pub(super) fn gain_of_factor(
    factor: &DMatrix<f64>,
    observability: &Observability,
    a: &DMatrix<f64>,
    c: &DMatrix<f64>,
) -> Result<(DMatrix<f64>, DMatrix<f64>), IdentifyError> {
    let (outputs, n) = c.shape();
    let regressor = observability.toeplitz_regressor(a, c);
    let target = observability.stacked(factor, outputs);
    let mut g = DMatrix::zeros(outputs, outputs);
    let mut m = DMatrix::zeros(n, outputs);
    for column in 0..outputs {
        let kept = regressor
            .columns(column, regressor.ncols() - column)
            .into_owned();
        let right = target.columns(column, 1).into_owned();
        let solution = LeastSquares::new(&kept, "the responses to the noise")?.solve(&right);
        g.view_mut((column, column), (outputs - column, 1))
            .copy_from(&solution.rows(0, outputs - column));
        m.view_mut((0, column), (n, 1))
            .copy_from(&solution.rows(outputs - column, n));
    }
    Ok((g, m))
}

/// `M G^-1`.
pub(super) fn right_quotient(
    m: &DMatrix<f64>,
    g: &DMatrix<f64>,
) -> Result<DMatrix<f64>, LinalgError> {
    let singular = LinalgError::Singular {
        what: "Cholesky factor of the innovation covariance",
    };
    let inverse = g.clone().try_inverse().ok_or(singular.clone())?;
    let k = m * inverse;
    if k.iter().all(|v| v.is_finite()) {
        Ok(k)
    } else {
        Err(singular)
    }
}

/// The noise model of the same output spectrum whose predictor `A - K C` is stable, and whether it had to be
/// exchanged. Table 1 of the paper implies this step: without it the printed rms of the innovation variance of the
/// BJ system cannot be had.
///
/// For one output it mirrors the zeros outside the unit circle and multiplies the variance by the squared modulus of
/// each. A zero on the circle to rounding leaves the model as it is.
pub(crate) fn minimum_phase(
    a: &DMatrix<f64>,
    c: &DMatrix<f64>,
    noise: NoiseModel,
) -> (NoiseModel, bool) {
    let predictor = a - &noise.k * c;
    let stable = spectral_radius(&predictor).is_ok_and(|radius| radius < 1.0);
    if stable {
        return (noise, false);
    }
    match stabilising_observer_gain(a, c, &noise.k, &noise.innovation_covariance) {
        Ok((k, innovation_covariance)) => (
            NoiseModel {
                k,
                innovation_covariance,
            },
            true,
        ),
        Err(_) => (noise, false),
    }
}
