//! Uncertainty of the poles.

use num_complex::Complex64;

use super::gradient::{Covariance2, Differential, projected_variance};
use crate::covariance::{CovarianceError, ParameterCovariance};
use crate::linalg::{LinalgError, eigen};
use crate::model::{Pole, StateSpace, slowest_first};

/// Condition number `|w| |v|` (with `w v = 1`) of an eigenvalue beyond which it is multiple to working
/// precision: its derivative is then mostly rounding, and near a double pole the eigenvalue moves like
/// the square root of the error anyway.
pub(crate) const DEFECTIVE: f64 = 1e7;

/// A pole or a zero with what is known about its place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoleUncertainty {
    /// The pole (or zero).
    pub pole: Pole,
    /// Covariance of (Re, Im); `None` for a multiple pole, where the place is not differentiable.
    pub covariance: Option<Covariance2>,
    /// Standard deviation of the natural frequency, rad/s; `None` at an integrator and at a delay.
    pub natural_frequency_std: Option<f64>,
    /// Standard deviation of the damping ratio; zero for a real pole, whose damping is 1 as long as it is
    /// real.
    pub damping_std: Option<f64>,
    /// Standard deviation of the time constant, seconds.
    pub time_constant_std: Option<f64>,
}

impl PoleUncertainty {
    /// Carries a covariance in the `z` plane over to natural frequency, damping and time constant through
    /// `s = ln(z) / Ts`, `ds = dz / (z Ts)`.
    pub fn new(pole: Pole, covariance: Option<Covariance2>, sample_time: f64) -> Self {
        let mut made = Self {
            pole,
            covariance,
            natural_frequency_std: None,
            damping_std: None,
            time_constant_std: None,
        };
        let (Some(covariance), Some(_)) = (covariance, pole.damping) else {
            return made;
        };
        if !pole.natural_frequency.is_finite() {
            return made;
        }
        let s = pole.value.ln() / sample_time;
        let slope = (pole.value * sample_time).inv();
        // (d Re s, d Im s) in (d Re z, d Im z).
        let (real, imag) = ([slope.re, -slope.im], [slope.im, slope.re]);
        let std = |on_real: f64, on_imag: f64| {
            projected_variance(
                &covariance,
                on_real * real[0] + on_imag * imag[0],
                on_real * real[1] + on_imag * imag[1],
            )
            .sqrt()
        };
        let [natural_frequency, damping, time_constant] = continuous_stds(s, std);
        made.natural_frequency_std = Some(natural_frequency);
        made.damping_std = Some(damping);
        made.time_constant_std = pole.time_constant.map(|_| time_constant);
        made
    }
}

/// Standard deviations of natural frequency, damping and time constant of a pole `s`, where `std(a, b)` is that of
/// `a Re s + b Im s`.
pub(crate) fn continuous_stds(s: Complex64, std: impl Fn(f64, f64) -> f64) -> [f64; 3] {
    let w = s.norm();
    [
        std(s.re / w, s.im / w),
        // zeta = -Re s / |s|: d zeta = -(Im s)^2 / |s|^3 dRe s + Re s Im s / |s|^3 dIm s
        std(-s.im * s.im / w.powi(3), s.re * s.im / w.powi(3)),
        std(1.0 / (s.re * s.re), 0.0),
    ]
}

