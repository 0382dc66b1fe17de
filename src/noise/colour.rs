//! The colour of one output's noise: a whitening filter that is exact from the first sample of every stretch.
//!
//! `v[k] + a1 v[k-1] + ... = e[k] + c1 e[k-1] + ...`, stationary. Slow noise beside white noise, which every process
//! has, is of order (1, 1); an autoregression would need dozens of coefficients for it. What stands before a stretch is
//! not known, so its first values are whitened by the best predictor from the few values there are (Levinson's
//! predictors of lower order; Kalman's filter from the stationary covariance). Started from zero instead, the first
//! value of slow noise would count as many standard deviations.

use nalgebra::{SMatrix, SVector};

/// Largest autoregressive order.
pub(crate) const MOST_ORDER: usize = 30;
/// Largest order of a mixed model.
pub(super) const MOST_MIXED: usize = 3;
/// The filter has settled when its gain and variance differ from the steady ones by less.
const SETTLED: f64 = 1e-7;
/// Steps of the filter's start that are kept, at most.
const MOST_STEPS: usize = 2000;
/// Values that are filtered together: a register of sums each, so that the loop over lags is one of vectors.
const TOGETHER: usize = 8;

/// A whitening filter.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Colour {
    /// `a1, a2, ...`
    pub(crate) ar: Vec<f64>,
    /// `c1, c2, ...`
    pub(crate) ma: Vec<f64>,
    /// The first values of a stretch: without moving average, coefficients of the values before each, newest first ...
    predictors: Vec<Start<Vec<f64>>>,
    /// ... with one, Kalman's gain.
    gains: Vec<Start<[f64; MOST_MIXED]>>,
}

/// How one of the first values of a stretch is whitened.
#[derive(Debug, Clone, PartialEq)]
struct Start<Gain> {
    gain: Gain,
    /// One over the standard deviation of its prediction error, in standard deviations of `e`.
    scale: f64,
}

impl Colour {
    /// `None` where the model is not stationary or not invertible.
    pub(crate) fn new(ar: Vec<f64>, ma: Vec<f64>) -> Option<Self> {
        let reflections = reflections(&ar)?;
        let (predictors, gains) = if ma.is_empty() {
            (lower_orders(&ar, &reflections), Vec::new())
        } else {
            self::reflections(&ma)?;
            let gains = match ar.len().max(ma.len()) {
                1 => kalman::<1>(&ar, &ma),
                2 => kalman::<2>(&ar, &ma),
                3 => kalman::<3>(&ar, &ma),
                _ => None,
            };
            (Vec::new(), gains?)
        };
        Some(Self {
            ar,
            ma,
            predictors,
            gains,
        })
    }

    pub(crate) fn len(&self) -> usize {
        self.ar.len() + self.ma.len()
    }

    /// `log det` of the covariance of the first `samples` values, in units of the variance of `e`.
    pub(crate) fn log_determinant(&self, samples: usize) -> f64 {
        let predictors = self.predictors.iter().map(|s| s.scale);
        predictors
            .chain(self.gains.iter().map(|s| s.scale))
            .take(samples)
            .map(|scale| -2.0 * scale.ln())
            .sum()
    }

    /// Whitens one stretch, times `gain`, behind what `out` holds.
    pub(crate) fn whiten(&self, v: &[f64], gain: f64, out: &mut Vec<f64>) {
        if self.ma.is_empty() {
            self.whiten_autoregression(v, gain, out);
            return;
        }
        match self.ar.len().max(self.ma.len()) {
            1 => self.whiten_mixed::<1>(v, gain, out),
            2 => self.whiten_mixed::<2>(v, gain, out),
            _ => self.whiten_mixed::<MOST_MIXED>(v, gain, out),
        }
    }

    fn whiten_autoregression(&self, v: &[f64], gain: f64, out: &mut Vec<f64>) {
        let p = self.ar.len();
        for (k, start) in self.predictors.iter().enumerate().take(v.len()) {
            let past: f64 = start
                .gain
                .iter()
                .zip(v[..k].iter().rev())
                .map(|(a, v)| a * v)
                .sum();
            out.push(gain * start.scale * (v[k] + past));
        }
        let mut at = p.min(v.len());
        while at + TOGETHER <= v.len() {
            let mut sums = [0.0; TOGETHER];
            sums.copy_from_slice(&v[at..at + TOGETHER]);
            for (i, a) in self.ar.iter().enumerate() {
                let past: &[f64; TOGETHER] = match v[at - 1 - i..].first_chunk() {
                    Some(past) => past,
                    None => continue,
                };
                for (sum, past) in sums.iter_mut().zip(past) {
                    *sum += a * past;
                }
            }
            out.extend(sums.map(|s| gain * s));
            at += TOGETHER;
        }
        for k in at..v.len() {
            let past: f64 = self
                .ar
                .iter()
                .zip(v[..k].iter().rev())
                .map(|(a, v)| a * v)
                .sum();
            out.push(gain * (v[k] + past));
        }
    }

