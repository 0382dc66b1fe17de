//! Discrete Riccati equation of the stationary Kalman filter.

use nalgebra::DMatrix;

use super::finite::all_finite;
use super::linalg_error::LinalgError;

/// Doubling steps after which the iteration has failed: `2^60` steps of the filter have no more to say.
const DOUBLINGS: usize = 60;
/// The iteration has ended when a step changes the covariance by less than this share of it.
const CONVERGED: f64 = 1e-14;

/// The stationary Kalman filter of `x+ = A x + w`, `y = C x + v` in innovation form.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct StationaryFilter {
    /// Covariance of the error of the predicted state, `n x n`.
    pub(crate) state_error: DMatrix<f64>,
    /// Gain `K = (A P C' + S) Lambda^-1`, `n x l`.
    pub(crate) gain: DMatrix<f64>,
    /// Covariance of the innovations `Lambda = C P C' + R`, `l x l`.
    pub(crate) innovation_covariance: DMatrix<f64>,
}

/// Solves `P = A P A' + Q - (A P C' + S) (C P C' + R)^-1 (A P C' + S)'` for the stabilising `P`, where
/// `cov [w; v] = [Q S; S' R]`, by the structure-preserving doubling algorithm (Chu, Fan, Lin & Wang 2004, for
/// the dual problem). It converges quadratically, also when `A - K C` is slow.
///
/// # Errors
/// [`LinalgError::Singular`] when `R` or an iterate cannot be inverted, [`LinalgError::NoConvergence`] when there
/// is no stabilising solution.
pub(crate) fn stationary_filter(
    a: &DMatrix<f64>,
    c: &DMatrix<f64>,
    q: &DMatrix<f64>,
    r: &DMatrix<f64>,
    s: &DMatrix<f64>,
) -> Result<StationaryFilter, LinalgError> {
    let what = "Riccati equation";
    let singular = || LinalgError::Singular { what };
    let n = a.nrows();
    let identity = DMatrix::<f64>::identity(n, n);
    let r_inverse = r.clone().try_inverse().ok_or_else(singular)?;
    // What the measurement noise tells of the process noise is taken out first: the rest has S = 0.
    let mut step = (a - s * &r_inverse * c).transpose();
    let mut g = c.transpose() * &r_inverse * c;
    let mut h = q - s * &r_inverse * s.transpose();
    let mut converged = false;
    for _ in 0..DOUBLINGS {
        let inverse = (&identity + &g * &h).try_inverse().ok_or_else(singular)?;
        let scaled = &step * &inverse;
        let g_next = &g + &scaled * &g * step.transpose();
        let change = step.transpose() * &h * &inverse * &step;
        let change = (&change + change.transpose()) * 0.5;
        let step_next = &scaled * &step;
        h += &change;
        if !all_finite(&h) {
            break;
        }
        converged = change.amax() <= CONVERGED * h.amax();
        if converged {
            break;
        }
        g = (&g_next + g_next.transpose()) * 0.5;
        step = step_next;
    }
    if !converged {
        return Err(LinalgError::NoConvergence {
            what,
            rows: n,
            columns: n,
        });
    }
    let innovation_covariance = c * &h * c.transpose() + r;
    let inverse = innovation_covariance
        .clone()
        .try_inverse()
        .ok_or_else(singular)?;
    Ok(StationaryFilter {
        gain: (a * &h * c.transpose() + s) * inverse,
        state_error: h,
        innovation_covariance,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::spectral_radius;

    #[test]
    fn the_equation_holds_and_the_filter_is_stable() {
        let a = DMatrix::from_row_slice(3, 3, &[1.1, 0.3, 0.0, -0.2, 0.7, 0.4, 0.1, 0.0, 0.5]);
        let c = DMatrix::from_row_slice(2, 3, &[1.0, 0.0, 0.5, 0.0, 1.0, -0.3]);
        let root = DMatrix::from_row_slice(
            5,
            5,
            &[
                1.0, 0.0, 0.0, 0.0, 0.0, 0.3, 0.8, 0.0, 0.0, 0.0, -0.2, 0.1, 0.5, 0.0, 0.0, 0.4,
                0.2, 0.1, 0.9, 0.0, -0.1, 0.3, 0.0, 0.2, 0.6,
            ],
        );
        let joint = &root * root.transpose();
        let q = joint.view((0, 0), (3, 3)).into_owned();
        let s = joint.view((0, 3), (3, 2)).into_owned();
        let r = joint.view((3, 3), (2, 2)).into_owned();
        let filter = stationary_filter(&a, &c, &q, &r, &s).unwrap();
        let p = &filter.state_error;
        let residual = &a * p * a.transpose() + &q
            - &filter.gain * &filter.innovation_covariance * filter.gain.transpose()
            - p;
        assert!(residual.amax() < 1e-12 * p.amax(), "{}", residual.amax());
        assert!(spectral_radius(&(&a - &filter.gain * &c)).unwrap() < 1.0);
    }

    #[test]
    fn an_unobservable_unstable_state_has_no_filter() {
        let a = DMatrix::from_row_slice(2, 2, &[1.2, 0.0, 0.0, 0.5]);
        let c = DMatrix::from_row_slice(1, 2, &[0.0, 1.0]);
        let one = DMatrix::identity(1, 1);
        let found = stationary_filter(
            &a,
            &c,
            &DMatrix::identity(2, 2),
            &one,
            &DMatrix::zeros(2, 1),
        );
        assert!(found.is_err());
    }
}