/// Poles with their uncertainty, in the order of [`StateSpace::poles`]. First order, with left and right
/// eigenvectors `w v = 1`: `dlambda = w dA v` (`pbsid-opt.md` section 2). Confidence regions are ellipses
/// (`chi2` with two degrees of freedom, [`ellipse_quantile`](crate::covariance::ellipse_quantile)).
///
/// # Errors
/// [`CovarianceError::Layout`] or [`CovarianceError::Size`] for the covariance of another model,
/// [`CovarianceError::Linalg`] when the eigenvalues cannot be computed.
pub fn pole_uncertainties(
    system: &StateSpace,
    covariance: &ParameterCovariance,
) -> Result<Vec<PoleUncertainty>, CovarianceError> {
    covariance.check(system)?;
    let without = |pole| PoleUncertainty::new(pole, None, system.sample_time);
    let decomposition = match eigen(&system.a) {
        Ok(decomposition) => decomposition,
        Err(LinalgError::Singular { .. }) => {
            return Ok(system.poles()?.into_iter().map(without).collect());
        }
        Err(error) => return Err(error.into()),
    };
    Ok(slowest_first(&decomposition.values)
        .into_iter()
        .map(|i| {
            let pole = Pole::new(decomposition.values[i], system.sample_time);
            let left = decomposition.left.row(i);
            let right = decomposition.right.column(i);
            // Not-a-number, too, counts as defective.
            let simple = left.norm() * right.norm() < DEFECTIVE;
            if !simple {
                return without(pole);
            }
            let differential: Differential<Complex64> = Differential {
                alpha: left.iter().copied().collect(),
                rho: right.iter().copied().collect(),
                ..Differential::default()
            };
            let mut gradient = differential.gradient(&covariance.layout);
            if pole.value.im == 0.0 {
                // The gradient of a real pole is real; what is left of the phase is rounding.
                gradient.iter_mut().for_each(|g| g.im = 0.0);
            }
            let place = covariance.complex_covariances(&[gradient])[0];
            PoleUncertainty::new(pole, Some(place), system.sample_time)
        })
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::covariance::test_covariances::{self, assert_close};
    use nalgebra::dmatrix;

    #[test]
    fn equals_central_differences() {
        let (system, covariance) = test_covariances::two_by_three(false);
        let found = pole_uncertainties(&system, &covariance).unwrap();
        assert_eq!(found.len(), 3);
        for (i, uncertainty) in found.iter().enumerate() {
            let numeric = test_covariances::numeric_covariance(&system, &covariance, |s| {
                let pole = s.poles().unwrap()[i];
                vec![
                    pole.value.re,
                    pole.value.im,
                    pole.natural_frequency,
                    pole.damping.unwrap(),
                    pole.time_constant.unwrap(),
                ]
            });
            let c = uncertainty.covariance.unwrap();
            let place = numeric.view((0, 0), (2, 2)).into_owned();
            assert_close(
                &[c[0][0], c[0][1], c[1][0], c[1][1]],
                place.as_slice(),
                1e-7,
            );
            let stds = [
                uncertainty.natural_frequency_std.unwrap(),
                uncertainty.damping_std.unwrap(),
                uncertainty.time_constant_std.unwrap(),
            ];
            for (k, std) in stds.iter().enumerate() {
                let expected = numeric[(2 + k, 2 + k)].sqrt();
                assert!(
                    (std - expected).abs() < 1e-7 * (1.0 + expected),
                    "pole {i}, {k}"
                );
            }
        }
    }

    #[test]
    fn does_not_depend_on_the_state_basis() {
        let (system, covariance) = test_covariances::two_by_three(true);
        let (other, moved) = test_covariances::in_another_basis(&system, &covariance);
        let a = pole_uncertainties(&system, &covariance).unwrap();
        let b = pole_uncertainties(&other, &moved).unwrap();
        for (x, y) in a.iter().zip(&b) {
            let (x, y) = (x.covariance.unwrap(), y.covariance.unwrap());
            assert_close(x.as_flattened(), y.as_flattened(), 1e-9);
        }
    }

    #[test]
    fn multiple_poles_have_no_covariance() {
        for coupling in [1.0, 1e-12] {
            let (mut system, covariance) = test_covariances::oscillator();
            system.a = dmatrix![0.5, coupling; 0.0, 0.5];
            let found = pole_uncertainties(&system, &covariance).unwrap();
            assert_eq!(found.len(), 2);
            assert!(found.iter().all(|p| (p.pole.value.re - 0.5).abs() < 1e-9));
            if coupling == 1.0 {
                assert!(found.iter().all(|p| p.covariance.is_none()));
            }
        }
    }

    #[test]
    fn integrators_have_a_place_but_no_relative_measures() {
        let (mut system, covariance) = test_covariances::oscillator();
        system.a = dmatrix![1.0, 0.0; 0.0, 0.5];
        let found = pole_uncertainties(&system, &covariance).unwrap();
        assert!(found[0].covariance.is_some());
        assert_eq!(found[0].natural_frequency_std, None);
        assert_eq!(found[0].time_constant_std, None);
        assert_eq!(found[1].damping_std, Some(0.0));
        assert_eq!(found[1].covariance.unwrap()[1][1], 0.0);
    }

    #[test]
    fn no_states_no_poles() {
        let (system, covariance) = test_covariances::static_gain(0.25);
        assert!(pole_uncertainties(&system, &covariance).unwrap().is_empty());
    }
}