    fn whiten_mixed<const N: usize>(&self, v: &[f64], gain: f64, out: &mut Vec<f64>) {
        let (mut a, mut c) = ([0.0; N], [0.0; N]);
        a[..self.ar.len()].copy_from_slice(&self.ar);
        c[..self.ma.len()].copy_from_slice(&self.ma);
        // Observer form: `v = x1 + e`, `xi+ = x(i+1) - ai v + ci e`.
        let mut x = [0.0; N];
        for (v, start) in v.iter().zip(&self.gains) {
            let e = v - x[0];
            let predicted = x[0];
            for i in 0..N {
                let next = if i + 1 < N { x[i + 1] } else { 0.0 };
                x[i] = next - a[i] * predicted + start.gain[i] * e;
            }
            out.push(gain * start.scale * e);
        }
        for v in v.iter().skip(self.gains.len()) {
            let e = v - x[0];
            for i in 0..N {
                let next = if i + 1 < N { x[i + 1] } else { 0.0 };
                x[i] = next - a[i] * v + c[i] * e;
            }
            out.push(gain * e);
        }
    }
}

/// Reflection coefficients of a polynomial (Levinson's recursion backwards); `None` where a root is not inside the circle.
pub(super) fn reflections(polynomial: &[f64]) -> Option<Vec<f64>> {
    let mut a = polynomial.to_vec();
    let mut found = Vec::with_capacity(a.len());
    while let Some(k) = a.pop() {
        if k.is_nan() || k.abs() >= 1.0 {
            return None;
        }
        let rest = 1.0 - k * k;
        a = (0..a.len())
            .map(|i| (a[i] - k * a[a.len() - 1 - i]) / rest)
            .collect();
        found.push(k);
    }
    found.reverse();
    Some(found)
}

/// Predictors of the orders below that of `ar`.
fn lower_orders(ar: &[f64], reflections: &[f64]) -> Vec<Start<Vec<f64>>> {
    let mut steps = Vec::with_capacity(ar.len());
    let mut a: Vec<f64> = Vec::new();
    // Variance over that of `e`: the product of `1/(1 - k^2)` over what is still to come.
    let mut variance: f64 = reflections.iter().map(|k| 1.0 / (1.0 - k * k)).product();
    for k in reflections {
        steps.push(Start {
            gain: a.clone(),
            scale: variance.sqrt().recip(),
        });
        let before = a.clone();
        for (i, a) in a.iter_mut().enumerate() {
            *a += k * before[before.len() - 1 - i];
        }
        a.push(*k);
        variance *= 1.0 - k * k;
    }
    steps
}

