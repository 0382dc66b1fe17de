//! Clocks that run at different rates: a lag between recording and simulation that grows in proportion to time.

use crate::log::Log;

/// Rates that are looked for, on either side of equal clocks.
const WIDEST: f64 = 0.05;
/// Rates that are tried, at most.
const MOST_RATES: f64 = 1200.0;
/// Samples that a rate is judged by, about.
const LOOKED_AT: usize = 1500;
/// Share of the recording that must be left.
const LEFT: f64 = 0.9;
/// With the rate, recording and simulation must differ by less than this share (mean square) of what any constant lag
/// leaves.
const BETTER: f64 = 0.5;
/// The rates of both halves agree to this share.
const ALIKE: f64 = 0.25;
/// Lag at the end of the recording, in samples, below which nothing is said.
const LEAST_LAG: f64 = 1.0;

/// What reads the same on the other clock: `recording[k] = simulation[k (1 + rate) + shift]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Drift {
    pub(crate) rate: f64,
    pub(crate) shift: f64,
}

impl Drift {
    fn at(&self, k: f64) -> f64 {
        k * (1.0 + self.rate) + self.shift
    }

    /// The place on the recording's clock of sample `p` of the simulation.
    fn back(&self) -> Self {
        Self {
            rate: 1.0 / (1.0 + self.rate) - 1.0,
            shift: -self.shift / (1.0 + self.rate),
        }
    }
}

/// One output: recorded and simulated, both about their means.
struct Channel {
    recorded: Vec<f64>,
    simulated: Vec<f64>,
    variance: f64,
}

impl Channel {
    fn new(y: &[f64], s: &[f64]) -> Self {
        let centred = |v: &[f64]| -> Vec<f64> {
            let mean = v.iter().sum::<f64>() / v.len().max(1) as f64;
            v.iter().map(|x| x - mean).collect()
        };
        let recorded = centred(y);
        let variance = recorded.iter().map(|v| v * v).sum::<f64>() / y.len().max(1) as f64;
        Self {
            recorded,
            simulated: centred(s),
            variance,
        }
    }

    /// Samples in which it moves by its own size.
    fn slowness(&self) -> f64 {
        let square = |v: f64| v * v;
        let s = &self.simulated;
        let size: f64 = s.iter().map(|v| v * v).sum();
        let steps: f64 = s.windows(2).map(|p| square(p[1] - p[0])).sum();
        (size / steps.max(1e-300)).sqrt()
    }
}

fn linear(s: &[f64], at: f64) -> Option<f64> {
    let k = at.floor();
    if k < 0.0 || at > (s.len() - 1) as f64 {
        return None;
    }
    let (k, share) = (k as usize, at - k);
    let next = s[(k + 1).min(s.len() - 1)];
    Some(s[k] + share * (next - s[k]))
}

/// Mean square difference over the variance of the recording, where both are there.
fn misfit(channels: &[Channel], drift: Drift, stride: usize) -> f64 {
    let mut total = 0.0;
    for c in channels {
        let (mut sum, mut square, mut count) = (0.0, 0.0, 0usize);
        for k in (0..c.recorded.len()).step_by(stride) {
            if let Some(s) = linear(&c.simulated, drift.at(k as f64)) {
                let e = c.recorded[k] - s;
                sum += e;
                square += e * e;
                count += 1;
            }
        }
        let n = count as f64;
        if n * (stride as f64) < LEFT * c.recorded.len() as f64 {
            return f64::INFINITY;
        }
        total += (square / n - (sum / n).powi(2)) / c.variance.max(1e-300);
    }
    total / channels.len() as f64
}

/// Gauss and Newton's steps in rate and shift over the samples `from..to`.
fn refined(channels: &[Channel], mut drift: Drift, from: usize, to: usize) -> Drift {
    let centre = 0.5 * (from + to) as f64;
    for _ in 0..6 {
        let (mut a, mut b) = ([[0.0; 3]; 3], [0.0; 3]);
        for c in channels {
            let weight = 1.0 / c.variance.max(1e-300);
            for k in from..to {
                let at = drift.at(k as f64);
                let (Some(s), Some(ahead), Some(behind)) = (
                    linear(&c.simulated, at),
                    linear(&c.simulated, at + 0.5),
                    linear(&c.simulated, at - 0.5),
                ) else {
                    continue;
                };
                let slope = ahead - behind;
                let row = [slope * (k as f64 - centre), slope, c.variance.sqrt()];
                let e = c.recorded[k] - s;
                for i in 0..3 {
                    for j in 0..3 {
                        a[i][j] += weight * row[i] * row[j];
                    }
                    b[i] += weight * row[i] * e;
                }
            }
        }
        let a = nalgebra::Matrix3::from_fn(|i, j| a[i][j]);
        let Some(step) = a.lu().solve(&nalgebra::Vector3::from(b)) else {
            return drift;
        };
        drift.rate += step[0];
        drift.shift += step[1] - step[0] * centre;
        if !drift.rate.is_finite() || drift.rate.abs() > 2.0 * WIDEST {
            return Drift {
                rate: f64::NAN,
                shift: 0.0,
            };
        }
    }
    drift
}

