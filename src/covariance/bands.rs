//! Confidence bands of magnitude and phase.

use std::f64::consts::PI;

use nalgebra::DMatrix;
use num_complex::Complex64;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::covariance_error::CovarianceError;
use super::delta_method::{
    Covariance2, Path, longest_axis, path_covariance, pole_uncertainties, projected_variance,
};
use super::draws::ResponseDraws;
use super::parameters::ParameterCovariance;
use super::quantile::{ellipse_quantile, interval_quantile};
use crate::model::StateSpace;

/// Standard deviation of the magnitude, relative to the magnitude, up to which the linearisation is used.
///
/// The second-order term of `log|G|` is about half the square of the relative error: at 0.3 it is 0.045, a
/// seventh of the first-order term. For a complex estimate with equal errors in both parts a nominal 95%
/// band then covers 93.2%, a 99% band 97.3% (at 0.2: 94.7% and 98.1%; computed with 400 000 draws), and it
/// falls quickly beyond; in the studies behind this crate the linearisation fails at relative errors above
/// 0.3 (`pbsid-opt.md` section 5).
pub(crate) const LARGEST_RELATIVE_STD: f64 = 0.3;

/// Distance from a pole to the point `exp(j w Ts)`, in standard deviations of the pole, below which the
/// linearisation is not used there.
///
/// A pole that is nearer to the unit circle than this makes some draws unstable, and the factor
/// `1 / (z - lambda)` has a relative second-order term of the square of one over this distance, 0.1; the
/// ellipse of `G` is then needle-thin while `G` itself is curved in the pole, and covers 50 to 75% instead
/// of 95% (`chiuso-picci.md` section 4). Far from such a pole on the circle the same response is harmless,
/// so the distance is taken point by point.
pub(crate) const SMALLEST_POLE_DISTANCE: f64 = 3.0;

/// Number of parameter draws behind an empirical band. The 97.5% point of 1000 draws has a standard error of
/// 8% of a standard deviation.
pub(crate) const DRAWS: usize = 1000;

/// How a band was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum BandMethod {
    /// First-order propagation of the covariance.
    Linear,
    /// Quantiles over parameter draws.
    Draws,
}

/// A complex response with its confidence bands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ResponseBand {
    /// The response.
    pub response: Complex64,
    /// First-order covariance of (Re, Im).
    pub covariance: Covariance2,
    /// 95% band of the magnitude.
    pub magnitude_95: [f64; 2],
    /// 99% band of the magnitude.
    pub magnitude_99: [f64; 2],
    /// 95% band of the phase in rad, around the principal value (so it may pass `+-pi`); the full circle
    /// when zero is inside the 95% region of the response.
    pub phase_95: [f64; 2],
    /// 99% band of the phase, likewise.
    pub phase_99: [f64; 2],
    /// How the bands were found.
    pub method: BandMethod,
}

