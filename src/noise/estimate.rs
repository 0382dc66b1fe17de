//! Which colour a residual has.
//!
//! Autoregressions of all orders by Levinson and Durbin, and mixed models of low order by Whittle's likelihood on a
//! periodogram that is averaged over bins: a step of Fisher's scoring then costs some hundred operations and no pass
//! over the data. Starts are those of Hannan and Rissanen (1982) and a grid of slow poles. The choice among all is by
//! Schwarz's criterion with the exact likelihood of each.

use std::cell::Cell;

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use realfft::RealFftPlanner;

use super::colour::{Colour, MOST_MIXED, MOST_ORDER};
use super::{Mask, product};
use crate::noise::Series;

/// Mixed models that are tried, `(autoregressive order, moving average order)`: slow and white noise is the first; the
/// next are what a process of second order leaves beside white noise, alone or with a slow one.
const MIXED: [(usize, usize); 4] = [(1, 1), (2, 1), (2, 2), (3, 3)];
/// Slow poles and zeros from which the first is started as well.
const SLOW: [(f64, f64); 6] = [
    (0.8, 0.4),
    (0.95, 0.6),
    (0.95, 0.85),
    (0.99, 0.7),
    (0.99, 0.93),
    (0.998, 0.95),
];
/// Order of the autoregression whose errors stand for the innovations in the starts.
const LONG: usize = 20;
/// Gaps up to this length are bridged by a straight line between their neighbours where the colour is estimated; longer ones
/// by a line between the means of so many values on either side: zeros would be jumps of slow noise, and the neighbours alone
/// would make slow noise of white noise.
const SHORT_GAP: usize = 8;
const SIDE_OF_A_LONG_GAP: usize = 20;
/// Share of a stretch over which the periodogram is tapered at either end: the jump from the end to the beginning of slow noise
/// would leak into all frequencies (Dahlhaus 1988).
const TAPER: f64 = 0.05;
/// Lowest frequencies that make a bin each, and the growth of the bins above.
const SINGLE_BINS: usize = 16;
const BIN_GROWTH: f64 = 1.04;
/// Steps of a fit, and the decrease of the deviance at which it ends.
const STEPS: usize = 30;
const SETTLED: f64 = 1e-3;
/// Poles and zeros further out than this many samples' memory are not distinguished from the circle.
const LONGEST_MEMORY: f64 = 1e5;
/// An oscillation that stays in phase for more than one part in this of a recording is a disturbance with a frequency, and no
/// noise.
const COHERENCE: f64 = 20.0;
/// Values that each coefficient needs.
const VALUES_A_COEFFICIENT: usize = 12;

/// Which models are tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Colours {
    White,
    /// An autoregression of order one, in which hardly anything hides.
    #[cfg(test)]
    First,
    /// Autoregressions of order two at most, and mixed ones up to (2, 2): a long one learns slow misfit as colour.
    Few,
    All,
}

impl Colours {
    fn most_order(self) -> usize {
        match self {
            Self::White => 0,
            #[cfg(test)]
            Self::First => 1,
            Self::Few => 2,
            Self::All => MOST_ORDER,
        }
    }

    fn mixed(self) -> &'static [(usize, usize)] {
        match self {
            Self::White => &[],
            #[cfg(test)]
            Self::First => &[],
            Self::Few => &MIXED[..3],
            Self::All => &MIXED,
        }
    }
}