/// The drift between the clocks of recorded and simulated outputs, if their lag grows in proportion to time.
pub(crate) fn drift(outputs: &[(&[f64], &[f64])]) -> Option<Drift> {
    let channels: Vec<Channel> = outputs.iter().map(|(y, s)| Channel::new(y, s)).collect();
    let n = outputs.first()?.0.len();
    let none = Drift {
        rate: 0.0,
        shift: 0.0,
    };
    let stride = n.div_ceil(LOOKED_AT).max(1);
    let given = misfit(&channels, none, stride);
    // Over the recording the lag may change by half the time in which the outputs move, from one rate to the next.
    let slowness = channels
        .iter()
        .map(Channel::slowness)
        .fold(f64::INFINITY, f64::min);
    let spacing = (0.5 * slowness / n as f64).max(2.0 * WIDEST / MOST_RATES);
    let most = (WIDEST / spacing).ceil() as i64;
    let mut best = (given, none);
    for i in -most..=most {
        let drift = Drift {
            rate: i as f64 * spacing,
            shift: 0.0,
        };
        let found = misfit(&channels, drift, stride);
        if found < best.0 {
            best = (found, drift);
        }
    }
    if best.0 > BETTER * given || best.1.rate == 0.0 {
        return None;
    }
    let found = refined(&channels, best.1, 0, n);
    let reached = misfit(&channels, found, 1);
    if !reached.is_finite() || found.rate.abs() * (n as f64) < LEAST_LAG {
        return None;
    }
    // No constant lag does as well.
    let reach = (2.0 * found.rate.abs() * n as f64 + slowness).ceil() as i64;
    let every = (reach / 200).max(1) as usize;
    let constant = (-reach..=reach)
        .step_by(every)
        .map(|shift| {
            let shift = Drift {
                rate: 0.0,
                shift: shift as f64,
            };
            misfit(&channels, shift, stride)
        })
        .fold(f64::INFINITY, f64::min);
    if reached > BETTER * constant {
        return None;
    }
    // It grows in both halves alike.
    let halves = [
        refined(&channels, found, 0, n / 2),
        refined(&channels, found, n / 2, n),
    ];
    halves
        .iter()
        .all(|h| (h.rate - found.rate).abs() < ALIKE * found.rate.abs())
        .then_some(found)
}

/// Value between samples, by the cubic through the four around.
fn between(v: &[f64], at: f64) -> f64 {
    let last = v.len() - 1;
    let k = (at.floor().max(0.0) as usize).min(last);
    let t = at - k as f64;
    let value = |i: i64| v[(k as i64 + i).clamp(0, last as i64) as usize];
    let (a, b, c, d) = (value(-1), value(0), value(1), value(2));
    b + 0.5 * t * (c - a + t * (2.0 * a - 5.0 * b + 4.0 * c - d + t * (3.0 * (b - c) + d - a)))
}

/// The columns `moved` of as many samples as `log` read on its clock, and `log` cut to the samples that are left:
/// `result[k] = moved[k (1 + rate) + shift]`.
fn on_the_clock_of(log: &Log, moved: &[Vec<f64>], drift: Drift) -> (Log, Vec<Vec<f64>>) {
    let n = log.samples();
    let inside = |k: &usize| {
        let at = drift.at(*k as f64);
        at >= 0.0 && at <= (n - 1) as f64
    };
    let from = (0..n).find(inside).unwrap_or(0);
    let to = (0..n).rfind(inside).map_or(n, |k| k + 1);
    let mut cut = log.clone();
    for column in cut.input_data.iter_mut().chain(&mut cut.output_data) {
        *column = column[from..to].to_vec();
    }
    cut.start_time += from as f64 * log.sample_time;
    let read = moved
        .iter()
        .map(|v| (from..to).map(|k| between(v, drift.at(k as f64))).collect())
        .collect();
    (cut, read)
}

/// Recording and simulated outputs with the simulation read on the recording's clock.
pub(crate) fn simulation_corrected(
    log: &Log,
    simulated: &[Vec<f64>],
    drift: Drift,
) -> (Log, Vec<Vec<f64>>) {
    on_the_clock_of(log, simulated, drift)
}

/// Recording and simulated outputs with the recorded outputs read on the simulation's clock, which is that of the inputs.
pub(crate) fn recording_corrected(
    log: &Log,
    simulated: &[Vec<f64>],
    drift: Drift,
) -> (Log, Vec<Vec<f64>>) {
    let (mut cut, outputs) = on_the_clock_of(log, &log.output_data, drift.back());
    let skipped = ((cut.start_time - log.start_time) / log.sample_time).round() as usize;
    let kept = cut.samples();
    cut.output_data = outputs;
    let simulated = simulated
        .iter()
        .map(|s| s[skipped..skipped + kept].to_vec())
        .collect();
    (cut, simulated)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn signal(t: f64) -> f64 {
        (0.11 * t).sin() + 0.6 * (0.237 * t + 1.0).sin() + 0.3 * (0.041 * t).cos()
    }

    #[test]
    fn the_rate_of_a_clock_is_found() {
        for rate in [0.01, -0.01, 0.003, -0.02] {
            let y: Vec<f64> = (0..2000)
                .map(|k| 1.03 * signal(f64::from(k)) + 0.1 * (2.1 * f64::from(k)).sin())
                .collect();
            let s: Vec<f64> = (0..2000)
                .map(|k| signal(f64::from(k) * (1.0 - rate)))
                .collect();
            let found = drift(&[(&y, &s)]).expect("a drift");
            let expected = 1.0 / (1.0 - rate) - 1.0;
            assert!(
                (found.rate - expected).abs() < 2e-5,
                "{} {expected}",
                found.rate
            );
            let back = found.back();
            assert!((back.at(found.at(700.0)) - 700.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_constant_lag_is_no_drift() {
        for lag in [0.0, 1.0, 7.0, -20.0] {
            let y: Vec<f64> = (0..2000)
                .map(|k| 0.8 * signal(f64::from(k) - lag))
                .collect();
            let s: Vec<f64> = (0..2000).map(|k| signal(f64::from(k))).collect();
            assert_eq!(drift(&[(&y, &s)]), None);
        }
    }
}
