//! Windows that the equation of motion is averaged over, and their length.
//!
//! The equation is multiplied with a bump `phi` and summed over its window. Summation by parts moves the derivatives
//! from the recording onto the bump (Shinbrot 1957; Preisig and Rippin 1993), so that nothing is differentiated and no
//! initial state appears. What the bump is multiplied with must be its *exact* first and second difference: the sum of a
//! sampled second derivative is not zero, and what is left multiplies the position, which is many times its changes.

use crate::explain::linear::data::Data;

/// What the output is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Reading {
    /// The position of the moving mass.
    Position,
    /// Its velocity.
    Velocity,
}

/// Half length of the shortest window: below it the sampled bump is a poor one.
const SHORTEST: usize = 10;
/// Fewer windows than this over the recording do not tell laws apart.
const LEAST_WINDOWS: usize = 120;
/// Noise of the sensor may lower a coefficient by this share at most (errors in variables: the regressors of mass and
/// viscous friction hold the sensor's noise).
const ATTENUATION: f64 = 2e-3;
/// The rate may be this uncertain, over its median size, where a law looks at it.
const RATE_NOISE: f64 = 0.02;
/// Standing still: slower than so many standard deviations of the rate's noise, or this share of a quick motion.
/// Dry friction is not a function of the rate there.
const STANDING_DEVIATIONS: f64 = 3.0;
const STANDING_SHARE: f64 = 0.003;
/// A window in which the mass stands still for more than this share says nothing of laws in motion.
const MOST_STANDING: f64 = 0.3;

/// The recording as rows of the averaged equation of motion.
#[derive(Debug, Clone)]
pub(crate) struct Windows {
    pub(crate) reading: Reading,
    /// Half length in samples.
    pub(crate) half: usize,
    /// Segment and middle sample of each row.
    pub(crate) places: Vec<(usize, usize)>,
    /// Averaged input.
    pub(crate) force: Vec<f64>,
    /// Averaged acceleration and rate.
    pub(crate) acceleration: Vec<f64>,
    pub(crate) speed: Vec<f64>,
    /// Position at each sample of each segment, where it is what is read (no law of it is asked about elsewhere), and the
    /// smoothed rate.
    pub(crate) position: Vec<Vec<f64>>,
    pub(crate) rate: Vec<Vec<f64>>,
    /// Input that acted about each sample: held from sample to sample, so the mean of the two values next to it.
    pub(crate) input: Vec<Vec<f64>>,
    /// Size of a quick motion: the 90 % quantile of the rate.
    pub(crate) quick: f64,
    /// Share by which the sensor's noise lowers the coefficients of acceleration and rate, about.
    pub(crate) attenuation: [f64; 2],
    bump: Vec<f64>,
}

/// Weights of a window of half length `half`, with a zero at both ends and beyond: `(1 - s^2)^3`, of sum 1.
fn bump(half: usize) -> Vec<f64> {
    let h = half as f64;
    let raw: Vec<f64> = (0..=2 * half)
        .map(|k| {
            let s = (k as f64 - h) / h;
            (1.0 - s * s).powi(3)
        })
        .collect();
    let sum: f64 = raw.iter().sum();
    raw.iter().map(|v| v / sum).collect()
}

/// What the output is multiplied with for acceleration and rate.
struct Kernels {
    acceleration: Vec<f64>,
    rate: Vec<f64>,
}

impl Kernels {
    fn new(bump: &[f64], step: f64, reading: Reading) -> Self {
        let at = |k: isize| {
            usize::try_from(k)
                .ok()
                .and_then(|k| bump.get(k))
                .copied()
                .unwrap_or(0.0)
        };
        let each = |f: &dyn Fn(isize) -> f64| (0..bump.len() as isize).map(f).collect::<Vec<_>>();
        let first = each(&|k| (at(k - 1) - at(k + 1)) / (2.0 * step));
        match reading {
            Reading::Position => Self {
                acceleration: each(&|k| (at(k + 1) - 2.0 * at(k) + at(k - 1)) / (step * step)),
                rate: first,
            },
            // The rate that goes with the position's central difference: the trapezoidal mean of neighbours.
            Reading::Velocity => Self {
                acceleration: first,
                rate: each(&|k| 0.25 * (at(k - 1) + 2.0 * at(k) + at(k + 1))),
            },
        }
    }
}

