//! How far a parameter is moved for a difference.
//!
//! A central difference over `h` errs by about `e/h` for values that are known to `e`, and by about `h^2` for the curvature of
//! what is differentiated. What `e` is depends on the simulator: how many digits it prints, and how its solver chooses steps.
//! Both are measured: the digits from the numbers themselves, the solver by differences of high order over steps that are so
//! small that a smooth function is a straight line there (J. J. Moré and S. M. Wild, *Estimating computational noise*, SIAM
//! J. Sci. Comput. 33, 2011).

use super::cache::Answer;

/// Steps of a run for measuring the noise, as a part of the parameters' magnitudes.
pub(super) const PROBE: f64 = 1e-5;
/// Runs for it, beside the one it starts from.
pub(super) const PROBES: usize = 4;
/// `(4!)^2 / 8!`: variance of a value by the mean square of its fourth differences.
const FOURTH: f64 = 1.0 / 70.0;
/// Error of a number that is rounded, as a part of its last place.
const ROUNDING: f64 = 0.29;
/// A number with more digits is not rounded for printing.
const FULL_PRECISION: usize = 13;
/// Values whose digits are counted.
const COUNTED: usize = 2000;
/// Error of values in full precision, which a solver sums up from many roundings.
const SUMMED_ROUNDING: f64 = 1e-14;
/// Smallest and largest step, as a part of the parameter's magnitude.
const SMALLEST: f64 = 1e-8;
const LARGEST: f64 = 0.1;
/// Relative error of a derivative that needs no better step: standard deviations are not known better.
const TOLERANCE: f64 = 0.01;
/// The largest changes of a step at a time.
const CHANGE: (f64, f64) = (0.05, 10.0);
/// A change of the step by less is not worth other runs.
const SAME: f64 = 0.3;
/// Differences whose mean square is within this of what noise makes of them are noise.
const ONLY_NOISE: f64 = 1.5;

/// What is known of the steps of a simulator.
#[derive(Debug, Default)]
pub(super) struct Steps {
    /// Error and spread of each output.
    pub(super) noise: Option<Vec<OutputNoise>>,
    /// Step of each parameter as a part of its magnitude.
    pub(super) relative: Vec<Option<f64>>,
}

impl Steps {
    /// Keeps the step of a parameter.
    pub(crate) fn remember(&mut self, parameter: usize, relative: f64) {
        if self.relative.len() <= parameter {
            self.relative.resize(parameter + 1, None);
        }
        self.relative[parameter] = Some(relative);
    }
}

/// How exact an output is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct OutputNoise {
    /// Standard deviation of a value's error.
    pub(super) error: f64,
    /// Standard deviation of the values about their mean.
    pub(super) spread: f64,
}

/// Noise of the outputs from one run and, where they succeeded, from those of parameters moved by equal steps.
pub(super) fn noise(base: &[Vec<f64>], probes: &[Answer]) -> Vec<OutputNoise> {
    let probes: Option<Vec<_>> = probes.iter().map(|p| p.as_ref().ok()).collect();
    (0..base.len())
        .map(|o| {
            let y = &base[o];
            let n = y.len().max(1) as f64;
            let fourth = probes
                .as_ref()
                .filter(|p| p.len() == PROBES)
                .map_or(0.0, |p| {
                    let square: f64 = (0..y.len())
                        .map(|k| {
                            y[k] - 4.0 * p[0][o][k] + 6.0 * p[1][o][k] - 4.0 * p[2][o][k]
                                + p[3][o][k]
                        })
                        .map(|d| d * d)
                        .sum();
                    (FOURTH * square / n).sqrt()
                });
            let mean = y.iter().sum::<f64>() / n;
            let largest = y.iter().fold(0.0f64, |m, v| m.max(v.abs()));
            let spread = (y.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
            OutputNoise {
                error: fourth
                    .max(ROUNDING * last_place(y))
                    .max(SUMMED_ROUNDING * largest),
                spread: if spread > 0.0 {
                    spread
                } else {
                    largest.max(f64::MIN_POSITIVE)
                },
            }
        })
        .collect()
}

/// The last place to which values are written, by their median; 0 for values in full precision.
fn last_place(values: &[f64]) -> f64 {
    let stride = values.len().div_ceil(COUNTED).max(1);
    let mut places: Vec<f64> = values
        .iter()
        .step_by(stride)
        .filter(|v| **v != 0.0 && v.is_finite())
        .map(|v| {
            let text = format!("{v:e}");
            let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
            let digits = mantissa.split_once('.').map_or(0, |(_, d)| d.len());
            if digits >= FULL_PRECISION {
                return 0.0;
            }
            10f64.powi(exponent.parse::<i32>().unwrap_or(0) - digits as i32)
        })
        .collect();
    if places.is_empty() {
        return 0.0;
    }
    places.sort_by(f64::total_cmp);
    places[places.len() / 2]
}

/// Magnitude of a parameter: its value where its bounds do not say that it matters on another scale.
pub(super) fn magnitude(value: f64, start: f64, min: f64, max: f64) -> f64 {
    let width = max - min;
    let own = value.abs().max(start.abs());
    if width.is_finite() && width > 0.0 {
        return own.max(1e-3 * width).min(width);
    }
    if own > 0.0 { own } else { 1.0 }
}

/// The step to begin with, as a part of the magnitude: the best where the third derivative is of the size of the output.
pub(super) fn first(noise: &[OutputNoise]) -> f64 {
    let relative = noise
        .iter()
        .map(|n| n.error / n.spread)
        .fold(f64::INFINITY, f64::min);
    (3.0 * relative).cbrt().clamp(1e-5, 0.3 * LARGEST)
}

/// Mean squares of differences over all values, each output in units of its spread.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Change {
    /// Of the outputs at both ends.
    pub(super) first: f64,
    /// Of the sum of both ends less twice the middle; none for a difference to one side.
    pub(super) second: Option<f64>,
    /// Expected of `first` from noise alone.
    pub(super) noise: f64,
}

