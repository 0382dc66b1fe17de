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
        let squares = noise.squares(residual, mask);
        noise.fit_scale(&squares);
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
        let squares = noise.squares(residual, mask);
        noise.fit_scale(&squares);
        noise.fit_degrees(&squares);
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
        self.whiten(residual)
            .iter()
            .zip(mask)
            .enumerate()
            .map(|(s, (column, mask))| {
                let mut squares = Vec::with_capacity(column.len());
                extend_with_kept(&mut squares, column, mask);
                for value in &mut squares {
                    *value *= *value;
                }
                self.deviance_of(&squares, 1.0, self.scale[s % self.scale.len()])
            })
            .sum()
    }

    /// The same of an output's squared values, which are in units of `unit`, where the whitening filter divides by `scale`.
    fn deviance_of(&self, squares: &[f64], unit: f64, scale: f64) -> f64 {
        let cost = if self.degrees.is_finite() {
            let share = 1.0 / (self.degrees * unit);
            (self.degrees + 1.0) * sum_of_logarithms(squares, share)
        } else {
            squares.iter().sum::<f64>() / unit
        };
        cost + squares.len() as f64 * (2.0 * scale.ln() + self.constant())
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

    /// Squared values that the whitening filters make of a residual, not scaled: a list an output.
    fn squares(&self, residual: &Series, mask: &Mask) -> Vec<Vec<f64>> {
        let outputs = self.ar.len();
        let mut squares = vec![Vec::new(); outputs];
        for (s, (column, mask)) in residual.iter().zip(mask).enumerate() {
            let whitened = filter(&self.ar[s % outputs], column, 1.0);
            extend_with_kept(&mut squares[s % outputs], &whitened, mask);
        }
        for value in squares.iter_mut().flatten() {
            *value *= *value;
        }
        squares
    }

    /// Scales of largest likelihood for the present filters and degrees of freedom.
    fn fit_scale(&mut self, squares: &[Vec<f64>]) {
        for (scale, squares) in self.scale.iter_mut().zip(squares) {
            let n = squares.len().max(1) as f64;
            let mut square = squares.iter().sum::<f64>() / n;
            if self.degrees.is_finite() {
                for _ in 0..30 {
                    let v = self.degrees;
                    let share = 1.0 / square.max(1e-300);
                    let next = (v + 1.0) * sum(squares, |q| q / (v + q * share)) / n;
                    let done = (next / square - 1.0).abs() < 1e-6;
                    square = next;
                    if done {
                        break;
                    }
                }
            }
            *scale = square.sqrt().max(1e-150);
        }
    }

    /// Gaussian unless the fourth moment says otherwise: the t family is then searched.
    fn fit_degrees(&mut self, squares: &[Vec<f64>]) {
        let (mut n, mut m2, mut m4) = (0.0, 0.0, 0.0);
        for (squares, scale) in squares.iter().zip(&self.scale) {
            let unit = scale * scale;
            n += squares.len() as f64;
            m2 += sum(squares, |q| q / unit);
            m4 += sum(squares, |q| (q / unit) * (q / unit));
        }
        let kurtosis = if m2 > 0.0 { n * m4 / (m2 * m2) } else { 3.0 };
        // Standard error of the kurtosis of n Gaussian values: sqrt(24/n).
        if kurtosis < 3.0 + 4.0 * (24.0_f64 / f64::max(n, 1.0)).sqrt() {
            return;
        }
        let mut least = f64::INFINITY;
        for degrees in DEGREES {
            let mut trial = Self {
                degrees,
                ..self.clone()
            };
            trial.fit_scale(squares);
            let deviance = squares
                .iter()
                .zip(&trial.scale)
                .map(|(squares, scale)| trial.deviance_of(squares, scale * scale, *scale))
                .sum();
            if deviance < least {
                least = deviance;
                *self = trial;
            }
        }
    }
}

/// Appends the values that count to `out`.
pub(crate) fn extend_with_kept(out: &mut Vec<f64>, column: &[f64], mask: &[bool]) {
    let mut from = 0;
    // Nearly all count: stretches are copied whole.
    while let Some(skip) = mask[from..].iter().position(|keep| *keep) {
        from += skip;
        let length = mask[from..]
            .iter()
            .position(|keep| !keep)
            .unwrap_or(mask.len() - from);
        out.extend_from_slice(&column[from..from + length]);
        from += length;
    }
}

/// The values of all series that count, one after the other.
pub(crate) fn kept(series: &Series, mask: &Mask) -> Vec<f64> {
    let mut out = Vec::with_capacity(mask.iter().map(Vec::len).sum());
    for (column, mask) in series.iter().zip(mask) {
        extend_with_kept(&mut out, column, mask);
    }
    out
}

