//! What the past window cuts off.

use super::varx::Varx;
use crate::linalg::{
    LinalgError, cholesky_upper, multiply_nt, multiply_tn, solve_upper_transposed,
};
use crate::model::StateSpace;
use nalgebra::DMatrix;

/// Truncation above which the polish is not tried. The truncated part of the predictor adds this much to
/// a chi-square cost whose standard deviation is several units, so one unit is beyond detection; PBSID_opt
/// itself tolerates about a hundred.
pub(crate) const LARGEST_FOR_POLISH: f64 = 1.0;

/// Covariance over the record of the state that the predictor of `system` makes of each past window,
/// `sum_i At^i [B~ K] z[k-1-i]`, in the basis of `system`.
pub(crate) fn state_covariance(system: &StateSpace, varx: &Varx) -> DMatrix<f64> {
    let (n, inputs, outputs) = (system.states(), system.inputs(), system.outputs());
    let q = inputs + outputs;
    let predictor = &system.a - &system.k * &system.c;
    let mut column = DMatrix::zeros(n, q);
    column
        .columns_mut(0, inputs)
        .copy_from(&(&system.b - &system.k * &system.d));
    column.columns_mut(inputs, outputs).copy_from(&system.k);
    let width = varx.past * q;
    let mut state_of_past = DMatrix::zeros(n, width);
    for block in (0..varx.past).rev() {
        state_of_past.columns_mut(block * q, q).copy_from(&column);
        column = &predictor * column;
    }
    let past_factor = varx.regressor_factor.view((0, 0), (width, width));
    let state = multiply_nt(&past_factor.into_owned(), &state_of_past);
    multiply_tn(&state, &state) / varx.columns as f64
}

/// `eta_p = Nc tr(Lambda^-1 C At^p P At^p' C')`: the increase of the chi-square cost to be expected because
/// the state at the beginning of the past window is not in the regression, `At = A - K C`, `P` the
/// covariance of the state. Zero is the paper's assumption `At^p = 0`.
///
/// # Errors
/// [`LinalgError`] for a singular innovation covariance.
pub(crate) fn truncation(
    system: &StateSpace,
    state_covariance: &DMatrix<f64>,
    innovation_covariance: &DMatrix<f64>,
    past: usize,
    columns: usize,
) -> Result<f64, LinalgError> {
    let predictor = &system.a - &system.k * &system.c;
    let rows = &system.c * power(&predictor, past);
    let upper = cholesky_upper(innovation_covariance)?;
    let whitened = solve_upper_transposed(&upper, &rows);
    let eta = columns as f64 * (&whitened * state_covariance * whitened.transpose()).trace();
    Ok(if eta.is_finite() { eta } else { f64::INFINITY })
}

/// Smallest past window between `from` and `to` whose truncation is below `target`; `to` when none is.
///
/// # Errors
/// As [`truncation`].
pub(crate) fn past_for_truncation(
    system: &StateSpace,
    state_covariance: &DMatrix<f64>,
    innovation_covariance: &DMatrix<f64>,
    target: f64,
    from: usize,
    to: usize,
    columns: usize,
) -> Result<usize, LinalgError> {
    let predictor = &system.a - &system.k * &system.c;
    let upper = cholesky_upper(innovation_covariance)?;
    let mut rows = solve_upper_transposed(&upper, &system.c) * power(&predictor, from);
    for past in from..to {
        let eta = columns as f64 * (&rows * state_covariance * rows.transpose()).trace();
        if eta < target {
            return Ok(past);
        }
        rows = &rows * &predictor;
    }
    Ok(to)
}

fn power(matrix: &DMatrix<f64>, exponent: usize) -> DMatrix<f64> {
    let mut result = DMatrix::identity(matrix.nrows(), matrix.nrows());
    let mut square = matrix.clone();
    let mut rest = exponent;
    while rest > 0 {
        if rest & 1 == 1 {
            result = &result * &square;
        }
        square = &square * &square;
        rest >>= 1;
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn window_is_the_first_below_the_target() {
        let system = StateSpace {
            a: DMatrix::from_element(1, 1, 0.9),
            b: DMatrix::from_element(1, 1, 1.0),
            c: DMatrix::from_element(1, 1, 2.0),
            d: DMatrix::zeros(1, 1),
            k: DMatrix::from_element(1, 1, 0.1),
            sample_time: 1.0,
        };
        let one = DMatrix::identity(1, 1);
        let lambda = DMatrix::from_element(1, 1, 4.0);
        let eta = |p| truncation(&system, &one, &lambda, p, 1000).unwrap();
        approx::assert_relative_eq!(eta(3), 1000.0 * 0.7_f64.powi(6), max_relative = 1e-12);
        let past = past_for_truncation(&system, &one, &lambda, 1.0, 2, 50, 1000).unwrap();
        assert!(eta(past) < 1.0 && eta(past - 1) >= 1.0);
        assert_eq!(
            past_for_truncation(&system, &one, &lambda, 1e-9, 2, 5, 1000).unwrap(),
            5
        );
    }
}
