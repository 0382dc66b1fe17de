//! What the difference of two recordings of the same thing looks like: coloured, perhaps with heavy tails.
//!
//! Each output's residual is an ARMA process, its innovations Student's t with a common number of degrees of freedom:
//! without the colour, slow noise looks like slow physics; without the tails, a few large errors look like effects
//! (math/explain.md, choice 3: together they take the false alarms on the hard nulls from 4 of 8 to none).

mod colour;
mod effective;
mod estimate;
mod feedback;
mod switching;

use statrs::function::gamma::ln_gamma;

pub(crate) use self::colour::Colour;
pub(crate) use self::effective::effective_samples;
pub(crate) use self::estimate::Colours;
pub(crate) use self::feedback::inputs_foretold;
pub(crate) use self::switching::inputs_switched;

/// Degrees of freedom that are tried; infinity is Gaussian.
const DEGREES: [f64; 6] = [3.0, 4.0, 6.0, 10.0, 20.0, f64::INFINITY];

/// A noise model: a whitening filter and the distribution of what comes out of it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Noise {
    /// One an output.
    pub(crate) colours: Vec<Colour>,
    /// Scale of the whitened residual, one an output.
    pub(crate) scale: Vec<f64>,
    /// Degrees of freedom of Student's t; infinite for Gaussian.
    pub(crate) degrees: f64,
}

/// Part of the mean square of a residual that a noise model leaves, at most, where it may stand for physics.
const ABSORBED: f64 = 0.1;

/// A column a recording and output (`recording * outputs + output`): residuals, simulated outputs, weights.
pub(crate) type Series = Vec<Vec<f64>>;

/// Which samples count: `false` is left out of every sum.
pub(crate) type Mask = Vec<Vec<bool>>;

impl Noise {
    /// White and Gaussian, of size 1.
    pub(crate) fn unit(outputs: usize) -> Self {
        Self {
            colours: vec![Colour::default(); outputs],
            scale: vec![1.0; outputs],
            degrees: f64::INFINITY,
        }
    }

    /// White and Gaussian, of the residual's size.
    pub(crate) fn white(residual: &Series, outputs: usize, mask: &Mask) -> Self {
        let mut noise = Self::unit(outputs);
        let squares = noise.squares(residual, mask);
        noise.fit_scale(&squares, &vec![0.0; outputs]);
        noise
    }

    /// Estimated from a residual: the colour by Schwarz's criterion among `colours`.
    pub(crate) fn estimate(
        residual: &Series,
        outputs: usize,
        mask: &Mask,
        colours: Colours,
    ) -> Self {
        Self::estimate_above(residual, mask, colours, &vec![0.0; outputs])
    }

    /// The same with scales that are no smaller than `least`, one an output: of a recording with few digits most of a residual may be
    /// exactly zero, and the likelihood of heavy tails has no bound then (C. Fernandez and M. F. J. Steel, *Biometrika* 86, 1999).
    pub(crate) fn estimate_above(
        residual: &Series,
        mask: &Mask,
        colours: Colours,
        least: &[f64],
    ) -> Self {
        let outputs = least.len();
        let mut noise = Self {
            colours: (0..outputs)
                .map(|o| estimate::colour(residual, outputs, o, mask, colours))
                .collect(),
            scale: vec![1.0; outputs],
            degrees: f64::INFINITY,
        };
        let squares = noise.squares(residual, mask);
        noise.fit_scale(&squares, least);
        noise.fit_degrees(&squares, least);
        noise
    }

    /// Whether the colours of this noise model take up most of a residual, so that they may stand for physics.
    pub(crate) fn absorbs(&self, residual: &Series, mask: &Mask) -> bool {
        let white = Self::white(residual, self.scale.len(), mask);
        let mut each = white.scale.iter().zip(&self.scale);
        each.any(|(whole, new)| new * new < ABSORBED * whole * whole)
    }

    /// Numbers that the noise model has.
    pub(crate) fn len(&self) -> usize {
        self.colours.iter().map(Colour::len).sum::<usize>()
            + self.scale.len()
            + usize::from(self.degrees.is_finite())
    }

    /// Whitened and scaled series; what does not count is zero.
    pub(crate) fn whiten(&self, series: &Series, mask: &Mask) -> Series {
        let mut kept = self.whiten_kept(series, mask).into_iter();
        let mut placed = |counts: &bool| match counts {
            true => kept.next().unwrap_or(0.0),
            false => 0.0,
        };
        let each = series.iter().zip(mask);
        each.map(|(_, mask)| mask.iter().map(&mut placed).collect())
            .collect()
    }