/// Bands at each frequency (rad/s), a matrix `l x r` (`l x l` from the innovations) per frequency.
///
/// Linear bands are symmetric on `log|G|`, `|G| exp(+- z sd(|G|) / |G|)`, and on the phase, with normal
/// or Student quantiles by the degrees of freedom of the covariance. Where the linearisation is not to be
/// trusted (`LARGEST_RELATIVE_STD`, `SMALLEST_POLE_DISTANCE`) they are quantiles over `DRAWS` models
/// from `draw_parameters`, and a lower limit is zero where zero lies in the
/// confidence ellipse of `G`: draws around an estimate that noise has moved away from zero do not reach it.
///
/// # Errors
/// [`CovarianceError::Layout`] or [`CovarianceError::Size`] for the covariance of another model,
/// [`CovarianceError::Linalg`] when a factorisation fails.
pub fn response_bands(
    system: &StateSpace,
    covariance: &ParameterCovariance,
    frequencies: &[f64],
    path: Path,
    seed: u64,
) -> Result<Vec<DMatrix<ResponseBand>>, CovarianceError> {
    let nu = covariance.degrees_of_freedom;
    let poles: Vec<(Complex64, f64)> = pole_uncertainties(system, covariance)?
        .iter()
        .filter_map(|p| Some((p.pole.value, longest_axis(&p.covariance?))))
        .collect();
    let mut draws: Option<ResponseDraws> = None;
    let mut bands = Vec::with_capacity(frequencies.len());
    for &w in frequencies {
        let z = system.unit_circle(w);
        let near_pole = poles
            .iter()
            .any(|(pole, sd)| (z - pole).norm() < SMALLEST_POLE_DISTANCE * sd);
        let response = path.response(system, w);
        let spread = path_covariance(system, covariance, w, path)?;
        let mut point = response.zip_map(&spread, |g, c| linear_band(g, &c, nu));
        let doubtful = point.map(|band| near_pole || !trusted(&band));
        if doubtful.iter().any(|&d| d) {
            let draws = match &mut draws {
                Some(draws) => draws,
                empty => empty.insert(ResponseDraws::new(system, covariance, DRAWS, seed)?),
            };
            let drawn = draws.responses(w, path);
            for (index, band) in point.iter_mut().enumerate() {
                if doubtful[index] && band.response.is_finite() {
                    let values: Vec<Complex64> = drawn.iter().map(|g| g[index]).collect();
                    *band = drawn_band(band, &values, nu);
                }
            }
        }
        bands.push(point);
    }
    Ok(bands)
}

fn magnitude_std(g: Complex64, covariance: &Covariance2) -> f64 {
    let size = g.norm();
    projected_variance(covariance, g.re / size, g.im / size).sqrt()
}

/// Whether the linear band may stand, not looking at the poles.
fn trusted(band: &ResponseBand) -> bool {
    let size = band.response.norm();
    // A response without uncertainty may be zero.
    longest_axis(&band.covariance) == 0.0
        || magnitude_std(band.response, &band.covariance) <= LARGEST_RELATIVE_STD * size
}

/// Bands of a response by first-order propagation, `nu` degrees of freedom.
pub(crate) fn linear_band(
    response: Complex64,
    covariance: &Covariance2,
    nu: Option<f64>,
) -> ResponseBand {
    let size = response.norm();
    let phase = response.arg();
    let (on_magnitude, on_phase) = if longest_axis(covariance) == 0.0 {
        (0.0, 0.0)
    } else {
        (
            magnitude_std(response, covariance) / size,
            projected_variance(covariance, -response.im / size, response.re / size).sqrt() / size,
        )
    };
    let magnitude = |level| {
        let factor = (interval_quantile(level, nu) * on_magnitude).exp();
        [size / factor, size * factor]
    };
    let turned = |level| {
        let half = (interval_quantile(level, nu) * on_phase).min(PI);
        [phase - half, phase + half]
    };
    ResponseBand {
        response,
        covariance: *covariance,
        magnitude_95: magnitude(0.95),
        magnitude_99: magnitude(0.99),
        phase_95: turned(0.95),
        phase_99: turned(0.99),
        method: BandMethod::Linear,
    }
}