/// The colour of output `output` of a residual.
pub(super) fn colour(
    residual: &Series,
    outputs: usize,
    output: usize,
    mask: &Mask,
    colours: Colours,
) -> Colour {
    let stretches: Vec<(&[f64], &[bool])> = residual
        .iter()
        .zip(mask)
        .skip(output)
        .step_by(outputs)
        .map(|(v, m)| (v.as_slice(), m.as_slice()))
        .collect();
    let (mut n, mut sum) = (0, 0.0);
    for (v, mask) in &stretches {
        super::each_stretch(mask, |from, to| {
            n += to - from;
            sum += v[from..to].iter().sum::<f64>();
        });
    }
    let most = colours.most_order().min(n / VALUES_A_COEFFICIENT);
    if most == 0 {
        return Colour::default();
    }
    // About the mean: a constant is an offset to be explained, not colour with a pole at one.
    let mean = sum / n as f64;
    let filled: Vec<Vec<f64>> = stretches.iter().map(|(v, m)| bridged(v, m, mean)).collect();
    let lags = if colours.mixed().is_empty() {
        most
    } else {
        most.max(LONG.min(n / VALUES_A_COEFFICIENT))
    };
    let covariance = autocovariance(&filled, lags);
    if covariance[0].is_nan() || covariance[0] <= 0.0 {
        return Colour::default();
    }
    let (best, long) = levinson(&covariance, n, most, LONG);
    let judged = |colour: Colour| {
        let criterion = deviance(&colour, &stretches, mean) + colour.len() as f64 * (n as f64).ln();
        (criterion, colour)
    };
    let mut best = judged(Colour::new(best, Vec::new()).unwrap_or_default());
    if colours.mixed().is_empty() || n < VALUES_A_COEFFICIENT * LONG {
        return best.1;
    }
    let Some(bins) = Bins::new(&filled, n) else {
        return best.1;
    };
    let starts = Starts::new(&filled, &covariance, &long);
    let coherent = (-COHERENCE / filled.iter().map(Vec::len).max().unwrap_or(1) as f64).exp();
    let mut lower: Option<(Vec<f64>, Vec<f64>)> = None;
    for &(p, q) in colours.mixed() {
        let mut tried: Vec<(Vec<f64>, Vec<f64>)> = starts.mixed(p, q).into_iter().collect();
        if (p, q) == (1, 1) {
            tried.extend(SLOW.map(|(pole, zero)| (vec![-pole], vec![-zero])));
        }
        if let Some((ar, ma)) = &lower {
            // A little pole and a little zero more.
            let grown = |list: &[f64], by: f64, to: usize| {
                let mut list = list.to_vec();
                while list.len() < to {
                    list = multiplied(&list, by);
                }
                list
            };
            tried.push((grown(ar, -0.5, p), grown(ma, -0.3, q)));
        }
        let first = tried
            .into_iter()
            .filter_map(|(ar, ma)| Some((bins.deviance(&ar, &ma)?, ar, ma)))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, ar, ma)) = first else { continue };
        let Some((ar, ma)) = bins.fitted(ar, ma) else {
            continue;
        };
        let Some(colour) = inside(&ar, coherent)
            .zip(inside(&ma, 1.0))
            .and_then(|(ar, ma)| Colour::new(ar, ma))
        else {
            continue;
        };
        lower = Some((colour.ar.clone(), colour.ma.clone()));
        let mixed = judged(colour);
        if mixed.0 < best.0 {
            best = mixed;
        }
    }
    best.1
}

/// A stretch less the mean; what does not count is bridged.
fn bridged(v: &[f64], mask: &[bool], mean: f64) -> Vec<f64> {
    let mut out: Vec<f64> = v
        .iter()
        .zip(mask)
        .map(|(v, keep)| if *keep { v - mean } else { 0.0 })
        .collect();
    let mut k = 0;
    while k < out.len() {
        if mask[k] {
            k += 1;
            continue;
        }
        let from = k;
        while k < out.len() && !mask[k] {
            k += 1;
        }
        let side = if k - from <= SHORT_GAP {
            1
        } else {
            SIDE_OF_A_LONG_GAP
        };
        let level = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
        // What was bridged before counts as well; what comes after, as far as it counts.
        let a = level(&out[from.saturating_sub(side)..from]);
        let after = mask[k..]
            .iter()
            .take(side)
            .take_while(|keep| **keep)
            .count();
        let b = level(&out[k..k + after]);
        let length = (k - from + 1) as f64;
        for (i, value) in out[from..k].iter_mut().enumerate() {
            *value = a + (b - a) * (i + 1) as f64 / length;
        }
    }
    out
}