    /// The values that count, whitened and scaled, one series after the other.
    pub(crate) fn whiten_kept(&self, series: &Series, mask: &Mask) -> Vec<f64> {
        let mut out = Vec::with_capacity(mask.iter().map(Vec::len).sum());
        for (s, (column, mask)) in series.iter().zip(mask).enumerate() {
            let o = s % self.scale.len();
            each_stretch(column, mask, |values| {
                self.colours[o].whiten(values, 1.0 / self.scale[o], &mut out);
            });
        }
        out
    }

    /// `-2 log` density of one whitened value, but for a constant.
    pub(crate) fn loss(&self, e: f64) -> f64 {
        if self.degrees.is_finite() {
            (self.degrees + 1.0) * (e * e / self.degrees).ln_1p()
        } else {
            e * e
        }
    }

    /// Weight of one whitened value in a least-squares step.
    pub(crate) fn weight(&self, e: f64) -> f64 {
        if self.degrees.is_finite() {
            (self.degrees + 1.0) / (self.degrees + e * e)
        } else {
            1.0
        }
    }

    /// `-2 log` likelihood of a residual.
    pub(crate) fn deviance(&self, residual: &Series, mask: &Mask) -> f64 {
        let mut squares = Vec::new();
        let mut deviance = 0.0;
        for (s, (column, mask)) in residual.iter().zip(mask).enumerate() {
            let o = s % self.scale.len();
            squares.clear();
            each_stretch(column, mask, |values| {
                self.colours[o].whiten(values, 1.0 / self.scale[o], &mut squares);
                deviance += self.colours[o].log_determinant(values.len());
            });
            for value in &mut squares {
                *value *= *value;
            }
            deviance += self.deviance_of(&squares, 1.0, self.scale[o]);
        }
        deviance
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
        let outputs = self.scale.len();
        let mut squares = vec![Vec::new(); outputs];
        for (s, (column, mask)) in residual.iter().zip(mask).enumerate() {
            each_stretch(column, mask, |values| {
                self.colours[s % outputs].whiten(values, 1.0, &mut squares[s % outputs]);
            });
        }
        for value in squares.iter_mut().flatten() {
            *value *= *value;
        }
        squares
    }

    /// Scales of largest likelihood, of at least `least`, for the present filters and degrees of freedom.
    fn fit_scale(&mut self, squares: &[Vec<f64>], least: &[f64]) {
        for ((scale, squares), least) in self.scale.iter_mut().zip(squares).zip(least) {
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
            *scale = square.sqrt().max(*least).max(1e-150);
        }
    }