fn drawn_band(linear: &ResponseBand, values: &[Complex64], nu: Option<f64>) -> ResponseBand {
    let mut sizes: Vec<f64> = values
        .iter()
        .map(|g| g.norm())
        .filter(|v| v.is_finite())
        .collect();
    // Turns from the estimate, so that the cut of the argument is on the far side.
    let mut turns: Vec<f64> = values
        .iter()
        .map(|g| (g / linear.response).arg())
        .filter(|v| v.is_finite())
        .collect();
    sizes.sort_by(f64::total_cmp);
    turns.sort_by(f64::total_cmp);
    let distance = squared_distance_from_zero(linear.response, &linear.covariance);
    let reaches_zero = |level| distance <= ellipse_quantile(level, nu);
    let ends = |level: f64| [(1.0 - level) / 2.0, (1.0 + level) / 2.0];
    let magnitude = |level: f64| {
        let [low, high] = ends(level).map(|p| quantile(&sizes, p));
        [if reaches_zero(level) { 0.0 } else { low }, high]
    };
    let phase = linear.response.arg();
    let turned = |level: f64| match reaches_zero(level) {
        true => [phase - PI, phase + PI],
        false => ends(level).map(|p| phase + quantile(&turns, p)),
    };
    ResponseBand {
        magnitude_95: magnitude(0.95),
        magnitude_99: magnitude(0.99),
        phase_95: turned(0.95),
        phase_99: turned(0.99),
        method: BandMethod::Draws,
        ..*linear
    }
}

/// `g' Cov^-1 g`, infinite when the covariance is singular across `g`.
fn squared_distance_from_zero(g: Complex64, covariance: &Covariance2) -> f64 {
    let longest = longest_axis(covariance).powi(2);
    let angle = 0.5 * (2.0 * covariance[0][1]).atan2(covariance[0][0] - covariance[1][1]);
    let (sin, cos) = angle.sin_cos();
    let along = g.re * cos + g.im * sin;
    let across = g.im * cos - g.re * sin;
    let shortest = (covariance[0][0] + covariance[1][1] - longest).max(0.0);
    let part = |distance: f64, variance: f64| {
        if variance > 1e-14 * longest {
            distance * distance / variance
        } else if distance.abs() <= 1e-7 * g.norm() {
            0.0
        } else {
            f64::INFINITY
        }
    };
    part(along, longest) + part(across, shortest)
}

