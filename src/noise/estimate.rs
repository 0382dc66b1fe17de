//! Which colour a residual has.
//!
//! Autoregressions of all orders by Levinson and Durbin, and mixed models of low order by Whittle's likelihood on a
//! periodogram of the prewhitened residual that is averaged over bins: a step of Fisher's scoring then costs some hundred operations and no pass
//! over the data. Starts are those of Hannan and Rissanen (1982) and a grid of slow poles. The choice among all is by
//! Schwarz's criterion with the exact likelihood of each.

mod whittle;

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;

use self::whittle::Bins;
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
    /// Autoregressions of all orders, and slow and white noise.
    Simple,
    All,
}

impl Colours {
    fn most_order(self) -> usize {
        match self {
            Self::White => 0,
            #[cfg(test)]
            Self::First => 1,
            Self::Few => 2,
            Self::Simple | Self::All => MOST_ORDER,
        }
    }

    fn mixed(self) -> &'static [(usize, usize)] {
        match self {
            Self::White => &[],
            #[cfg(test)]
            Self::First => &[],
            Self::Few => &MIXED[..3],
            Self::Simple => &MIXED[..1],
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
        super::each_stretch(v, mask, |values| {
            n += values.len();
            sum += values.iter().sum::<f64>();
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
    let errors: Vec<Vec<f64>> = stretches
        .iter()
        .map(|(v, m)| prewhitened(v, m, mean, &long))
        .collect();
    let Some(bins) = Bins::new(&errors, n, &long) else {
        return best.1;
    };
    let starts = Starts::new(&filled, &errors, &covariance);
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

/// A stretch less the mean; what does not count is bridged, unless most values stand alone.
fn bridged(v: &[f64], mask: &[bool], mean: f64) -> Vec<f64> {
    if let Some(kept) = super::standing_alone(v, mask) {
        return kept.iter().map(|v| v - mean).collect();
    }
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

/// Errors of a long autoregression in each stretch of what counts, and zero elsewhere. White noise has no jumps at gaps, nor at its
/// ends, where slow noise has those that leak into all frequencies.
fn prewhitened(v: &[f64], mask: &[bool], mean: f64, ar: &[f64]) -> Vec<f64> {
    let filter = Colour::new(ar.to_vec(), Vec::new()).unwrap_or_default();
    let mut white = Vec::with_capacity(v.len());
    super::each_stretch(v, mask, |values| {
        let centred: Vec<f64> = values.iter().map(|v| v - mean).collect();
        filter.whiten(&centred, 1.0, &mut white);
    });
    if super::stand_alone(mask) {
        return white;
    }
    let mut white = white.into_iter();
    let at = |keep: &bool| if *keep { white.next() } else { None };
    mask.iter().map(at).map(Option::unwrap_or_default).collect()
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
        super::each_stretch(v, mask, |values| {
            centred.clear();
            centred.extend(values.iter().map(|v| v - mean));
            white.clear();
            colour.whiten(&centred, 1.0, &mut white);
            squares += super::sum_of_squares(&white);
            count += values.len();
            determinant += colour.log_determinant(values.len());
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
    fn new(filled: &[Vec<f64>], errors: &[Vec<f64>], covariance: &[f64]) -> Self {
        let most = MOST_MIXED as isize;
        let cross = (-most..=most)
            .map(|lag| {
                let back = lag.unsigned_abs();
                filled
                    .iter()
                    .zip(errors)
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
            errors: autocovariance(errors, MOST_MIXED),
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

#[cfg(test)]
mod tests;