    /// Gaussian unless the fourth moment says otherwise: the t family is then searched.
    fn fit_degrees(&mut self, squares: &[Vec<f64>], least_scale: &[f64]) {
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
            trial.fit_scale(squares, least_scale);
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
pub(crate) fn product(a: &[f64], b: &[f64]) -> f64 {
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

/// Values that are summed together: a register of sums each.
const TOGETHER: usize = 8;

/// Calls `of` with each stretch of values that count. Where most of them stand alone, as those of every fourth sample do, they
/// follow each other: a noise model is then one of these values. For irregular times that is an approximation.
fn each_stretch(column: &[f64], mask: &[bool], mut of: impl FnMut(&[f64])) {
    if let Some(kept) = standing_alone(column, mask) {
        of(&kept);
        return;
    }
    let mut from = 0;
    // Nearly all count: stretches are taken whole.
    while let Some(skip) = mask[from..].iter().position(|keep| *keep) {
        from += skip;
        let to = from
            + mask[from..]
                .iter()
                .position(|keep| !keep)
                .unwrap_or(mask.len() - from);
        of(&column[from..to]);
        from = to;
    }
}

/// The values that count, where most of them have no neighbour.
fn standing_alone(column: &[f64], mask: &[bool]) -> Option<Vec<f64>> {
    stand_alone(mask).then(|| kept(column, mask))
}

/// Whether most of what counts has no neighbour that counts.
pub(crate) fn stand_alone(mask: &[bool]) -> bool {
    let count = mask.iter().filter(|keep| **keep).count();
    let followed = mask.windows(2).filter(|w| w[0] && w[1]).count();
    2 * followed < count && count < mask.len()
}

/// The values that count, one after the other.
pub(crate) fn kept(column: &[f64], mask: &[bool]) -> Vec<f64> {
    let kept = column.iter().zip(mask).filter(|(_, keep)| **keep);
    kept.map(|(v, _)| *v).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StudentT};

    #[test]
    fn values_that_stand_alone_follow_each_other() {
        let dense: Vec<f64> = (0..300)
            .map(|k| (f64::from(k) * 0.37).sin() + 0.1)
            .collect();
        let mut sparse = vec![9.0; 1200];
        let mut mask = vec![false; 1200];
        for (k, v) in dense.iter().enumerate() {
            sparse[4 * k + 1] = *v;
            mask[4 * k + 1] = true;
        }
        let (every, fourth) = (vec![dense.clone()], vec![sparse]);
        let (all, some) = (vec![vec![true; 300]], vec![mask]);
        let noise = Noise::estimate(&every, 1, &all, Colours::All);
        assert!(noise.colours[0].len() > 0);
        assert_eq!(noise, Noise::estimate(&fourth, 1, &some, Colours::All));
        assert_eq!(noise.deviance(&every, &all), noise.deviance(&fourth, &some));
        let whitened = noise.whiten(&fourth, &some);
        assert_eq!(whitened[0][1], noise.whiten(&every, &all)[0][0]);
        assert_eq!(whitened[0][0], 0.0);
    }

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
        let noise = Noise::estimate(&residual, 2, &mask, Colours::All);
        for (colour, (scale, truth)) in noise
            .colours
            .iter()
            .zip(noise.scale.iter().zip([0.1, 20.0]))
        {
            assert!((colour.ar[0] + 0.8).abs() < 0.05, "{colour:?}");
            assert!((scale / truth - 1.0).abs() < 0.1, "{scale}");
        }
        assert!(noise.degrees <= 4.0, "{}", noise.degrees);
        // Coefficients and a size an output, and the degrees.
        let coefficients: usize = noise.colours.iter().map(Colour::len).sum();
        assert_eq!(noise.len(), coefficients + 2 + 1);
        // Its likelihood, by the density of Student's t.
        let v = noise.degrees;
        let whitened = noise.whiten(&residual, &mask);
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
        let starts: f64 = noise.colours.iter().map(|c| c.log_determinant(4000)).sum();
        let deviance = noise.deviance(&residual, &mask);
        assert!((deviance / (literal + starts) - 1.0).abs() < 1e-10);
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
    fn what_the_mask_leaves_out_does_not_count() {
        let (mut residual, mut mask) = heavy(1000);
        for (column, mask) in residual.iter_mut().zip(&mut mask) {
            column[400..500].fill(1e6);
            mask[400..500].fill(false);
        }
        let noise = Noise::estimate(&residual, 2, &mask, Colours::All);
        assert!(noise.scale[0] < 0.3 && noise.scale[1] < 60.0, "{noise:?}");
        let whitened = noise.whiten(&residual, &mask);
        assert_eq!(whitened[0][450], 0.0);
        let counted = whitened
            .iter()
            .zip(&mask)
            .flat_map(|(e, m)| e.iter().zip(m));
        let counted: Vec<f64> = counted
            .filter(|(_, keep)| **keep)
            .map(|(e, _)| *e)
            .collect();
        assert_eq!(counted, noise.whiten_kept(&residual, &mask));
    }

    #[test]
    fn white_noise_is_gaussian_of_its_size() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(8);
        let normal = rand_distr::StandardNormal;
        let series: Series = vec![(0..3000).map(|_| normal.sample(&mut random)).collect()];
        let mask = vec![vec![true; 3000]];
        let noise = Noise::estimate(&series, 1, &mask, Colours::White);
        assert_eq!((noise.colours[0].len(), noise.degrees), (0, f64::INFINITY));
        assert!((noise.scale[0] - 1.0).abs() < 0.05);
        assert_eq!(noise.len(), 1);
        let squares: f64 = noise
            .whiten_kept(&series, &mask)
            .iter()
            .map(|e| e * e)
            .sum();
        let literal = squares + 3000.0 * (2.0 * noise.scale[0].ln() + std::f64::consts::TAU.ln());
        assert!((noise.deviance(&series, &mask) - literal).abs() < 1e-8);
    }
    /// With three quarters of the values exactly zero the scale of Student's t goes to zero; rounding bounds it.
    #[test]
    fn a_scale_is_no_finer_than_the_rounding() {
        let residual: Series = vec![(0..1000).map(|k| if k < 125 { 0.1 } else { 0.0 }).collect()];
        let mask = vec![vec![true; 1000]];
        let of =
            |least: f64| Noise::estimate_above(&residual, &mask, Colours::White, &[least]).scale[0];
        assert!(of(0.0) < 1e-5, "{}", of(0.0));
        assert_eq!(of(0.03), 0.03);
    }
}