/// `sum of(value)`, in as many partial sums as are made at once.
fn sum(values: &[f64], of: impl Fn(f64) -> f64) -> f64 {
    let chunks = values.chunks_exact(TOGETHER);
    let rest: f64 = chunks.remainder().iter().map(|v| of(*v)).sum();
    let mut sums = [0.0; TOGETHER];
    for chunk in chunks {
        for (sum, value) in sums.iter_mut().zip(chunk) {
            *sum += of(*value);
        }
    }
    rest + sums.iter().sum::<f64>()
}

/// `sum v^2`.
pub(crate) fn sum_of_squares(values: &[f64]) -> f64 {
    product(values, values)
}

/// `sum a b` over as many as the shorter has, in as many partial sums as are made at once.
fn product(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().min(b.len());
    let (a, b) = (a[..n].chunks_exact(TOGETHER), b[..n].chunks_exact(TOGETHER));
    let last = a.remainder().iter().zip(b.remainder());
    let rest: f64 = last.map(|(a, b)| a * b).sum();
    let mut sums = [0.0; TOGETHER];
    for (a, b) in a.zip(b) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += a * b;
        }
    }
    rest + sums.iter().sum::<f64>()
}

/// `sum ln(1 + share value)`: the logarithm of products as long as they are numbers, which is one where there were hundreds.
fn sum_of_logarithms(values: &[f64], share: f64) -> f64 {
    const LARGE: f64 = 1e150;
    let (mut sum, mut product) = (0.0, 1.0);
    for value in values {
        let factor = 1.0 + share * value;
        if product * factor > LARGE {
            sum += f64::ln(product);
            product = factor;
        } else {
            product *= factor;
        }
    }
    sum + product.ln()
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
    let mut values = Vec::new();
    for (v, mask) in columns {
        extend_with_kept(&mut values, v, mask);
    }
    let n = values.len();
    let mean = values.iter().sum::<f64>() / n.max(1) as f64;
    let mut covariance = vec![0.0; most_order + 1];
    for (v, mask) in columns {
        // What does not count adds nothing.
        let centred: Vec<f64> = v
            .iter()
            .zip(mask.iter())
            .map(|(v, keep)| if *keep { v - mean } else { 0.0 })
            .collect();
        for (lag, total) in covariance.iter_mut().enumerate() {
            *total += product(centred.get(lag..).unwrap_or_default(), &centred);
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

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StudentT};

    #[test]
    fn products_have_the_logarithm_of_the_sum() {
        let values: Vec<f64> = (0..2000)
            .map(|k| f64::from(k % 97).powi(3) * 1e-9 * f64::from(k))
            .chain([1e-30, 1e200, 1e290, 1e160, 0.0])
            .collect();
        for share in [1e-12, 0.3, 1e5] {
            let expected: f64 = values.iter().map(|v| (share * v).ln_1p()).sum();
            let found = sum_of_logarithms(&values, share);
            assert!((found / expected - 1.0).abs() < 1e-11, "{found} {expected}");
        }
        assert!(sum_of_logarithms(&[1.0, f64::NAN, 2.0], 1.0).is_nan());
        let whole = [3.0, 4.0, 5.0].repeat(7);
        assert_eq!(sum(&whole, |v| v * v), 350.0);
        assert_eq!(product(&whole, &whole[1..]), 7.0 * 32.0 + 6.0 * 15.0);
        assert_eq!(product(&whole, &[]), 0.0);
    }

    /// An autoregression driven by Student's t with three degrees of freedom, in two outputs of other size.
    fn heavy(samples: usize) -> (Series, Mask) {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let tails = StudentT::new(3.0).unwrap();
        let series: Series = [0.1, 20.0]
            .map(|size| {
                let mut state = 0.0;
                (0..samples)
                    .map(|_| {
                        state = 0.8 * state + size * tails.sample(&mut random);
                        state
                    })
                    .collect()
            })
            .to_vec();
        let mask = vec![vec![true; samples]; 2];
        (series, mask)
    }

    #[test]
    fn colour_tails_and_sizes_are_found() {
        let (residual, mask) = heavy(4000);
        let noise = Noise::estimate(&residual, 2, &mask, MOST_ORDER);
        for (ar, (scale, truth)) in noise.ar.iter().zip(noise.scale.iter().zip([0.1, 20.0])) {
            assert!((ar[0] + 0.8).abs() < 0.05, "{ar:?}");
            assert!((scale / truth - 1.0).abs() < 0.1, "{scale}");
        }
        assert!(noise.degrees <= 4.0, "{}", noise.degrees);
        // Coefficients and a size an output, and the degrees.
        let coefficients: usize = noise.ar.iter().map(Vec::len).sum();
        assert_eq!(noise.len(), coefficients + 2 + 1);
        // Its likelihood, by the density of Student's t.
        let v = noise.degrees;
        let whitened = noise.whiten(&residual);
        let constant =
            ln_gamma(0.5 * (v + 1.0)) - ln_gamma(0.5 * v) - 0.5 * (v * std::f64::consts::PI).ln();
        let literal: f64 = whitened
            .iter()
            .zip(&noise.scale)
            .flat_map(|(e, scale)| e.iter().map(move |e| (*e, *scale)))
            .map(|(e, scale)| {
                -2.0 * (constant - scale.ln() - 0.5 * (v + 1.0) * (e * e / v).ln_1p())
            })
            .sum();
        let deviance = noise.deviance(&residual, &mask);
        assert!((deviance / literal - 1.0).abs() < 1e-10);
        // No other scale is likelier, nor a Gaussian.
        for factor in [0.97, 1.03] {
            let mut other = noise.clone();
            other.scale[0] *= factor;
            assert!(other.deviance(&residual, &mask) > deviance);
        }
        let mut normal = noise.clone();
        normal.degrees = f64::INFINITY;
        assert!(normal.deviance(&residual, &mask) > deviance + 100.0);
    }

    #[test]
    fn stretches_that_count_are_kept() {
        let values = vec![(0..7).map(f64::from).collect::<Vec<_>>(); 2];
        let mask = [
            [false, true, true, false, false, true, true],
            [true, false, false, false, false, false, false],
        ]
        .map(Vec::from)
        .to_vec();
        assert_eq!(kept(&values, &mask), [1.0, 2.0, 5.0, 6.0, 0.0]);
        assert!(kept(&values, &vec![vec![false; 7]; 2]).is_empty());
    }

    #[test]
    fn what_the_mask_leaves_out_does_not_count() {
        let (mut residual, mut mask) = heavy(1000);
        for (column, mask) in residual.iter_mut().zip(&mut mask) {
            column[400..500].fill(1e6);
            // The filters reach across the gap's end.
            mask[400..500 + MOST_ORDER].fill(false);
        }
        let noise = Noise::estimate(&residual, 2, &mask, MOST_ORDER);
        assert!(noise.scale[0] < 0.3 && noise.scale[1] < 60.0, "{noise:?}");
    }

    /// By Schwarz a coefficient that is not there is taken in half a percent of the cases for each order that is tried; by
    /// Akaike it would be in a sixth.
    #[test]
    fn white_noise_stays_white() {
        let normal = rand_distr::StandardNormal;
        let coloured = (0..40)
            .filter(|seed| {
                let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(*seed);
                let series: Series = vec![(0..3000).map(|_| normal.sample(&mut random)).collect()];
                let mask = vec![vec![true; 3000]];
                !Noise::estimate(&series, 1, &mask, MOST_ORDER).ar[0].is_empty()
            })
            .count();
        assert!(coloured <= 3, "{coloured} of 40");
    }

    #[test]
    fn white_noise_is_gaussian_of_its_size() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(8);
        let normal = rand_distr::StandardNormal;
        let series: Series = vec![(0..3000).map(|_| normal.sample(&mut random)).collect()];
        let mask = vec![vec![true; 3000]];
        let noise = Noise::estimate(&series, 1, &mask, 0);
        assert_eq!((noise.ar[0].len(), noise.degrees), (0, f64::INFINITY));
        assert!((noise.scale[0] - 1.0).abs() < 0.05);
        assert_eq!(noise.len(), 1);
        let squares: f64 = noise.whiten(&series)[0].iter().map(|e| e * e).sum();
        let literal = squares + 3000.0 * (2.0 * noise.scale[0].ln() + std::f64::consts::TAU.ln());
        assert!((noise.deviance(&series, &mask) - literal).abs() < 1e-8);
    }

    #[test]
    fn filters_of_every_order_are_the_literal_sum() {
        let v: Vec<f64> = (0..45).map(|k| f64::from(k * k % 17) - 7.0).collect();
        let all = [-0.9, 0.5, 0.3, -0.7, 0.2, 0.11, -0.4, 0.6];
        for order in 0..=MOST_ORDER {
            for n in [0, 1, order, order + 1, 20, 45] {
                let found = filter(&all[..order], &v[..n], 1.7);
                assert_eq!(found.len(), n);
                for k in 0..n {
                    let past: f64 = (0..order.min(k)).map(|i| all[i] * v[k - 1 - i]).sum();
                    let wanted = 1.7 * (v[k] + past);
                    assert!((found[k] - wanted).abs() < 1e-12, "{order} {n} {k}");
                }
            }
        }
    }
}