/// Linear interpolation between order statistics (Hyndman & Fan type 7); NaN without values.
fn quantile(sorted: &[f64], p: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else {
        return f64::NAN;
    };
    let place = p * last as f64;
    let below = (place.floor() as usize).min(last);
    let above = (below + 1).min(last);
    sorted[below] + (place - below as f64) * (sorted[above] - sorted[below])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::covariance::draws::draw_parameters;
    use crate::covariance::test_covariances;

    #[test]
    fn linear_bands_cover_what_draws_give() {
        let (system, covariance) = test_covariances::two_by_three(true);
        let w = [0.3, 1.5, 4.0];
        for path in [Path::Input, Path::Innovation] {
            let bands = response_bands(&system, &covariance, &w, path, 1).unwrap();
            let drawn = draw_parameters(&system, &covariance, 3000, 11).unwrap();
            for (band, &w) in bands.iter().zip(&w) {
                let responses: Vec<_> = drawn.iter().map(|s| path.response(s, w)).collect();
                for (index, b) in band.iter().enumerate() {
                    assert_eq!(b.method, BandMethod::Linear);
                    let share = |inside: &dyn Fn(Complex64) -> bool| {
                        responses.iter().filter(|g| inside(g[index])).count() as f64 / 3000.0
                    };
                    let within = |[low, high]: [f64; 2], v: f64| low <= v && v <= high;
                    let m95 = share(&|g| within(b.magnitude_95, g.norm()));
                    let m99 = share(&|g| within(b.magnitude_99, g.norm()));
                    let phase = |g: Complex64| b.response.arg() + (g / b.response).arg();
                    let p95 = share(&|g| within(b.phase_95, phase(g)));
                    let p99 = share(&|g| within(b.phase_99, phase(g)));
                    // Standard errors 0.004 and 0.002.
                    assert!((m95 - 0.95).abs() < 0.018, "{m95}");
                    assert!((m99 - 0.99).abs() < 0.009, "{m99}");
                    assert!((p95 - 0.95).abs() < 0.018, "{p95}");
                    assert!((p99 - 0.99).abs() < 0.009, "{p99}");
                }
            }
        }
    }

    #[test]
    fn both_methods_agree_where_the_linearisation_holds() {
        let (system, covariance) = test_covariances::oscillator();
        let w = 8.0;
        let linear = response_bands(&system, &covariance, &[w], Path::Input, 1).unwrap()[0][0];
        let draws = ResponseDraws::new(&system, &covariance, 4000, 5).unwrap();
        let values: Vec<_> = draws
            .responses(w, Path::Input)
            .iter()
            .map(|g| g[0])
            .collect();
        let drawn = drawn_band(&linear, &values, None);
        let width = linear.magnitude_95[1] - linear.magnitude_95[0];
        for k in 0..2 {
            assert!((linear.magnitude_95[k] - drawn.magnitude_95[k]).abs() < 0.05 * width);
            let turn = linear.phase_95[1] - linear.phase_95[0];
            assert!((linear.phase_95[k] - drawn.phase_95[k]).abs() < 0.05 * turn);
        }
    }

    #[test]
    fn a_pole_near_the_circle_and_a_response_near_zero_use_draws() {
        let (mut system, covariance) = test_covariances::oscillator();
        // A pole on the unit circle at 0.4 rad, known to about 1e-3.
        let (sin, cos) = 0.4_f64.sin_cos();
        system.a = nalgebra::dmatrix![cos, sin; -sin, cos] * 0.9995;
        let on = 0.4 / system.sample_time;
        let found = response_bands(&system, &covariance, &[on, 30.0], Path::Input, 1).unwrap();
        assert_eq!(found[0][0].method, BandMethod::Draws);
        assert_eq!(found[1][0].method, BandMethod::Linear);
        assert!(found[0][0].magnitude_95[1] > found[0][0].magnitude_95[0]);

        let (mut weak, covariance) = test_covariances::oscillator();
        weak.b *= 1e-9;
        let band = response_bands(&weak, &covariance, &[3.0], Path::Input, 1).unwrap()[0][0];
        assert_eq!(band.method, BandMethod::Draws);
        assert_eq!(band.magnitude_95[0], 0.0);
        assert!((band.phase_95[1] - band.phase_95[0] - 2.0 * PI).abs() < 1e-12);
    }

    #[test]
    fn bands_are_the_same_for_the_same_seed() {
        let (mut system, covariance) = test_covariances::oscillator();
        system.b *= 1e-9;
        let run = |seed| response_bands(&system, &covariance, &[1.0], Path::Input, seed).unwrap();
        assert_eq!(run(3), run(3));
        assert_ne!(run(3), run(4));
    }

    #[test]
    fn few_degrees_of_freedom_widen_the_band() {
        let (system, mut covariance) = test_covariances::oscillator();
        let width = |c: &ParameterCovariance| {
            let b = response_bands(&system, c, &[8.0], Path::Input, 1).unwrap()[0][0];
            (b.magnitude_95[1] / b.magnitude_95[0]).ln()
        };
        let normal = width(&covariance);
        covariance.degrees_of_freedom = Some(19.0);
        assert!((width(&covariance) / normal - 2.093_024 / 1.959_964).abs() < 1e-6);
    }

    #[test]
    fn distance_from_zero_is_that_of_the_inverse() {
        let covariance = [[2.0, 0.7], [0.7, 1.0]];
        let g = Complex64::new(1.0, -2.0);
        let inverse = nalgebra::matrix![2.0, 0.7; 0.7, 1.0].try_inverse().unwrap();
        let v = nalgebra::vector![1.0, -2.0];
        let expected = v.dot(&(inverse * v));
        assert!((squared_distance_from_zero(g, &covariance) - expected).abs() < 1e-12);
        let real = [[4.0, 0.0], [0.0, 0.0]];
        assert_eq!(
            squared_distance_from_zero(Complex64::new(2.0, 0.0), &real),
            1.0
        );
        assert_eq!(
            squared_distance_from_zero(Complex64::new(2.0, 0.1), &real),
            f64::INFINITY
        );
    }
}
