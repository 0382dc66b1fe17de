//! `A`, `B`, `C` and `D` from the regression.

use nalgebra::DMatrix;

use super::future_regression::Regression;
use super::observability::{Decomposition, LeastSquares, Observability};
use crate::identify::IdentifyError;

/// The deterministic part of a model.
#[derive(Debug, Clone)]
pub(crate) struct Deterministic {
    /// State matrix, `n x n`.
    pub(crate) a: DMatrix<f64>,
    /// Input matrix, `n x m`.
    pub(crate) b: DMatrix<f64>,
    /// Output matrix, `l x n`.
    pub(crate) c: DMatrix<f64>,
    /// Feedthrough, `l x m`.
    pub(crate) d: DMatrix<f64>,
    /// What it was computed from.
    pub(crate) observability: Observability,
}

/// Knudsen (13)-(15) and (22)-(24). In print (23) has lost its roles: `A` is the pseudo-inverse of the *upper*
/// block rows of `Gamma_h` times the *lower* ones.
///
/// # Errors
/// [`IdentifyError::Order`] for an order that the horizon does not allow, [`IdentifyError::SingularRegression`] when
/// the data do not determine the matrices.
pub(crate) fn deterministic(
    regression: &Regression,
    decomposition: &Decomposition,
    order: usize,
    feedthrough: bool,
) -> Result<Deterministic, IdentifyError> {
    let observability = decomposition.observability(order)?;
    let c = observability.gamma.rows(0, regression.outputs).into_owned();
    let a = LeastSquares::new(&observability.upper(), "the observability matrix")?
        .solve(&observability.lower());
    let (b, d) = inputs(regression, &observability, &a, &c, feedthrough)?;
    Ok(Deterministic {
        a,
        b,
        c,
        d,
        observability,
    })
}

/// `B` and `D` for given `A` and `C` (24), whatever method they came from.
///
/// # Errors
/// [`IdentifyError::SingularRegression`] when the horizon is too short for them.
pub(crate) fn inputs(
    regression: &Regression,
    observability: &Observability,
    a: &DMatrix<f64>,
    c: &DMatrix<f64>,
    feedthrough: bool,
) -> Result<(DMatrix<f64>, DMatrix<f64>), IdentifyError> {
    let (n, outputs, inputs) = (a.nrows(), regression.outputs, regression.inputs);
    let first = if feedthrough { 0 } else { outputs };
    let regressor = observability.toeplitz_regressor(a, c);
    let kept = regressor
        .columns(first, regressor.ncols() - first)
        .into_owned();
    let target = observability.stacked(&regression.future_coefficients(), inputs);
    let solution = LeastSquares::new(&kept, "the responses to the inputs")?.solve(&target);
    let b = solution.rows(outputs - first, n).into_owned();
    let d = if feedthrough {
        solution.rows(0, outputs).into_owned()
    } else {
        DMatrix::zeros(outputs, inputs)
    };
    Ok((b, d))
}