fn averaged(kernel: &[f64], values: &[f64], middle: usize) -> f64 {
    let from = middle - kernel.len() / 2;
    kernel
        .iter()
        .zip(&values[from..from + kernel.len()])
        .map(|(w, v)| w * v)
        .sum()
}

/// Standard deviation of the sensor's noise, from third differences: a smooth motion has next to none, white noise
/// has 20 times its variance.
pub(crate) fn sensor_noise(data: &Data) -> f64 {
    let (mut sum, mut n) = (0.0, 0usize);
    for segment in &data.segments {
        for w in segment.outputs[0].windows(4) {
            sum += (w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).powi(2);
            n += 1;
        }
    }
    (sum / 20.0 / n.max(1) as f64).sqrt()
}

/// Smoothed rate, and the position where it is measured.
struct Motion {
    position: Vec<Vec<f64>>,
    rate: Vec<Vec<f64>>,
    noise: f64,
    reach: usize,
}

impl Motion {
    /// The shortest smoothing that leaves little noise in the rate.
    fn new(data: &Data, reading: Reading, noise: f64, longest: usize) -> Self {
        let mut reach = 2;
        loop {
            let motion = Self::smoothed(data, reading, noise, reach);
            let median = quantile(motion.rate.iter().flatten().map(|v| v.abs()), 0.5);
            if motion.noise <= RATE_NOISE * median || reach >= longest {
                return motion;
            }
            reach = (reach + reach / 2).min(longest);
        }
    }

    fn smoothed(data: &Data, reading: Reading, noise: f64, reach: usize) -> Self {
        let step = data.sample_time;
        let r = reach as isize;
        let weights: Vec<f64> = (-r..=r)
            .map(|j| {
                let s = j as f64 / (r + 1) as f64;
                match reading {
                    Reading::Position => s * (1.0 - s * s),
                    Reading::Velocity => (1.0 - s * s).powi(2),
                }
            })
            .collect();
        let scale: f64 = match reading {
            Reading::Position => {
                step * (-r..=r)
                    .zip(&weights)
                    .map(|(j, w)| j as f64 * w)
                    .sum::<f64>()
            }
            Reading::Velocity => weights.iter().sum(),
        };
        let weights: Vec<f64> = weights.iter().map(|w| w / scale).collect();
        let gain = weights.iter().map(|w| w * w).sum::<f64>().sqrt();
        let (mut position, mut rate) = (Vec::new(), Vec::new());
        for segment in &data.segments {
            let y = &segment.outputs[0];
            let n = y.len();
            let mut v: Vec<f64> = (0..n)
                .map(|k| {
                    if k >= reach && k + reach < n {
                        averaged(&weights, y, k)
                    } else {
                        0.0
                    }
                })
                .collect();
            for k in 0..reach.min(n) {
                v[k] = v[reach.min(n - 1)];
                v[n - 1 - k] = v[n.saturating_sub(1 + reach)];
            }
            if reading == Reading::Position {
                position.push(y.clone());
            }
            rate.push(v);
        }
        Self {
            position,
            rate,
            noise: noise * gain,
            reach,
        }
    }
}

/// Quantile of values that need not be sorted.
pub(crate) fn quantile(values: impl Iterator<Item = f64>, q: f64) -> f64 {
    let all: Vec<f64> = values.collect();
    crate::explain::effects::level(&all, q, |v| v)
}

