//! The initial state that explains a recording best.

use nalgebra::{DMatrix, DVector};

use super::model_error::ModelError;
use super::predict::Predictor;
use super::state_space::StateSpace;
use crate::linalg::{LinalgError, pseudo_inverse, qr_r, symmetric_eigen};

/// The initial state has no influence any more once the predictor has shrunk it this far.
const FORGOTTEN: f64 = 1e-8;

/// An unstable predictor is followed until it has grown this far: later samples see only its unstable
/// part, with rounding errors of the size of the rest.
const RUN_AWAY: f64 = 1e8;

/// Singular values below this fraction of the largest count as zero: such directions of the state do
/// not show in the outputs.
const UNDETERMINED: f64 = 1e-10;

/// Samples that are compressed at a time; bounds the memory for a predictor that never forgets.
const BLOCK: usize = 2048;

/// Least-squares estimate of the state at the first sample (`n`).
///
/// The innovations of the predictor are linear in it, `e[k] = e0[k] - C (A - K C)^k x0`, with `e0` those
/// from a zero state. Minimises `sum e[k]' Lambda^-1 e[k]` over the samples that the initial state still
/// reaches (until `|(A - K C)^k|` has fallen below `1e-8`, or to the end of the data). Directions that
/// the data do not determine stay zero (minimum norm). For a model with `K = 0` this is the initial
/// state of the free run.
///
/// `inputs` and `outputs` hold one column per channel; `innovation_covariance` is `Lambda` (`l x l`,
/// identity without it; its eigenvalues are floored at `1e-12` of the largest, so that an output without
/// noise is allowed).
///
/// # Errors
/// [`ModelError::Channels`] or [`ModelError::Length`] for data that do not fit, [`ModelError::Shape`]
/// for a covariance that does not, [`ModelError::Linalg`] for data with NaN or infinity.
pub fn estimate_initial_state(
    system: &StateSpace,
    inputs: &[&[f64]],
    outputs: &[&[f64]],
    innovation_covariance: Option<&DMatrix<f64>>,
) -> Result<DVector<f64>, ModelError> {
    let (n, l) = (system.states(), system.outputs());
    let samples = outputs.first().map_or(0, |y| y.len());
    let whitening = whitening(innovation_covariance, l)?;
    let mut predictor = Predictor::new(system, None)?;
    predictor.check(inputs, outputs)?;
    if n == 0 || samples == 0 {
        return Ok(DVector::zeros(n));
    }

    let predictor_matrix = system.predictor_matrix();
    let mut power = DMatrix::identity(n, n);
    // Triangular factor of [whitened C Atilde^k | whitened e0], rows k stacked.
    let mut compressed = DMatrix::zeros(0, n + 1);
    let mut from = 0;
    let mut matters = true;
    while from < samples && matters {
        let to = (from + BLOCK).min(samples);
        let u: Vec<&[f64]> = inputs.iter().map(|c| &c[from..to]).collect();
        let y: Vec<&[f64]> = outputs.iter().map(|c| &c[from..to]).collect();
        let prediction = predictor.step(&u, &y)?;
        let mut rows = DMatrix::zeros((to - from) * l, n + 1);
        let mut filled = 0;
        for k in 0..to - from {
            let size = power.norm();
            if !(FORGOTTEN..=RUN_AWAY).contains(&size) {
                matters = false;
                break;
            }
            let regressor = &whitening * (&system.c * &power);
            let target =
                &whitening * DVector::from_iterator(l, prediction.innovations.iter().map(|e| e[k]));
            rows.view_mut((filled, 0), (l, n)).copy_from(&regressor);
            rows.view_mut((filled, n), (l, 1)).copy_from(&target);
            filled += l;
            power = &predictor_matrix * power;
        }
        let head = compressed.nrows();
        let mut stacked = DMatrix::zeros(head + filled, n + 1);
        stacked.rows_mut(0, head).copy_from(&compressed);
        stacked
            .rows_mut(head, filled)
            .copy_from(&rows.rows(0, filled));
        if stacked.nrows() > 0 {
            compressed = qr_r(&stacked);
        }
        from = to;
    }
    if compressed.nrows() == 0 {
        return Ok(DVector::zeros(n));
    }
    let regressors = compressed.columns(0, n).into_owned();
    let target = compressed.column(n).into_owned();
    if target.iter().any(|v| !v.is_finite()) {
        return Err(LinalgError::NotFinite {
            what: "initial state",
        }
        .into());
    }
    Ok(pseudo_inverse(&regressors, UNDETERMINED)? * target)
}

/// `W` with `W' W = Lambda^-1`, scaled to unit size.
fn whitening(covariance: Option<&DMatrix<f64>>, l: usize) -> Result<DMatrix<f64>, ModelError> {
    let Some(covariance) = covariance else {
        return Ok(DMatrix::identity(l, l));
    };
    if covariance.shape() != (l, l) {
        return Err(ModelError::Shape {
            matrix: "the innovation covariance",
            rows: covariance.nrows(),
            columns: covariance.ncols(),
            expected_rows: l,
            expected_columns: l,
            reason: "it needs a row and a column per output",
        });
    }
    let eigen = symmetric_eigen(covariance)?;
    let largest = eigen.values.amax();
    if largest == 0.0 {
        return Ok(DMatrix::identity(l, l));
    }
    let scale = eigen
        .values
        .map(|value| (largest / value.max(1e-12 * largest)).sqrt());
    Ok(DMatrix::from_diagonal(&scale) * eigen.vectors.transpose())
}

#[cfg(test)]
#[path = "tests/initial_state_tests.rs"]
mod tests;
