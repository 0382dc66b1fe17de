//! What the difference of two recordings of the same thing looks like: coloured, perhaps with heavy tails.
//!
//! Each output's residual is autoregressive, its innovations Student's t with a common number of degrees of freedom:
//! without the colour, slow noise looks like slow physics; without the tails, a few large errors look like effects
//! (math/explain.md, choice 3: together they take the false alarms on the hard nulls from 4 of 8 to none).

use statrs::function::gamma::ln_gamma;

use super::data::Series;

/// Largest autoregressive order that is tried.
pub(crate) const MOST_ORDER: usize = 8;
/// Degrees of freedom that are tried; infinity is Gaussian.
const DEGREES: [f64; 6] = [3.0, 4.0, 6.0, 10.0, 20.0, f64::INFINITY];

/// A noise model: a whitening filter and the distribution of what comes out of it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Noise {
    /// `e[k] = v[k] + ar[0] v[k-1] + ...`, one filter an output.
    pub ar: Vec<Vec<f64>>,
    /// Scale of the whitened residual, one an output.
    pub scale: Vec<f64>,
    /// Degrees of freedom of Student's t; infinite for Gaussian.
    pub degrees: f64,
}

/// Which samples count: `false` is left out of every sum.
pub(crate) type Mask = Vec<Vec<bool>>;

impl Noise {
    /// White and Gaussian, of the residual's size.
    pub fn white(residual: &Series, outputs: usize, mask: &Mask) -> Self {
        let mut noise = Self {
            ar: vec![Vec::new(); outputs],
            scale: vec![1.0; outputs],
            degrees: f64::INFINITY,
        };
        noise.fit_scale(residual, mask);
        noise
    }

    /// Estimated from a residual: orders up to `most_order` by the Schwarz criterion.
    pub fn estimate(residual: &Series, outputs: usize, mask: &Mask, most_order: usize) -> Self {
        let ar = (0..outputs)
            .map(|o| {
                let columns: Vec<(&Vec<f64>, &Vec<bool>)> =
                    residual.iter().zip(mask).skip(o).step_by(outputs).collect();
                autoregression(&columns, most_order)
            })
            .collect();
        let mut noise = Self {
            ar,
            scale: vec![1.0; outputs],
            degrees: f64::INFINITY,
        };
        noise.fit_scale(residual, mask);
        noise.fit_degrees(residual, mask);
        noise
    }

    /// Numbers that the noise model has.
    pub fn len(&self) -> usize {
        self.ar.iter().map(Vec::len).sum::<usize>()
            + self.scale.len()
            + usize::from(self.degrees.is_finite())
    }

    /// Whitened and scaled series.
    pub fn whiten(&self, series: &Series) -> Series {
        series
            .iter()
            .enumerate()
            .map(|(s, column)| {
                let o = s % self.ar.len();
                filter(&self.ar[o], column, 1.0 / self.scale[o])
            })
            .collect()
    }

    /// `-2 log` of the density of one whitened, scaled value, up to the constant of the distribution.
    pub fn cost(&self, e: f64) -> f64 {
        if self.degrees.is_finite() {
            (self.degrees + 1.0) * (e * e / self.degrees).ln_1p()
        } else {
            e * e
        }
    }

    /// Weight of one whitened value in a least-squares step.
    pub fn weight(&self, e: f64) -> f64 {
        if self.degrees.is_finite() {
            (self.degrees + 1.0) / (self.degrees + e * e)
        } else {
            1.0
        }
    }

    /// `-2 log` likelihood of a residual.
    pub fn deviance(&self, residual: &Series, mask: &Mask) -> f64 {
        let constant = self.constant();
        self.whiten(residual)
            .iter()
            .zip(mask)
            .enumerate()
            .map(|(s, (column, mask))| {
                let log_scale = 2.0 * self.scale[s % self.scale.len()].ln();
                kept(column, mask)
                    .map(|e| self.cost(e) + log_scale + constant)
                    .sum::<f64>()
            })
            .sum()
    }

    /// `-2 log` of the normalising constant of the distribution.
    fn constant(&self) -> f64 {
        let v = self.degrees;
        if v.is_finite() {
            -2.0 * (ln_gamma(0.5 * (v + 1.0))
                - ln_gamma(0.5 * v)
                - 0.5 * (v * std::f64::consts::PI).ln())
        } else {
            (std::f64::consts::TAU).ln()
        }
    }

    /// Scales of largest likelihood for the present filters and degrees of freedom.
    fn fit_scale(&mut self, residual: &Series, mask: &Mask) {
        let outputs = self.scale.len();
        self.scale = vec![1.0; outputs];
        let whitened = self.whiten(residual);
        for o in 0..outputs {
            let values = || {
                whitened
                    .iter()
                    .zip(mask)
                    .skip(o)
                    .step_by(outputs)
                    .flat_map(|(column, mask)| kept(column, mask))
            };
            let n = values().count().max(1) as f64;
            let mut square = values().map(|e| e * e).sum::<f64>() / n;
            if self.degrees.is_finite() {
                for _ in 0..30 {
                    let v = self.degrees;
                    let next = values()
                        .map(|e| (v + 1.0) * e * e / (v + e * e / square.max(1e-300)))
                        .sum::<f64>()
                        / n;
                    let done = (next / square - 1.0).abs() < 1e-6;
                    square = next;
                    if done {
                        break;
                    }
                }
            }
            self.scale[o] = square.sqrt().max(1e-150);
        }
    }