impl Windows {
    /// The shortest windows over which the sensor's noise hardly matters; `None` when there are none short enough.
    pub(crate) fn choose(data: &Data, reading: Reading) -> Option<Self> {
        let noise = sensor_noise(data);
        let mut half = SHORTEST;
        while data.samples() / half >= LEAST_WINDOWS {
            let windows = Self::new(data, reading, noise, half)?;
            if windows.places.len() < LEAST_WINDOWS / 2 {
                return None;
            }
            if windows
                .attenuation
                .iter()
                .all(|share| *share <= ATTENUATION)
            {
                return Some(windows);
            }
            half += half / 2;
        }
        None
    }

    fn new(data: &Data, reading: Reading, noise: f64, half: usize) -> Option<Self> {
        let motion = Motion::new(data, reading, noise, half);
        let weights = bump(half);
        let kernels = Kernels::new(&weights, data.sample_time, reading);
        let quick = quantile(motion.rate.iter().flatten().map(|v| v.abs()), 0.9);
        if !(quick > 0.0 && quick.is_finite()) {
            return None;
        }
        let standing = (STANDING_DEVIATIONS * motion.noise).max(STANDING_SHARE * quick);
        let mut windows = Self {
            reading,
            half,
            places: Vec::new(),
            force: Vec::new(),
            acceleration: Vec::new(),
            speed: Vec::new(),
            input: data
                .segments
                .iter()
                .map(|s| {
                    let u = &s.inputs[0];
                    (0..u.len())
                        .map(|k| 0.5 * (u[k] + u[k.saturating_sub(1)]))
                        .collect()
                })
                .collect(),
            quick,
            attenuation: [0.0; 2],
            bump: weights,
            position: Vec::new(),
            rate: Vec::new(),
        };
        for (s, segment) in data.segments.iter().enumerate() {
            let y = &segment.outputs[0];
            let mut middle = half.max(motion.reach) + 1;
            while middle + half.max(motion.reach) + 1 < y.len() {
                let still: f64 = windows
                    .bump
                    .iter()
                    .zip(&motion.rate[s][middle - half..])
                    .filter(|(_, v)| v.abs() < standing)
                    .map(|(w, _)| w)
                    .sum();
                if still <= MOST_STANDING {
                    windows.places.push((s, middle));
                    windows
                        .force
                        .push(averaged(&windows.bump, &windows.input[s], middle));
                    windows
                        .acceleration
                        .push(averaged(&kernels.acceleration, y, middle));
                    windows.speed.push(averaged(&kernels.rate, y, middle));
                }
                middle += half;
            }
        }
        windows.position = motion.position;
        windows.rate = motion.rate;
        windows.attenuation = windows.attenuation_by(&kernels, noise);
        Some(windows)
    }

    /// A quantity given at each sample, averaged over the windows. Neighbours overlap: what they share is asked for once.
    pub(crate) fn average(&self, of: impl Fn(usize, usize) -> f64) -> Vec<f64> {
        let mut held: Vec<f64> = Vec::with_capacity(self.bump.len());
        let mut held_from = (usize::MAX, 0);
        self.places
            .iter()
            .map(|&(s, middle)| {
                let from = middle - self.half;
                let (segment, first) = held_from;
                if s == segment && (first..first + held.len()).contains(&from) {
                    held.drain(..from - first);
                } else {
                    held.clear();
                }
                held.extend((from + held.len()..from + self.bump.len()).map(|k| of(s, k)));
                held_from = (s, from);
                self.bump.iter().zip(&held).map(|(w, v)| w * v).sum()
            })
            .collect()
    }

    /// The windows that `keep` (segment, middle sample) names.
    pub(crate) fn only(&self, keep: impl Fn(usize, usize) -> bool) -> Self {
        let kept: Vec<usize> = (0..self.places.len())
            .filter(|&i| keep(self.places[i].0, self.places[i].1))
            .collect();
        let of = |v: &[f64]| kept.iter().map(|&i| v[i]).collect::<Vec<_>>();
        Self {
            places: kept.iter().map(|&i| self.places[i]).collect(),
            force: of(&self.force),
            acceleration: of(&self.acceleration),
            speed: of(&self.speed),
            ..self.clone()
        }
    }

