//! Mixed models by Whittle's likelihood, on a periodogram that is averaged over bins.

use std::cell::Cell;

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use realfft::RealFftPlanner;

use crate::noise::colour::MOST_MIXED;

/// Share of a stretch over which the periodogram is tapered at either end: the jump from the end to the beginning of slow noise
/// would leak into all frequencies (Dahlhaus 1988).
const TAPER: f64 = 0.05;
/// Lowest frequencies that make a bin each, and the growth of the bins above.
const SINGLE_BINS: usize = 16;
const BIN_GROWTH: f64 = 1.04;
/// Steps of a fit, and the decrease of the deviance at which it ends.
const STEPS: usize = 30;
const SETTLED: f64 = 1e-3;

/// Tukey's window at sample `k` of `n`.
fn taper(k: usize, n: usize) -> f64 {
    let edge = (k.min(n - 1 - k) as f64 + 0.5) / (TAPER * n as f64);
    if edge >= 1.0 {
        1.0
    } else {
        0.5 - 0.5 * (std::f64::consts::PI * edge).cos()
    }
}

thread_local! {
    /// Residuals of one search have the same few lengths: each is planned once a thread.
    static PLANNER: Cell<RealFftPlanner<f64>> = Cell::new(RealFftPlanner::new());
}

/// A periodogram, averaged over bins.
pub(super) struct Bins {
    /// Ordinates in each.
    count: Vec<f64>,
    power: Vec<f64>,
    /// `exp(-i w k)`, `k = 1..=MOST_MIXED`.
    turns: Vec<[Complex64; MOST_MIXED]>,
}

impl Bins {
    /// Of a residual that the autoregression `ar` has whitened to `filled`, with `count` values that are none of the gaps.
    pub(super) fn new(filled: &[Vec<f64>], count: usize, ar: &[f64]) -> Option<Self> {
        let longest = filled.iter().map(Vec::len).max()?;
        let top = longest / 2;
        // Upper edge of each bin, in bins of the longest.
        let mut edges: Vec<f64> = (1..=SINGLE_BINS.min(top)).map(|j| j as f64 + 0.5).collect();
        while edges.last().is_some_and(|e| *e < top as f64) {
            let last = edges[edges.len() - 1];
            edges.push((last * BIN_GROWTH).max(last + 1.0));
        }
        let m = edges.len();
        let (mut counts, mut powers, mut places) = (vec![0.0; m], vec![0.0; m], vec![0.0; m]);
        let share = filled.iter().map(Vec::len).sum::<usize>() as f64 / count as f64;
        let mut planner = PLANNER.take();
        for v in filled.iter().filter(|v| v.len() >= 16) {
            let n = v.len();
            let transform = planner.plan_fft_forward(n);
            let mut input = Vec::with_capacity(n);
            let mut squares = 0.0;
            for (k, v) in v.iter().enumerate() {
                let weight = taper(k, n);
                squares += weight * weight;
                input.push(weight * v);
            }
            let mut spectrum = transform.make_output_vec();
            transform.process(&mut input, &mut spectrum).ok()?;
            let mut bin = 0;
            for (j, s) in spectrum.iter().enumerate().skip(1) {
                let place = j as f64 * longest as f64 / n as f64;
                while bin + 1 < m && place > edges[bin] {
                    bin += 1;
                }
                // The last ordinate of an even number is one value, not two.
                let weight = if 2 * j == n { 0.5 } else { 1.0 };
                counts[bin] += weight;
                powers[bin] += weight * s.norm_sqr() * share / squares;
                places[bin] += weight * place;
            }
        }
        PLANNER.set(planner);
        let mut bins = Self {
            count: Vec::with_capacity(m),
            power: Vec::with_capacity(m),
            turns: Vec::with_capacity(m),
        };
        for ((count, power), place) in counts.into_iter().zip(powers).zip(places) {
            if count > 0.0 && power > 0.0 {
                let w = std::f64::consts::TAU * place / count / longest as f64;
                // Flat within a bin before this.
                let whitens = ar
                    .iter()
                    .enumerate()
                    .map(|(i, a)| Complex64::from_polar(*a, -w * (i + 1) as f64))
                    .fold(Complex64::new(1.0, 0.0), |sum, term| sum + term);
                bins.count.push(count);
                bins.power.push(power / count / whitens.norm_sqr());
                bins.turns.push(std::array::from_fn(|k| {
                    Complex64::from_polar(1.0, -w * (k + 1) as f64)
                }));
            }
        }
        (bins.count.len() > 4 * MOST_MIXED).then_some(bins)
    }