/// Kalman's filter from the stationary covariance until it has settled.
fn kalman<const N: usize>(ar: &[f64], ma: &[f64]) -> Option<Vec<Start<[f64; MOST_MIXED]>>> {
    let at = |list: &[f64], i: usize| list.get(i).copied().unwrap_or(0.0);
    let a = SMatrix::<f64, N, N>::from_fn(|i, j| {
        (if j == 0 { -at(ar, i) } else { 0.0 }) + if j == i + 1 { 1.0 } else { 0.0 }
    });
    let b = SVector::<f64, N>::from_fn(|i, _| at(ma, i) - at(ar, i));
    // `P = A P A' + B B'` by doubling.
    let (mut power, mut p) = (a, b * b.transpose());
    for _ in 0..40 {
        let more = power * p * power.transpose();
        let done = more.norm() <= 1e-14 * p.norm();
        p += more;
        power *= power;
        if done {
            break;
        }
    }
    if !p.iter().all(|v| v.is_finite()) {
        return None;
    }
    let mut steps = Vec::new();
    for _ in 0..MOST_STEPS {
        // `v = x1 + e`, and `e` drives the state too.
        let variance = p[(0, 0)] + 1.0;
        let gain = (a * p.column(0) + b) / variance;
        let settled =
            (variance - 1.0).abs() < SETTLED && (gain - b).norm() < SETTLED * (1.0 + b.norm());
        if settled {
            return Some(steps);
        }
        steps.push(Start {
            gain: std::array::from_fn(|i| if i < N { gain[i] } else { 0.0 }),
            scale: variance.sqrt().recip(),
        });
        p = a * p * a.transpose() + b * b.transpose() - gain * gain.transpose() * variance;
        p = (p + p.transpose()) * 0.5;
    }
    Some(steps)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    /// Autocovariance from the impulse response, whose squares and products are summed until nothing is left of them.
    fn autocovariance(ar: &[f64], ma: &[f64], lags: usize) -> Vec<f64> {
        let length = 20_000;
        let mut h = vec![0.0; length];
        for k in 0..length {
            h[k] = if k == 0 {
                1.0
            } else {
                ma.get(k - 1).copied().unwrap_or(0.0)
            };
            for (i, a) in ar.iter().enumerate().take(k) {
                h[k] -= a * h[k - 1 - i];
            }
        }
        (0..lags)
            .map(|lag| h[lag..].iter().zip(&h).map(|(a, b)| a * b).sum())
            .collect()
    }

    /// Against the dense covariance: the quadratic form and the determinant.
    #[test]
    fn the_likelihood_of_a_stretch_is_exact() {
        let models: [(&[f64], &[f64]); 7] = [
            (&[], &[]),
            (&[-0.95], &[]),
            (&[-1.2, 0.5, -0.1], &[]),
            (&[-0.99], &[-0.8]),
            (&[-1.6, 0.64], &[-0.3]),
            (&[-1.7, 0.8], &[0.4, 0.2]),
            (&[-1.2, 0.5, -0.1], &[-0.5, 0.3, 0.1]),
        ];
        let v: Vec<f64> = (0..60).map(|k| f64::from(k * k % 17) - 7.0).collect();
        for (ar, ma) in models {
            let colour = Colour::new(ar.to_vec(), ma.to_vec()).unwrap();
            for n in [1, 2, 7, 60] {
                let r = autocovariance(ar, ma, n);
                let covariance = DMatrix::from_fn(n, n, |i, j| r[i.abs_diff(j)]);
                let factor = covariance.cholesky().unwrap();
                let white = factor
                    .l()
                    .solve_lower_triangular(&DVector::from_column_slice(&v[..n]))
                    .unwrap();
                let mut found = Vec::new();
                colour.whiten(&v[..n], 1.0, &mut found);
                for (found, wanted) in found.iter().zip(white.iter()) {
                    assert!(
                        (found - wanted).abs() < 1e-5 * (1.0 + wanted.abs()),
                        "{ar:?} {ma:?} {n}"
                    );
                }
                let determinant = 2.0 * factor.l().diagonal().iter().map(|d| d.ln()).sum::<f64>();
                assert!(
                    (colour.log_determinant(n) - determinant).abs() < 1e-5,
                    "{ar:?} {ma:?} {n}"
                );
            }
        }
    }

    #[test]
    fn long_autoregressions_are_the_literal_sum() {
        let v: Vec<f64> = (0..90).map(|k| f64::from(k * k % 23) - 11.0).collect();
        for order in [0, 1, 8, 13, MOST_ORDER] {
            // Small enough together to be stationary at any order.
            let size = 0.06 / (1.0 + order as f64);
            let ar: Vec<f64> = (0..order).map(|i| size * (i as f64 - 4.0)).collect();
            let Some(colour) = Colour::new(ar.clone(), Vec::new()) else {
                panic!("{order}");
            };
            let mut found = Vec::new();
            colour.whiten(&v, 1.7, &mut found);
            assert_eq!(found.len(), v.len());
            for k in order..v.len() {
                let past: f64 = (0..order).map(|i| ar[i] * v[k - 1 - i]).sum();
                assert!(
                    (found[k] - 1.7 * (v[k] + past)).abs() < 1e-12,
                    "{order} {k}"
                );
            }
        }
    }

    #[test]
    fn what_is_not_stationary_or_not_invertible_is_refused() {
        assert!(Colour::new(vec![-1.0], vec![]).is_none());
        assert!(Colour::new(vec![-1.2, 0.1], vec![]).is_none());
        assert!(Colour::new(vec![-0.5], vec![1.3]).is_none());
        assert!(Colour::new(vec![f64::NAN], vec![]).is_none());
        assert_eq!(reflections(&[-0.5]).unwrap(), [-0.5]);
    }
}