    /// By what share the sensor's noise lowers the coefficients of acceleration and rate, at most.
    fn attenuation_by(&self, kernels: &Kernels, noise: f64) -> [f64; 2] {
        let energy = |kernel: &[f64]| noise * noise * kernel.iter().map(|w| w * w).sum::<f64>();
        let n = self.places.len().max(1) as f64;
        let moment = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>() / n;
        let one = vec![1.0; self.places.len()];
        let centred = |v: &[f64]| -> Vec<f64> {
            let mean = moment(v, &one);
            v.iter().map(|x| x - mean).collect()
        };
        let (a, v) = (centred(&self.acceleration), centred(&self.speed));
        let (aa, vv, av) = (moment(&a, &a), moment(&v, &v), moment(&a, &v));
        // What each has that the other does not explain.
        let own = |own: f64, other: f64| own - av * av / other.max(1e-300);
        [
            energy(&kernels.acceleration) / own(aa, vv).max(1e-300),
            energy(&kernels.rate) / own(vv, aa).max(1e-300),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_by_parts_are_exact() {
        // Weighted second differences of any sequence equal the differenced bump's sum, and a parabola's curvature
        // comes out whatever its level.
        let half = 12;
        let weights = bump(half);
        let step = 1e-3;
        let kernels = Kernels::new(&weights, step, Reading::Position);
        let y: Vec<f64> = (0..64)
            .map(|k| {
                let t = k as f64 * step;
                1e5 + 3.0 * t + 0.5 * 7.0 * t * t
            })
            .collect();
        let literal: f64 = (0..weights.len())
            .map(|i| {
                let k = 30 - half + i;
                weights[i] * (y[k + 1] - 2.0 * y[k] + y[k - 1]) / (step * step)
            })
            .sum();
        // Rounding of 1e5 over the squared step limits both.
        let rounding = 1e5 * f64::EPSILON / (step * step);
        assert!((averaged(&kernels.acceleration, &y, 30) - literal).abs() < 10.0 * rounding);
        assert!((literal - 7.0).abs() < 10.0 * rounding);
        let kernels = Kernels::new(&weights, step, Reading::Velocity);
        assert!((averaged(&kernels.rate, &vec![2.5; 64], 30) - 2.5).abs() < 1e-12);
    }

    /// A ramp that the sensor's noise hides, and a recording shorter than the smoothing.
    #[test]
    fn smoothing_is_as_long_as_the_noise_asks_for() {
        let (rate, step) = (0.5, 0.01);
        for (noise, longest) in [(1e-6, 400), (1e-3, 400), (1.0, 50)] {
            let ramp = |n: usize| -> Vec<f64> {
                (0..n)
                    .map(|k| rate * step * k as f64 + noise * ((k * k % 7) as f64 - 2.0) / 2.0)
                    .collect()
            };
            let data = Data {
                segments: [2000, 3]
                    .map(|n| crate::explain::linear::data::Segment {
                        inputs: vec![vec![0.0; n]],
                        outputs: vec![ramp(n)],
                        start_time: 0.0,
                    })
                    .to_vec(),
                sample_time: step,
                inputs: 1,
                outputs: 1,
                constant: false,
            };
            let motion = Motion::new(&data, Reading::Position, noise, longest);
            let quiet = motion.noise <= RATE_NOISE * rate * 1.2;
            assert_eq!(quiet, noise < 1.0, "{noise}: {}", motion.noise);
            assert!(quiet || motion.reach == longest);
            assert_eq!(motion.reach == 2, noise == 1e-6, "{}", motion.reach);
            if quiet {
                let middle = motion.rate[0][1000];
                assert!((middle / rate - 1.0).abs() < 0.1, "{middle}");
                assert_eq!(motion.rate[0][0], motion.rate[0][motion.reach]);
            }
        }
    }
}