/// Tukey's window at sample `k` of `n`.
fn taper(k: usize, n: usize) -> f64 {
    let edge = (k.min(n - 1 - k) as f64 + 0.5) / (TAPER * n as f64);
    if edge >= 1.0 {
        1.0
    } else {
        0.5 - 0.5 * (std::f64::consts::PI * edge).cos()
    }
}

/// Sums of lagged products.
fn autocovariance(filled: &[Vec<f64>], lags: usize) -> Vec<f64> {
    (0..=lags)
        .map(|lag| {
            filled
                .iter()
                .map(|v| product(v.get(lag..).unwrap_or_default(), v))
                .sum()
        })
        .collect()
}

/// Levinson and Durbin: the order that Schwarz's criterion chooses up to `most`, and the order `long`.
fn levinson(covariance: &[f64], count: usize, most: usize, long: usize) -> (Vec<f64>, Vec<f64>) {
    let samples = count as f64;
    let mut ar: Vec<f64> = Vec::new();
    let mut at_long = Vec::new();
    let mut variance = covariance[0];
    let (mut best, mut least) = (Vec::new(), samples * variance.ln());
    for order in 1..covariance.len() {
        let mut reflection = covariance[order];
        for (i, a) in ar.iter().enumerate() {
            reflection += a * covariance[order - 1 - i];
        }
        let k = -reflection / variance;
        if !k.is_finite() || k.abs() >= 1.0 {
            break;
        }
        let before = ar.clone();
        for (i, a) in ar.iter_mut().enumerate() {
            *a += k * before[order - 2 - i];
        }
        ar.push(k);
        variance *= 1.0 - k * k;
        let criterion = samples * variance.ln() + order as f64 * samples.ln();
        if criterion < least && order <= most {
            least = criterion;
            best = ar.clone();
        }
        if order <= long {
            at_long = ar.clone();
        }
    }
    (best, at_long)
}

/// `-2 log` likelihood with the best scale, less what is the same for all colours.
fn deviance(colour: &Colour, stretches: &[(&[f64], &[bool])], mean: f64) -> f64 {
    let (mut squares, mut count, mut determinant) = (0.0, 0usize, 0.0);
    let mut white = Vec::new();
    let mut centred = Vec::new();
    for (v, mask) in stretches {
        super::each_stretch(mask, |from, to| {
            centred.clear();
            centred.extend(v[from..to].iter().map(|v| v - mean));
            white.clear();
            colour.whiten(&centred, 1.0, &mut white);
            squares += super::sum_of_squares(&white);
            count += to - from;
            determinant += colour.log_determinant(to - from);
        });
    }
    count as f64 * (squares / count as f64).max(1e-300).ln() + determinant
}

/// Coefficients of `(1 + p1 z + ...) (1 + root z)`.
fn multiplied(polynomial: &[f64], root: f64) -> Vec<f64> {
    let at = |i: usize| {
        if i == 0 {
            1.0
        } else {
            polynomial.get(i - 1).copied().unwrap_or(0.0)
        }
    };
    (1..=polynomial.len() + 1)
        .map(|i| at(i) + root * at(i - 1))
        .collect()
}

/// The polynomial of the same magnitude on the circle whose roots are inside of it, complex ones no nearer to it than
/// `coherent`.
fn inside(polynomial: &[f64], coherent: f64) -> Option<Vec<f64>> {
    let n = polynomial.len();
    let companion = DMatrix::from_fn(n, n, |i, j| {
        if i == 0 {
            -polynomial[j]
        } else if i == j + 1 {
            1.0
        } else {
            0.0
        }
    });
    let most = 1.0 - 1.0 / LONGEST_MEMORY;
    let mut product = vec![Complex64::new(1.0, 0.0)];
    for mut root in crate::linalg::eigenvalues(&companion).ok()? {
        if root.norm() > 1.0 {
            root = root.conj().inv();
        }
        let most = if root.im == 0.0 {
            most
        } else {
            most.min(coherent)
        };
        if root.norm() > most {
            root *= most / root.norm();
        }
        let mut next = product.clone();
        next.push(Complex64::new(0.0, 0.0));
        for (i, p) in product.iter().enumerate() {
            next[i + 1] -= p * root;
        }
        product = next;
    }
    Some(product[1..].iter().map(|c| c.re).collect())
}

