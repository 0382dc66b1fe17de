//! Uncertainty of the invariant zeros.

use super::error::CovarianceError;
use super::gradient::Differential;
use super::parameters::ParameterCovariance;
use super::poles::PoleUncertainty;
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
mod tests {
    use super::*;
    use crate::covariance::fixtures::{self, assert_close};

    #[test]
    fn equals_central_differences() {
        for feedthrough in [false, true] {
            let (system, covariance) = fixtures::square(feedthrough);
            let found = zero_uncertainties(&system, &covariance).unwrap();
            assert_eq!(found.len(), if feedthrough { 3 } else { 1 });
            for (i, uncertainty) in found.iter().enumerate() {
                let numeric = fixtures::numeric_covariance(&system, &covariance, |s| {
                    let zero = s.zeros().unwrap()[i];
                    vec![zero.value.re, zero.value.im, zero.natural_frequency]
                });
                let c = uncertainty.covariance.unwrap();
                let place = numeric.view((0, 0), (2, 2)).into_owned();
                assert_close(c.as_flattened(), place.as_slice(), 1e-6);
                let std = uncertainty.natural_frequency_std.unwrap();
                assert!((std - numeric[(2, 2)].sqrt()).abs() < 1e-6 * std);
            }
        }
    }

    #[test]
    fn does_not_depend_on_the_state_basis() {
        let (system, covariance) = fixtures::square(true);
        let (other, moved) = fixtures::in_another_basis(&system, &covariance);
        let a = zero_uncertainties(&system, &covariance).unwrap();
        let b = zero_uncertainties(&other, &moved).unwrap();
        for (x, y) in a.iter().zip(&b) {
            let (x, y) = (x.covariance.unwrap(), y.covariance.unwrap());
            assert_close(x.as_flattened(), y.as_flattened(), 1e-9);
        }
    }

    #[test]
    fn units_of_the_channels_do_not_matter() {
        let (system, covariance) = fixtures::square(true);
        let a = zero_uncertainties(&system, &covariance).unwrap();
        let (mut scaled, mut moved) = (system.clone(), covariance.clone());
        // Inputs in units a million times smaller: B and D scale, and so does their covariance.
        scaled.b *= 1e-6;
        scaled.d *= 1e-6;
        let layout = covariance.layout;
        let is_input = |p: usize| (layout.b()..layout.k()).contains(&p) || p >= layout.d();
        for i in 0..layout.len() {
            for j in 0..layout.len() {
                for p in [i, j] {
                    if is_input(p) {
                        moved.matrix[(i, j)] *= 1e-6;
                    }
                }
            }
        }
        let b = zero_uncertainties(&scaled, &moved).unwrap();
        for (x, y) in a.iter().zip(&b) {
            let (x, y) = (x.covariance.unwrap(), y.covariance.unwrap());
            assert_close(x.as_flattened(), y.as_flattened(), 1e-8);
        }
    }

    #[test]
    fn more_outputs_than_inputs_have_no_zero() {
        let (system, covariance) = fixtures::two_by_three(false);
        assert!(zero_uncertainties(&system, &covariance).unwrap().is_empty());
    }
}