/// What is to be done with a difference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Next {
    /// It is good, or as good as it gets.
    Take,
    /// The parameter has no influence that could be seen.
    Nothing,
    /// It is better with this step.
    Again(f64),
}

/// Judges a difference over `relative`.
pub(super) fn judge(change: Change, relative: f64) -> Next {
    if change.first <= ONLY_NOISE * change.noise {
        return if relative < LARGEST {
            Next::Again((relative * CHANGE.1).min(LARGEST))
        } else {
            Next::Nothing
        };
    }
    let of_noise = (change.noise / change.first).sqrt();
    // With ratio r of second and first difference the next term of the series is about (2 r)^2 / 6 of the first.
    let second = change
        .second
        .map_or(0.0, |s| (s - 3.0 * change.noise).max(0.0));
    let of_curvature = 2.0 / 3.0 * second / change.first;
    if of_noise.hypot(of_curvature) <= TOLERANCE {
        return Next::Take;
    }
    let factor = (0.5 * of_noise / of_curvature.max(1e-9))
        .cbrt()
        .clamp(CHANGE.0, CHANGE.1);
    let better = (relative * factor).clamp(SMALLEST, LARGEST);
    if (better / relative - 1.0).abs() < SAME {
        Next::Take
    } else {
        Next::Again(better)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    fn rounded(v: f64, places: i32) -> f64 {
        let scale = 10f64.powi(places);
        (v * scale).round() / scale
    }

    #[test]
    fn digits_of_printed_numbers_are_counted() {
        let exact: Vec<f64> = (0..500).map(|k| (0.37 * f64::from(k)).sin()).collect();
        assert_eq!(last_place(&exact), 0.0);
        let printed: Vec<f64> = exact.iter().map(|&v| rounded(v, 6)).collect();
        assert!((last_place(&printed) / 1e-6 - 1.0).abs() < 1e-9);
        assert_eq!(last_place(&[0.0, 0.0]), 0.0);
    }

    #[test]
    fn noise_of_a_solver_is_measured() {
        // A smooth function of the parameter with errors that jump: here of a fixed pseudorandom pattern.
        let jump = |k: usize, i: usize| {
            1e-4 * ((12.9898 * (k * 7 + i * 131) as f64).sin() * 43758.5).fract()
        };
        let run = |i: usize| -> Vec<f64> {
            let p = 1.0 + PROBE * i as f64;
            (0..1000)
                .map(|k| (0.1 * p * k as f64).sin() + jump(k, i))
                .collect()
        };
        let probes: Vec<Answer> = (1..=PROBES).map(|i| Ok(Arc::new(vec![run(i)]))).collect();
        let found = noise(&[run(0)], &probes)[0];
        let true_error = 1e-4 / 3f64.sqrt();
        assert!((found.error / true_error - 1.0).abs() < 0.3, "{found:?}");
        let smooth: Vec<Answer> = (1..=PROBES)
            .map(|i| {
                let y = run(i)
                    .iter()
                    .enumerate()
                    .map(|(k, v)| v - jump(k, i))
                    .collect();
                Ok(Arc::new(vec![y]))
            })
            .collect();
        let base: Vec<f64> = run(0)
            .iter()
            .enumerate()
            .map(|(k, v)| v - jump(k, 0))
            .collect();
        assert!(noise(&[base], &smooth)[0].error < 1e-9);
    }

    #[test]
    fn steps_grow_out_of_noise_and_shrink_out_of_curvature() {
        let change = |first: f64, second: f64, noise: f64| Change {
            first,
            second: Some(second),
            noise,
        };
        assert_eq!(judge(change(1e-4, 1e-9, 1e-12), 1e-2), Next::Take);
        assert!(matches!(judge(change(1e-10, 1e-12, 1e-12), 1e-3), Next::Again(h) if h > 1e-3));
        assert!(matches!(judge(change(1e-2, 1e-2, 1e-12), 1e-2), Next::Again(h) if h < 1e-2));
        assert_eq!(judge(change(1e-12, 3e-12, 1e-12), LARGEST), Next::Nothing);
        assert_eq!(judge(change(0.0, 0.0, 0.0), LARGEST), Next::Nothing);
    }
}