/// Covariances at small lags of the values and of the errors of a long autoregression, for Hannan and Rissanen's regression.
struct Starts {
    /// `values[lag]`, `errors[lag]`: sums of `v[k] v[k-lag]`, `e[k] e[k-lag]`.
    values: Vec<f64>,
    errors: Vec<f64>,
    /// `cross[MOST_MIXED + lag]`: sums of `v[k] e[k-lag]`.
    cross: Vec<f64>,
}

impl Starts {
    fn new(filled: &[Vec<f64>], covariance: &[f64], long: &[f64]) -> Self {
        let filter = Colour::new(long.to_vec(), Vec::new()).unwrap_or_default();
        let errors: Vec<Vec<f64>> = filled
            .iter()
            .map(|v| {
                let mut e = Vec::with_capacity(v.len());
                filter.whiten(v, 1.0, &mut e);
                e
            })
            .collect();
        let most = MOST_MIXED as isize;
        let cross = (-most..=most)
            .map(|lag| {
                let back = lag.unsigned_abs();
                filled
                    .iter()
                    .zip(&errors)
                    .map(|(v, e)| {
                        if lag >= 0 {
                            product(v.get(back..).unwrap_or_default(), e)
                        } else {
                            product(v, e.get(back..).unwrap_or_default())
                        }
                    })
                    .sum()
            })
            .collect();
        Self {
            values: covariance.iter().take(MOST_MIXED + 1).copied().collect(),
            errors: autocovariance(&errors, MOST_MIXED),
            cross,
        }
    }

    /// Regression of a value on `p` values and `q` errors before it.
    fn mixed(&self, p: usize, q: usize) -> Option<(Vec<f64>, Vec<f64>)> {
        // `sum v[k-i] e[k-j]` is that of `v[k] e[k-(j-i)]`.
        let cross = |i: usize, j: usize| self.cross.get(MOST_MIXED + j - i).copied();
        let m = p + q;
        let mut gram = DMatrix::zeros(m, m);
        let mut right = DVector::zeros(m);
        for i in 0..m {
            for j in 0..m {
                gram[(i, j)] = match (i < p, j < p) {
                    (true, true) => *self.values.get(i.abs_diff(j))?,
                    (false, false) => *self.errors.get(i.abs_diff(j))?,
                    (true, false) => cross(i + 1, j - p + 1)?,
                    (false, true) => cross(j + 1, i - p + 1)?,
                };
            }
            right[i] = if i < p {
                *self.values.get(i + 1)?
            } else {
                cross(0, i - p + 1)?
            };
            gram[(i, i)] *= 1.0 + 1e-9;
        }
        let solved = gram.cholesky()?.solve(&right);
        let ar: Vec<f64> = solved.iter().take(p).map(|v| -v).collect();
        let ma: Vec<f64> = solved.iter().skip(p).copied().collect();
        inside(&ar, 1.0).zip(inside(&ma, 1.0))
    }
}

thread_local! {
    /// Residuals of one search have the same few lengths: each is planned once a thread.
    static PLANNER: Cell<RealFftPlanner<f64>> = Cell::new(RealFftPlanner::new());
}

/// A periodogram, averaged over bins.
struct Bins {
    /// Ordinates in each.
    count: Vec<f64>,
    power: Vec<f64>,
    /// `exp(-i w k)`, `k = 1..=MOST_MIXED`.
    turns: Vec<[Complex64; MOST_MIXED]>,
}

impl Bins {
    fn new(filled: &[Vec<f64>], count: usize) -> Option<Self> {
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
                bins.count.push(count);
                bins.power.push(power / count);
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
    fn deviance(&self, ar: &[f64], ma: &[f64]) -> Option<f64> {
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
    fn fitted(&self, mut ar: Vec<f64>, mut ma: Vec<f64>) -> Option<(Vec<f64>, Vec<f64>)> {
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

#[cfg(test)]
mod tests;
