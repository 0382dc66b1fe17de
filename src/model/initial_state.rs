//! The initial state that explains a recording best.

use nalgebra::{DMatrix, DVector};

use super::error::ModelError;
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
mod tests {
    use super::*;
    use nalgebra::{dmatrix, dvector};

    fn system(gain: f64) -> StateSpace {
        StateSpace::new(
            dmatrix![0.95, 0.2; -0.2, 0.9],
            dmatrix![1.0; 0.4],
            dmatrix![1.0, 0.2; 0.3, 1.0],
            dmatrix![0.0; 0.0],
            dmatrix![0.4, 0.1; 0.0, 0.3] * gain,
            1.0,
        )
        .unwrap()
    }

    fn column(seed: usize, samples: usize) -> Vec<f64> {
        (0..samples)
            .map(|k| ((k * 29 + seed * 53) % 31) as f64 / 15.0 - 1.0)
            .collect()
    }

    #[test]
    fn exact_without_noise() {
        for gain in [0.0, 1.0] {
            let s = system(gain);
            let u = column(1, 5000);
            let x0 = dvector![3.0, -2.0];
            let y = s.simulate(&[&u], Some(&x0)).unwrap();
            let found = estimate_initial_state(&s, &[&u], &[&y[0], &y[1]], None).unwrap();
            assert!((found - &x0).norm() < 1e-9, "gain {gain}");
        }
    }

    #[test]
    fn satisfies_the_normal_equations_of_the_weighted_problem() {
        let s = system(1.0);
        let (u, e1, e2) = (column(1, 300), column(2, 300), column(7, 300));
        let y = s
            .simulate_with_noise(&[&u], &[&e1, &e2], Some(&dvector![1.0, 1.0]))
            .unwrap();
        let lambda = dmatrix![1.0, 0.3; 0.3, 0.5];
        let cost = |x0: &DVector<f64>| {
            let p = s.one_step(&[&u], &[&y[0], &y[1]], Some(x0)).unwrap();
            let inverse = lambda.clone().try_inverse().unwrap();
            (0..300)
                .map(|k| {
                    let e = dvector![p.innovations[0][k], p.innovations[1][k]];
                    e.dot(&(&inverse * &e))
                })
                .sum::<f64>()
        };
        let found = estimate_initial_state(&s, &[&u], &[&y[0], &y[1]], Some(&lambda)).unwrap();
        let best = cost(&found);
        for direction in [dvector![1e-3, 0.0], dvector![0.0, 1e-3]] {
            assert!(cost(&(&found + &direction)) > best);
            assert!(cost(&(&found - &direction)) > best);
        }
    }

    #[test]
    fn what_the_outputs_do_not_show_stays_zero() {
        let s = StateSpace::deterministic(
            dmatrix![0.9, 0.0; 0.0, 0.5],
            dmatrix![1.0; 1.0],
            dmatrix![1.0, 0.0],
            dmatrix![0.0],
            1.0,
        )
        .unwrap();
        let u = column(1, 50);
        let y = s.simulate(&[&u], Some(&dvector![2.0, 5.0])).unwrap();
        let found = estimate_initial_state(&s, &[&u], &[&y[0]], None).unwrap();
        assert!((found - dvector![2.0, 0.0]).norm() < 1e-10);
    }

    #[test]
    fn integrators_use_the_whole_record_and_unstable_models_do_not_overflow() {
        for pole in [1.0, 1.2] {
            let s = StateSpace::deterministic(
                dmatrix![pole],
                dmatrix![1.0],
                dmatrix![1.0],
                dmatrix![0.0],
                1.0,
            )
            .unwrap();
            let u = vec![0.0; 6000];
            let y = s.simulate(&[&u], Some(&dvector![2.5])).unwrap();
            let keep = if pole > 1.0 { 200 } else { 6000 };
            let found = estimate_initial_state(&s, &[&u[..keep]], &[&y[0][..keep]], None).unwrap();
            assert!((found[0] - 2.5).abs() < 1e-9);
        }
    }

    #[test]
    fn short_and_unfit_data() {
        let s = system(1.0);
        let found = estimate_initial_state(&s, &[&[]], &[&[], &[]], None).unwrap();
        assert_eq!(found, dvector![0.0, 0.0]);
        assert!(estimate_initial_state(&s, &[&[0.0]], &[&[0.0]], None).is_err());
        let bad = estimate_initial_state(&s, &[&[0.0]], &[&[f64::NAN], &[0.0]], None);
        assert!(matches!(bad, Err(ModelError::Linalg(_))));
        let lambda = DMatrix::identity(3, 3);
        let shape = estimate_initial_state(&s, &[&[0.0]], &[&[0.0], &[0.0]], Some(&lambda));
        assert!(matches!(shape, Err(ModelError::Shape { .. })));
    }
}
