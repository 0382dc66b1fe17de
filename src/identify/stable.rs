//! A stable model, guaranteed, and what it costs.

use nalgebra::DMatrix;
use num_complex::Complex64;

use crate::linalg::{LinalgError, eigen, spectral_radius, stabilising_observer_gain};
use crate::model::StateSpace;

/// Largest spectral radius that counts as stable for a record of `columns` windows: a time constant as
/// long as the record. Slower decay cannot be told from an integrator by these data.
pub(super) fn largest_stable_radius(columns: usize) -> f64 {
    (-1.0 / columns.max(10) as f64).exp()
}

/// The system with every eigenvalue of `A` beyond `radius` moved onto it along its ray; the eigenvectors,
/// and with them the other matrices, stay.
///
/// # Errors
/// [`LinalgError`] when `A` is defective.
pub(super) fn with_poles_inside(
    system: &StateSpace,
    radius: f64,
) -> Result<StateSpace, LinalgError> {
    let decomposition = eigen(&system.a)?;
    let n = system.states();
    let moved: Vec<Complex64> = decomposition
        .values
        .iter()
        .map(|value| {
            if value.norm() > radius {
                value * (radius / value.norm())
            } else {
                *value
            }
        })
        .collect();
    let diagonal = DMatrix::from_fn(n, n, |i, j| {
        if i == j {
            moved[i]
        } else {
            Complex64::default()
        }
    });
    let a = &decomposition.right * diagonal * &decomposition.left;
    Ok(StateSpace {
        a: a.map(|v| v.re),
        ..system.clone()
    })
}

/// Radius of `A - K C` beyond which a predictor counts as unstable.
const LARGEST_PREDICTOR_RADIUS: f64 = 0.9999;

/// The system with a stable predictor: when `A - K C` has eigenvalues outside the unit circle, which noise in
/// `K` can cause, `K` is replaced by the gain of the same noise spectrum whose predictor is stable. `None` when
/// the predictor is stable as it is, or the gain cannot be computed.
pub(super) fn with_stable_predictor(
    system: &StateSpace,
    innovation_covariance: &DMatrix<f64>,
) -> Option<StateSpace> {
    let predictor = &system.a - &system.k * &system.c;
    if spectral_radius(&predictor).ok()? <= LARGEST_PREDICTOR_RADIUS {
        return None;
    }
    let (k, _) =
        stabilising_observer_gain(&system.a, &system.c, &system.k, innovation_covariance).ok()?;
    Some(StateSpace {
        k,
        ..system.clone()
    })
}