    /// `1 + p1 e^(-iw) + ...`
    fn value(polynomial: &[f64], turns: &[Complex64; MOST_MIXED]) -> Complex64 {
        polynomial
            .iter()
            .zip(turns)
            .fold(Complex64::new(1.0, 0.0), |sum, (p, t)| sum + t * *p)
    }

    /// Shape that the model gives the spectrum in each bin.
    fn shapes(&self, ar: &[f64], ma: &[f64]) -> Vec<f64> {
        self.turns
            .iter()
            .map(|turns| Self::value(ma, turns).norm_sqr() / Self::value(ar, turns).norm_sqr())
            .collect()
    }

    /// Variance of the innovations of largest likelihood, for these shapes.
    fn variance(&self, shapes: &[f64]) -> f64 {
        let ratios = self.power.iter().zip(shapes).zip(&self.count);
        let sum: f64 = ratios.map(|((power, shape), m)| m * power / shape).sum();
        sum / self.total()
    }

    fn total(&self) -> f64 {
        self.count.iter().sum()
    }

    /// Twice Whittle's log likelihood, negative, with the best variance.
    pub(super) fn deviance(&self, ar: &[f64], ma: &[f64]) -> Option<f64> {
        let shapes = self.shapes(ar, ma);
        let logarithms: f64 = shapes
            .iter()
            .zip(&self.count)
            .map(|(s, m)| m * s.ln())
            .sum();
        let deviance = 2.0 * (logarithms + self.total() * self.variance(&shapes).ln());
        deviance.is_finite().then_some(deviance)
    }

    /// Fisher's scoring with Levenberg's damping.
    pub(super) fn fitted(
        &self,
        mut ar: Vec<f64>,
        mut ma: Vec<f64>,
    ) -> Option<(Vec<f64>, Vec<f64>)> {
        let (p, m) = (ar.len(), ar.len() + ma.len());
        let mut least = self.deviance(&ar, &ma)?;
        let mut damping = 1e-3;
        let total = self.total();
        // Derivatives of the log of each shape; there are none beyond `m`.
        let mut rows = vec![[0.0; 2 * MOST_MIXED]; self.count.len()];
        for _ in 0..STEPS {
            let shapes = self.shapes(&ar, &ma);
            let variance = self.variance(&shapes);
            // The derivatives less their mean: the variance takes that up.
            let mut mean = [0.0; 2 * MOST_MIXED];
            for ((row, turns), count) in rows.iter_mut().zip(&self.turns).zip(&self.count) {
                let (a, c) = (Self::value(&ar, turns).inv(), Self::value(&ma, turns).inv());
                for (value, turn) in row[..p].iter_mut().zip(turns) {
                    *value = -2.0 * (turn * a).re;
                }
                for (value, turn) in row[p..m].iter_mut().zip(turns) {
                    *value = 2.0 * (turn * c).re;
                }
                for (mean, value) in mean.iter_mut().zip(row.iter()) {
                    *mean += value * count / total;
                }
            }
            let mut curvature = [[0.0; 2 * MOST_MIXED]; 2 * MOST_MIXED];
            let mut gradient = [0.0; 2 * MOST_MIXED];
            for (i, row) in rows.iter_mut().enumerate() {
                let count = self.count[i];
                let excess = count * (self.power[i] / shapes[i] / variance - 1.0);
                for (value, mean) in row.iter_mut().zip(&mean) {
                    *value -= mean;
                }
                for (i, value) in row.iter().enumerate() {
                    gradient[i] += value * excess;
                    for (sum, other) in curvature[i].iter_mut().zip(row.iter()) {
                        *sum += count * value * other;
                    }
                }
            }
            let before = least;
            for _ in 0..8 {
                let damped = DMatrix::from_fn(m, m, |i, j| {
                    curvature[i][j] * if i == j { 1.0 + damping } else { 1.0 }
                        + if i == j { 1e-12 } else { 0.0 }
                });
                let step = damped
                    .cholesky()?
                    .solve(&DVector::from_column_slice(&gradient[..m]));
                let next_ar: Vec<f64> = ar.iter().zip(step.iter()).map(|(a, s)| a + s).collect();
                let next_ma: Vec<f64> = ma
                    .iter()
                    .zip(step.iter().skip(p))
                    .map(|(c, s)| c + s)
                    .collect();
                match self.deviance(&next_ar, &next_ma) {
                    Some(now) if now < least => {
                        (ar, ma, least) = (next_ar, next_ma, now);
                        damping = (damping * 0.2).max(1e-9);
                        break;
                    }
                    _ => damping *= 8.0,
                }
            }
            if before - least < SETTLED {
                break;
            }
        }
        Some((ar, ma))
    }
}
