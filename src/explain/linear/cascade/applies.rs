//! Whether recordings could come from tanks at all: levels that are not negative, a pump that is either, no ringing.
//! A few passes over the samples; nothing is simulated.

use nalgebra::{Matrix5, Vector5};

/// Ten samples a number of the full class.
const FEWEST: usize = 100;
/// Samples of outliers that do not speak against a sign: one in a hundred.
const OUTLIERS: f64 = 0.01;
/// A level may read this share of its largest below zero: an empty tank under noise of 5 %, by two deviations.
const BELOW_ZERO: f64 = -0.1;
/// Least damping of what can still be called aperiodic: an overshoot of 16 %, where two real poles have none.
const LEAST_DAMPING: f64 = 0.5;
/// Share of the steps in which an input of levels keeps its value. A binary sequence at full rate keeps half of them,
/// one of three levels a third; noise and sines none.
const KEPT: f64 = 0.25;

/// Recordings before anything is done to them.
pub(super) struct View<'a> {
    pub(super) records: &'a [(&'a [f64], &'a [f64])],
    pub(super) mask: &'a [Vec<bool>],
}

impl View<'_> {
    pub(crate) fn counted(&self) -> impl Iterator<Item = (f64, f64)> {
        self.records
            .iter()
            .zip(self.mask)
            .flat_map(|((u, y), mask)| {
                u.iter()
                    .zip(*y)
                    .zip(mask)
                    .filter_map(|((u, y), keep)| keep.then_some((*u, *y)))
            })
    }

    /// Mean size of the input, mean of the output.
    pub(crate) fn units(&self) -> Option<(f64, f64)> {
        let n = self.counted().count() as f64;
        let (u, y) = self
            .counted()
            .fold((0.0, 0.0), |(a, b), (u, y)| (a + u.abs(), b + y));
        let usable = |v: f64| (v > 0.0 && v.is_finite()).then_some(v / n);
        Some((usable(u)?, usable(y)?))
    }

    /// Whether to go on, and then whether the input needs a bias. A few passes over the samples.
    pub(crate) fn applies(&self) -> Option<bool> {
        let shapes = self.records.len() == self.mask.len()
            && self
                .records
                .iter()
                .zip(self.mask)
                .all(|((u, y), m)| u.len() == y.len() && u.len() == m.len());
        let count = self.counted().count();
        let finite = self
            .records
            .iter()
            .all(|(u, _)| u.iter().all(|u| u.is_finite()))
            && self.counted().all(|(_, y)| y.is_finite());
        if !shapes || !finite || count < FEWEST {
            return None;
        }
        let largest = self.counted().fold((0.0_f64, 0.0_f64), |(a, b), (u, y)| {
            (a.max(u.abs()), b.max(y))
        });
        let outliers = (OUTLIERS * count as f64) as usize;
        let below = |at: f64| self.counted().filter(|(_, y)| *y < at).count();
        if largest.1 <= 0.0 || below(BELOW_ZERO * largest.1) > outliers {
            return None;
        }
        // An input below zero by a hundredth is an offset of the instrument.
        let negative = self
            .counted()
            .filter(|(u, _)| *u < -0.01 * largest.0)
            .count()
            > outliers;
        ((!negative || self.input_of_levels()) && self.aperiodic()).then_some(negative)
    }

    fn input_of_levels(&self) -> bool {
        let steps = || self.records.iter().flat_map(|(u, _)| u.windows(2));
        let kept = steps().filter(|w| w[0] == w[1]).count();
        kept as f64 >= KEPT * steps().count() as f64
    }

    /// A low-pass without resonance: neighbouring outputs are alike, and the regression of an output on two outputs and
    /// two inputs before it has no weakly damped poles. Noise biases those poles, but towards damping.
    fn aperiodic(&self) -> bool {
        let (mut rough, mut sum, mut square, mut n) = (0.0, 0.0, 0.0, 0.0);
        let (mut h, mut side) = (Matrix5::<f64>::zeros(), Vector5::<f64>::zeros());
        for ((u, y), mask) in self.records.iter().zip(self.mask) {
            for k in 2..y.len() {
                if mask[k] && mask[k - 1] && mask[k - 2] {
                    rough += (y[k] - y[k - 1]).powi(2);
                    sum += y[k];
                    square += y[k] * y[k];
                    n += 1.0;
                    let row = Vector5::new(y[k - 1], y[k - 2], u[k - 1], u[k - 2], 1.0);
                    h += row * row.transpose();
                    side += row * y[k];
                }
            }
        }
        // White noise has twice its variance in its differences.
        let variance = square - sum * sum / n;
        if !(variance > 0.0 && rough < variance) {
            return false;
        }
        let scale = h.diagonal().map(|d| if d > 0.0 { d.sqrt() } else { 1.0 });
        let scaled = Matrix5::from_fn(|i, j| {
            h[(i, j)] / (scale[i] * scale[j]) + f64::from(u8::from(i == j)) * 1e-12
        });
        let Some(cholesky) = scaled.cholesky() else {
            return true;
        };
        let poles = cholesky
            .solve(&side.component_div(&scale))
            .component_div(&scale);
        let (sum, product) = (poles[0], -poles[1]);
        if sum * sum >= 4.0 * product {
            return true;
        }
        let radius = 0.5 * product.ln();
        let angle = (0.5 * sum / product.sqrt()).clamp(-1.0, 1.0).acos();
        -radius >= LEAST_DAMPING * radius.hypot(angle)
    }
}
