//! Poles, with what they mean in continuous time.

use std::cmp::Ordering;

use num_complex::Complex64;

use super::model_error::ModelError;
use super::state_space::StateSpace;
use crate::linalg::eigenvalues;

/// Where `|ln z|` (or its real part) is below this, a pole counts as an integrator (or as undamped): a
/// time constant of 1e9 samples cannot be told from an infinite one, and rounding moves a double
/// integrator by about this much.
const INTEGRATOR_TOLERANCE: f64 = 1e-9;

/// A pole (or a zero) `z` of a sampled system with its continuous-time reading through
/// `s = ln(z) / Ts`, the principal logarithm.
///
/// * An integrator (`z = 1`) has natural frequency 0, and neither damping nor time constant.
/// * On the rest of the unit circle the damping is 0 and there is no time constant.
/// * Outside the unit circle damping and time constant are negative: the time constant is that of the
///   growth.
/// * A real `z < 0` alternates from sample to sample; `Im s` is then the Nyquist frequency, and no
///   continuous first-order system has this pole.
/// * `z = 0` is a pure delay: infinite natural frequency, damping 1, time constant 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pole {
    /// Place in the `z` plane.
    pub value: Complex64,
    /// Natural frequency `|s|` in rad/s.
    pub natural_frequency: f64,
    /// Damping ratio `-Re s / |s|`; `None` for an integrator.
    pub damping: Option<f64>,
    /// Time constant `-1 / Re s` in seconds; `None` on the unit circle.
    pub time_constant: Option<f64>,
}

impl Pole {
    /// The reading of `value` at a sample time in seconds.
    pub fn new(value: Complex64, sample_time: f64) -> Self {
        if value.norm() == 0.0 {
            return Self {
                value,
                natural_frequency: f64::INFINITY,
                damping: Some(1.0),
                time_constant: Some(0.0),
            };
        }
        let log = value.ln();
        if log.norm() <= INTEGRATOR_TOLERANCE {
            return Self {
                value,
                natural_frequency: 0.0,
                damping: None,
                time_constant: None,
            };
        }
        let undamped = log.re.abs() <= INTEGRATOR_TOLERANCE;
        Self {
            value,
            natural_frequency: log.norm() / sample_time,
            damping: Some(if undamped { 0.0 } else { -log.re / log.norm() }),
            time_constant: (!undamped).then(|| -sample_time / log.re),
        }
    }
}

/// Order in which poles and zeros are listed: largest modulus (slowest) first, then from right to left,
/// and of a pair the one in the upper half plane first. Returns indices.
pub(crate) fn slowest_first(values: &[Complex64]) -> Vec<usize> {
    let by = |a: f64, b: f64| {
        // Members of a pair may differ in the last bits.
        if (a - b).abs() <= 1e-12 * (1.0 + a.abs()) {
            Ordering::Equal
        } else {
            b.total_cmp(&a)
        }
    };
    // Insertion sort: the tolerance makes the comparison not transitive, which a library sort may refuse.
    let mut order: Vec<usize> = Vec::with_capacity(values.len());
    for index in 0..values.len() {
        let v = values[index];
        let place = order
            .iter()
            .position(|&other| {
                let o = values[other];
                by(v.norm(), o.norm())
                    .then(by(v.re, o.re))
                    .then(by(v.im, o.im))
                    == Ordering::Less
            })
            .unwrap_or(order.len());
        order.insert(place, index);
    }
    order
}

impl StateSpace {
    /// Eigenvalues of `A` with natural frequency, damping and time constant; slowest first, of a pair
    /// the one in the upper half plane first.
    ///
    /// # Errors
    /// [`ModelError::Linalg`] when the eigenvalues cannot be computed.
    pub fn poles(&self) -> Result<Vec<Pole>, ModelError> {
        let values = eigenvalues(&self.a)?;
        Ok(slowest_first(&values)
            .into_iter()
            .map(|i| Pole::new(values[i], self.sample_time))
            .collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, dmatrix};

    #[test]
    fn oscillator_reads_back_its_parameters() {
        let (w, zeta, sample_time) = (12.0, 0.05, 0.02);
        let s = Complex64::new(-zeta * w, w * (1.0_f64 - zeta * zeta).sqrt());
        let pole = Pole::new((s * sample_time).exp(), sample_time);
        approx::assert_relative_eq!(pole.natural_frequency, w, max_relative = 1e-12);
        approx::assert_relative_eq!(pole.damping.unwrap(), zeta, max_relative = 1e-12);
        approx::assert_relative_eq!(
            pole.time_constant.unwrap(),
            1.0 / (zeta * w),
            max_relative = 1e-12
        );
    }

    #[test]
    fn special_places_are_sane() {
        let integrator = Pole::new(Complex64::new(1.0, 0.0), 0.1);
        assert_eq!(integrator.natural_frequency, 0.0);
        assert_eq!((integrator.damping, integrator.time_constant), (None, None));
        let circle = Pole::new(Complex64::from_polar(1.0, 0.5), 0.1);
        assert_eq!((circle.damping, circle.time_constant), (Some(0.0), None));
        approx::assert_relative_eq!(circle.natural_frequency, 5.0, epsilon = 1e-12);
        let delay = Pole::new(Complex64::default(), 0.1);
        assert_eq!(delay.time_constant, Some(0.0));
        let alternating = Pole::new(Complex64::new(-0.5, 0.0), 1.0);
        assert!(alternating.natural_frequency > std::f64::consts::PI);
        assert!(alternating.damping.unwrap() > 0.0);
        let unstable = Pole::new(Complex64::new(1.1, 0.0), 1.0);
        assert!(unstable.time_constant.unwrap() < 0.0);
    }

    #[test]
    fn listed_slowest_first_pairs_together() {
        let system = StateSpace::deterministic(
            dmatrix![0.5, 0.0, 0.0; 0.0, 0.6, 0.7; 0.0, -0.7, 0.6],
            DMatrix::zeros(3, 1),
            DMatrix::zeros(1, 3),
            dmatrix![0.0],
            1.0,
        )
        .unwrap();
        let poles = system.poles().unwrap();
        assert!(poles[0].value.im > 0.0 && poles[1].value.im < 0.0);
        assert_eq!(poles[2].value, Complex64::new(0.5, 0.0));
    }
}
