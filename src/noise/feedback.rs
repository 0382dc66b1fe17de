//! Whether the inputs of a recording react to its noise.
//!
//! Feedback shows as residuals that foretell what the input will do beyond its own past (C. W. J. Granger, *Econometrica* 37, 1969).

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::{Mask, Series};

/// Samples of the input's own past, and of the residuals, that its next value is regressed on.
const OWN_PAST: usize = 16;
const REACTS_WITHIN: usize = 6;
/// Probability by chance below which the residuals foretell the input.
const LEVEL: f64 = 1e-6;
/// Share of what an input does of itself that the residuals must foretell to mislead a fit: long recordings show the least.
const SHARE: f64 = 0.02;

/// The inputs that white residuals foretell; `inputs` are columns of each recording.
///
/// Residuals of samples before are feedback. That of the same sample may also be an input that acts before it is written down, such as
/// the rain of a day: it counts only where outputs that were simulated from the inputs (`simulated`) say that the input acts against it.
pub(crate) fn inputs_foretold(
    innovations: &Series,
    mask: &Mask,
    inputs: &[&[Vec<f64>]],
    simulated: Option<&Series>,
) -> Vec<usize> {
    let count = inputs.first().map_or(0, |columns| columns.len());
    let reacts = |input: &usize| {
        let reaction = |first| Reaction::of(innovations, mask, inputs, *input, first);
        let certain = |r: &Reaction| r.share > SHARE && r.p_value * (count as f64) < LEVEL;
        let at_once = || {
            let reaction = reaction(0).filter(certain)?;
            let simulated = simulated?;
            Some(reaction.opposes(simulated, inputs, *input))
        };
        reaction(1).is_some_and(|r| certain(&r)) || at_once().unwrap_or(false)
    };
    (0..count).filter(reacts).collect()
}

/// What residuals foretell of an input.
struct Reaction {
    /// Share of what the input does of itself.
    share: f64,
    /// Probability by chance.
    p_value: f64,
    /// How the input follows its own past: a constant, and a coefficient a sample.
    own: DVector<f64>,
    /// How it follows the first residual that counts, one an output.
    at_first: Vec<f64>,
}

impl Reaction {
    /// The first residual that counts is that of `first` samples before.
    fn of(
        innovations: &Series,
        mask: &Mask,
        inputs: &[&[Vec<f64>]],
        input: usize,
        first: usize,
    ) -> Option<Self> {
        let outputs = innovations.len() / inputs.len().max(1);
        let own = 1 + OWN_PAST;
        let lags = REACTS_WITHIN - first;
        let all = own + outputs * lags;
        let (mut normal, mut product) = (DMatrix::zeros(all, all), DVector::zeros(all));
        let (mut total, mut rows) = (0.0, 0usize);
        let mut row = DVector::zeros(all);
        for (r, columns) in inputs.iter().enumerate() {
            let u = standardised(&columns[input]);
            let e: Vec<Vec<f64>> = (innovations[r * outputs..][..outputs].iter())
                .map(|e| standardised(e))
                .collect();
            for t in OWN_PAST.max(REACTS_WITHIN)..u.len() {
                row.rows_mut(0, own).copy_from(&past(&u, t));
                let mut counts = true;
                for o in 0..outputs {
                    for lag in 0..lags {
                        let k = t - first - lag;
                        counts &= mask[r * outputs + o][k];
                        row[own + o * lags + lag] = e[o][k];
                    }
                }
                if !counts || !u[t].is_finite() || row.iter().any(|v| !v.is_finite()) {
                    continue;
                }
                normal.ger(1.0, &row, &row, 1.0);
                product.axpy(u[t], &row, 1.0);
                total += u[t] * u[t];
                rows += 1;
            }
        }
        if rows < 2 * all || total <= 0.0 {
            return None;
        }
        let solved = |columns: usize| -> Option<(DVector<f64>, f64)> {
            let normal: DMatrix<f64> = normal.view((0, 0), (columns, columns)).into_owned();
            let product: DVector<f64> = product.rows(0, columns).into_owned();
            // Columns that do the same (an input that stands still) are held by a ridge far below rounding of the data.
            let ridge = 1e-12 * normal.trace() / columns as f64;
            let held = normal + DMatrix::identity(columns, columns) * ridge;
            let solution = held.cholesky()?.solve(&product);
            let left = (total - product.dot(&solution)).max(f64::EPSILON * total);
            Some((solution, left))
        };
        let ((of_own, without), (of_all, with)) = (solved(own)?, solved(all)?);
        let statistic = rows as f64 * (without / with).ln();
        let law = ChiSquared::new((outputs * lags) as f64).ok()?;
        Some(Self {
            share: 1.0 - with / without,
            p_value: law.sf(statistic.max(0.0)),
            own: of_own,
            at_first: (0..outputs).map(|o| of_all[own + o * lags]).collect(),
        })
    }

