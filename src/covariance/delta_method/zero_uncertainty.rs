//! Uncertainty of the invariant zeros.

use super::gradient::Differential;
use super::pole_uncertainty::PoleUncertainty;
use crate::covariance::{CovarianceError, ParameterCovariance};
use crate::model::{StateSpace, zero_directions};

/// Zeros with their uncertainty, in the order of [`StateSpace::zeros`]. First order, with the left and
/// right null vectors `w`, `v` of the pencil `[A - zI, B; C, D]` at the zero (`pbsid-opt.md` section 2):
///
/// `dz = w^T [dA dB; dC dD] v / (w^T diag(I, 0) v)`.
///
/// There is no covariance for a multiple zero, nor for a zero of a system that is not square: the
/// smallest change of the parameters makes the latter disappear.
///
/// # Errors
/// [`CovarianceError::Layout`] or [`CovarianceError::Size`] for the covariance of another model,
/// [`CovarianceError::Model`] when a factorisation fails.
pub fn zero_uncertainties(
    system: &StateSpace,
    covariance: &ParameterCovariance,
) -> Result<Vec<PoleUncertainty>, CovarianceError> {
    covariance.check(system)?;
    system
        .zeros()?
        .into_iter()
        .map(|zero| {
            let place = zero_directions(system, zero.value)?.map(|d| {
                let differential = Differential {
                    alpha: d.left_state.as_slice().to_vec(),
                    rho: d.right_state.as_slice().to_vec(),
                    beta: d.right_input.as_slice().to_vec(),
                    kappa: Vec::new(),
                    gamma: d.left_output.as_slice().to_vec(),
                };
                let mut gradient = differential.gradient(&covariance.layout);
                if zero.value.im == 0.0 {
                    // The gradient of a real zero is real; what is left of the phase is rounding.
                    gradient.iter_mut().for_each(|g| g.im = 0.0);
                }
                covariance.complex_covariances(&[gradient])[0]
            });
            Ok(PoleUncertainty::new(zero, place, system.sample_time))
        })
        .collect()
}

#[cfg(test)]
#[path = "tests/zero_uncertainty_tests.rs"]
mod tests;
