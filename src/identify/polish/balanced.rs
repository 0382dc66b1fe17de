//! State bases in which the states of the one-step predictor are ordered by how much they matter.

use nalgebra::{DMatrix, DVector};

use super::predictor::{controllability, observability};
use crate::identify::subspace::Varx;
use crate::linalg::{Svd, cholesky_upper, multiply_nt, qr_r, solve_upper_transposed, svd_thin};
use crate::model::StateSpace;

/// Hankel singular values below this share of the largest are not balanced: nothing is left of them in doubles.
const SMALLEST: f64 = 1e-12;

/// The system in a basis in which controllability and observability Gramian of its one-step predictor over `past` lags
/// are equal (balanced, Moore 1981, but for a rotation). As it is, where a state hardly takes part.
///
/// Gauss-Newton steps of minimum norm and Levenberg-Marquardt damping measure the parameters by their norm, which
/// depends on the basis. States of unit variance, as a subspace method leaves them, are a poor one when the inputs are
/// coloured: a fast mode then shares its direction with the slow signal.
///
/// Of all such bases it is the one that a symmetric transformation leads to. That is a smooth function of the system,
/// so that models that are near each other stay comparable entry by entry (the jackknife compares them so), which the
/// singular vectors of a nearly double singular value are not.
pub(super) fn balanced(system: &StateSpace, past: usize) -> StateSpace {
    let seen = stacked(&observability(system, past));
    let rows: Vec<DMatrix<f64>> = controllability(system, past)
        .iter()
        .map(DMatrix::transpose)
        .collect();
    Hankel::new(&seen, &stacked(&rows))
        .filter(|hankel| hankel.smallest_share() > SMALLEST)
        .and_then(|hankel| symmetric(&hankel.to_balanced(system.states())))
        .and_then(|to_balanced| system.transformed(&to_balanced).ok())
        .unwrap_or_else(|| system.clone())
}

/// The symmetric factor of `T = Q S`, `Q` orthogonal.
fn symmetric(transformation: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let svd = svd_thin(transformation).ok()?;
    Some(&svd.v * DMatrix::from_diagonal(&svd.values) * svd.v.transpose())
}

/// The `order` states of `system` that predictions of the recording rest on most: balanced truncation of its one-step
/// predictor, weighted by the innovation covariance and by what the past window held. A start for the polish where that
/// of the subspace method is poor.
pub(crate) fn reduced(system: &StateSpace, varx: &Varx, order: usize) -> Option<StateSpace> {
    let past = varx.past;
    let upper = cholesky_upper(&varx.innovation_covariance).ok()?;
    let whitened: Vec<DMatrix<f64>> = observability(system, past)
        .iter()
        .map(|row| solve_upper_transposed(&upper, row))
        .collect();
    // The regressors are the past window, oldest sample first.
    let columns: Vec<DMatrix<f64>> = controllability(system, past)
        .iter()
        .rev()
        .map(DMatrix::transpose)
        .collect();
    let past_window = stacked(&columns);
    let factor = varx.regressor_factor.columns(0, past_window.nrows());
    let reached = multiply_nt(&factor.into_owned(), &past_window.transpose());
    let hankel = Hankel::new(&stacked(&whitened), &reached)?;
    let n = system.states();
    let truncated = system.transformed(&hankel.to_balanced(n)).ok()?;
    (order < n).then(|| StateSpace {
        a: truncated.a.view((0, 0), (order, order)).into_owned(),
        b: truncated.b.rows(0, order).into_owned(),
        c: truncated.c.columns(0, order).into_owned(),
        d: truncated.d,
        k: truncated.k.rows(0, order).into_owned(),
        sample_time: truncated.sample_time,
    })
}

/// The product of observability and controllability, by its factors.
struct Hankel {
    /// Triangular factor of the observability.
    seen: DMatrix<f64>,
    svd: Svd,
}

impl Hankel {
    /// Of an observability matrix and the transpose of a controllability matrix; `None` where either has fewer rows
    /// than states.
    fn new(seen: &DMatrix<f64>, reached: &DMatrix<f64>) -> Option<Self> {
        let (seen, reached) = (qr_r(seen), qr_r(reached));
        let n = seen.ncols();
        if seen.nrows() < n || reached.nrows() < n {
            return None;
        }
        let svd = svd_thin(&multiply_nt(&seen, &reached)).ok()?;
        Some(Self { seen, svd })
    }

    fn smallest_share(&self) -> f64 {
        let largest = self.svd.values.max();
        if largest > 0.0 {
            self.svd.values.min() / largest
        } else {
            0.0
        }
    }

    fn to_balanced(&self, states: usize) -> DMatrix<f64> {
        let roots = self.svd.values.iter().map(|v| 1.0 / v.sqrt());
        let scale = DMatrix::from_diagonal(&DVector::from_iterator(states, roots));
        scale * self.svd.u.transpose() * &self.seen
    }
}

fn stacked(blocks: &[DMatrix<f64>]) -> DMatrix<f64> {
    let (rows, columns) = blocks.first().map_or((0, 0), DMatrix::shape);
    let mut out = DMatrix::zeros(rows * blocks.len(), columns);
    for (i, block) in blocks.iter().enumerate() {
        out.rows_mut(i * rows, rows).copy_from(block);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::predictor::predictor_coefficients;
    use super::super::predictor::tests::{system, varx_of};
    use super::*;

    #[test]
    fn gramians_are_equal_and_predictions_stay() {
        let original = system(false);
        let found = balanced(&original, 9);
        let coefficients = |s: &StateSpace| predictor_coefficients(s, 9, false);
        assert!((coefficients(&found) - coefficients(&original)).amax() < 1e-13);
        let seen = stacked(&observability(&found, 9));
        let gramian = seen.transpose() * &seen;
        let reached: DMatrix<f64> = controllability(&found, 9)
            .iter()
            .map(|block| block * block.transpose())
            .sum();
        assert!((&gramian - &reached).amax() < 1e-12 * gramian.amax());
        // Balanced already: nothing turns it.
        assert!((balanced(&found, 9).a - &found.a).amax() < 1e-12);
    }

    #[test]
    fn a_state_without_effect_is_left_out() {
        let truth = system(false);
        let mut larger = truth.clone();
        larger.a = larger.a.insert_row(2, 0.0).insert_column(2, 0.0);
        larger.a[(2, 2)] = 0.4;
        larger.b = larger.b.insert_row(2, 1e-6);
        larger.k = larger.k.insert_row(2, 0.0);
        larger.c = larger.c.insert_column(2, 1e-6);
        let varx = varx_of(&truth, 6, false);
        let found = reduced(&larger, &varx, 2).unwrap();
        let coefficients = |s: &StateSpace| predictor_coefficients(s, 6, false);
        assert!((coefficients(&found) - coefficients(&truth)).amax() < 1e-8);
        assert!(reduced(&truth, &varx, 2).is_none());
    }
}