    fn fit_degrees(&mut self, residual: &Series, mask: &Mask) {
        // Gaussian unless the fourth moment says otherwise: the t family is then searched.
        let whitened = self.whiten(residual);
        let (mut n, mut m2, mut m4) = (0.0, 0.0, 0.0);
        for (column, mask) in whitened.iter().zip(mask) {
            for e in kept(column, mask) {
                n += 1.0;
                m2 += e * e;
                m4 += e.powi(4);
            }
        }
        let kurtosis = if m2 > 0.0 { n * m4 / (m2 * m2) } else { 3.0 };
        // Standard error of the kurtosis of n Gaussian values: sqrt(24/n).
        if kurtosis < 3.0 + 4.0 * (24.0_f64 / f64::max(n, 1.0)).sqrt() {
            return;
        }
        let mut best = self.clone();
        let mut least = f64::INFINITY;
        for degrees in DEGREES {
            let mut trial = self.clone();
            trial.degrees = degrees;
            trial.fit_scale(residual, mask);
            let deviance = trial.deviance(residual, mask);
            if deviance < least {
                least = deviance;
                best = trial;
            }
        }
        *self = best;
    }
}

fn kept<'a>(column: &'a [f64], mask: &'a [bool]) -> impl Iterator<Item = f64> + 'a {
    column
        .iter()
        .zip(mask)
        .filter_map(|(e, keep)| keep.then_some(*e))
}

/// `gain * (v[k] + ar[0] v[k-1] + ...)`, from rest.
pub(crate) fn filter(ar: &[f64], v: &[f64], gain: f64) -> Vec<f64> {
    macro_rules! dispatch {
        ($($p:literal)*) => {
            match ar.len() {
                $($p => filter_of_order::<$p>(ar, v, gain),)*
                _ => Vec::new(),
            }
        };
    }
    debug_assert!(ar.len() <= MOST_ORDER);
    dispatch!(0 1 2 3 4 5 6 7 8)
}

/// Values that are filtered together: a register of sums each, so that the loop over lags is one of vectors.
const TOGETHER: usize = 8;

/// The same with the order known to the compiler.
fn filter_of_order<const P: usize>(ar: &[f64], v: &[f64], gain: f64) -> Vec<f64> {
    let mut coefficients = [0.0; P];
    for (c, a) in coefficients.iter_mut().zip(ar) {
        *c = gain * a;
    }
    let mut out = Vec::with_capacity(v.len());
    for k in 0..v.len().min(P) {
        let past: f64 = (0..k).map(|i| coefficients[i] * v[k - 1 - i]).sum();
        out.push(gain * v[k] + past);
    }
    let mut at = out.len();
    while at + TOGETHER <= v.len() {
        let mut sums = [0.0; TOGETHER];
        for (sum, now) in sums.iter_mut().zip(&v[at..at + TOGETHER]) {
            *sum = gain * now;
        }
        for (i, c) in coefficients.iter().enumerate() {
            let from = at - 1 - i;
            for (sum, past) in sums.iter_mut().zip(&v[from..from + TOGETHER]) {
                *sum += c * past;
            }
        }
        out.extend_from_slice(&sums);
        at += TOGETHER;
    }
    for k in at..v.len() {
        let past: f64 = (0..P).map(|i| coefficients[i] * v[k - 1 - i]).sum();
        out.push(gain * v[k] + past);
    }
    out
}

/// Autoregression by Levinson and Durbin on the biased autocovariance (always stable), order by Schwarz.
fn autoregression(columns: &[(&Vec<f64>, &Vec<bool>)], most_order: usize) -> Vec<f64> {
    // About the mean: a constant is an offset to be explained, not colour with a pole at one.
    let (mut n, mut total) = (0usize, 0.0);
    for (v, mask) in columns {
        for value in kept(v, mask) {
            n += 1;
            total += value;
        }
    }
    let mean = total / n.max(1) as f64;
    let mut covariance = vec![0.0; most_order + 1];
    for (v, mask) in columns {
        for (lag, sum) in covariance.iter_mut().enumerate() {
            for k in lag..v.len() {
                if mask[k] && mask[k - lag] {
                    *sum += (v[k] - mean) * (v[k - lag] - mean);
                }
            }
        }
    }
    if n < 4 * most_order + 16 || covariance[0] <= 0.0 {
        return Vec::new();
    }
    let samples = n as f64;
    let mut ar: Vec<f64> = Vec::new();
    let mut variance = covariance[0];
    let (mut best, mut least) = (Vec::new(), samples * variance.ln());
    for order in 1..=most_order {
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
        if criterion < least {
            least = criterion;
            best = ar.clone();
        }
    }
    best
}