    /// Whether the input moves the output that it follows most against what it follows, by the responses of simulated outputs to what
    /// the input does of itself.
    fn opposes(&self, simulated: &Series, inputs: &[&[Vec<f64>]], input: usize) -> bool {
        let outputs = self.at_first.len();
        let most = |a: &usize, b: &usize| {
            let size = |o: usize| self.at_first[o].abs();
            size(*a).total_cmp(&size(*b))
        };
        let Some(output) = (0..outputs).max_by(most) else {
            return false;
        };
        let mut response = 0.0;
        for (r, columns) in inputs.iter().enumerate() {
            let u = standardised(&columns[input]);
            let y = &simulated[r * outputs + output];
            let own = |t: usize| u[t] - past(&u, t).dot(&self.own);
            for t in OWN_PAST..u.len().saturating_sub(OWN_PAST) {
                let moved = y[t + OWN_PAST] - y[t];
                let product = own(t) * moved;
                response += if product.is_finite() { product } else { 0.0 };
            }
        }
        response * self.at_first[output] < 0.0
    }
}

/// A constant and the values before `t`.
fn past(u: &[f64], t: usize) -> DVector<f64> {
    DVector::from_fn(
        1 + OWN_PAST,
        |lag, _| if lag == 0 { 1.0 } else { u[t - lag] },
    )
}

/// Values about their mean, in standard deviations.
fn standardised(values: &[f64]) -> Vec<f64> {
    let finite = || values.iter().filter(|v| v.is_finite());
    let count = finite().count().max(1) as f64;
    let mean = finite().sum::<f64>() / count;
    let variance = finite().map(|v| (v - mean).powi(2)).sum::<f64>() / count;
    let scale = variance.sqrt().max(f64::MIN_POSITIVE);
    values.iter().map(|v| (v - mean) / scale).collect()
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};

    use super::*;

    /// An input of steps, of its own or answering the residual of so many samples before.
    fn recorded(gain: f64, before: usize) -> (Series, Mask, Vec<Vec<f64>>) {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        let mut uniform = || random.random::<f64>() - 0.5;
        let e: Vec<f64> = (0..2000).map(|_| uniform()).collect();
        let mut level = 0.0;
        let u = (0..2000usize).map(|k| {
            if k % 25 == 0 {
                level = uniform();
            }
            let answer = k.checked_sub(before).map_or(0.0, |k| gain * e[k]);
            level + answer
        });
        let u: Vec<f64> = u.collect();
        (vec![e], vec![vec![true; 2000]], vec![u])
    }

    #[test]
    fn an_input_that_answers_residuals_is_told_from_one_that_does_not() {
        for (gain, feeds_back) in [(0.0, false), (0.005, false), (0.2, true)] {
            let (e, mask, inputs) = recorded(gain, 2);
            let found = inputs_foretold(&e, &mask, &[&inputs], None);
            assert_eq!(!found.is_empty(), feeds_back, "{gain}");
        }
    }

    /// A controller that acts at once works against the residual. An input that acts before it is written down leaves its own changes
    /// in the residual, with the sign of what it does.
    #[test]
    fn an_input_that_acts_early_is_no_feedback() {
        for (gain, early, feeds_back) in [(-0.2, 0.0, true), (0.0, 0.5, false)] {
            let (mut e, mask, inputs) = recorded(gain, 0);
            let u = &inputs[0];
            for k in 1..u.len() {
                e[0][k] += early * (u[k] - u[k - 1]);
            }
            let mut y = 0.0;
            let simulated = u.iter().map(|u| {
                y = 0.9 * y + 0.1 * u;
                y
            });
            let simulated = vec![simulated.collect()];
            let found = inputs_foretold(&e, &mask, &[&inputs], Some(&simulated));
            assert_eq!(!found.is_empty(), feeds_back, "{gain} {early}");
        }
    }
}
