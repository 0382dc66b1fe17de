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

/// The inputs that white residuals foretell; `inputs` are columns of each recording. The last residual that counts is that of `first`
/// samples before.
pub(crate) fn inputs_foretold(
    innovations: &Series,
    mask: &Mask,
    inputs: &[&[Vec<f64>]],
    first: usize,
) -> Vec<usize> {
    let count = inputs.first().map_or(0, |columns| columns.len());
    let reacts = |input: &usize| {
        let reaction = reaction(innovations, mask, inputs, *input, first);
        reaction.is_some_and(|(share, p)| share > SHARE && p * (count as f64) < LEVEL)
    };
    (0..count).filter(reacts).collect()
}

/// The share of an input's own doing that past residuals foretell, and its probability by chance.
fn reaction(
    innovations: &Series,
    mask: &Mask,
    inputs: &[&[Vec<f64>]],
    input: usize,
    first: usize,
) -> Option<(f64, f64)> {
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
        let begins = OWN_PAST.max(REACTS_WITHIN);
        for t in begins..u.len() {
            row[0] = 1.0;
            for lag in 1..=OWN_PAST {
                row[lag] = u[t - lag];
            }
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
    let left = |columns: usize| -> Option<f64> {
        let normal: DMatrix<f64> = normal.view((0, 0), (columns, columns)).into_owned();
        let product: DVector<f64> = product.rows(0, columns).into_owned();
        // Columns that do the same (an input that stands still) are held by a ridge far below rounding of the data.
        let ridge = 1e-12 * normal.trace() / columns as f64;
        let held = normal + DMatrix::identity(columns, columns) * ridge;
        let solution = held.cholesky()?.solve(&product);
        Some((total - product.dot(&solution)).max(f64::EPSILON * total))
    };
    if rows < 2 * all || total <= 0.0 {
        return None;
    }
    let (without, with) = (left(own)?, left(all)?);
    let statistic = rows as f64 * (without / with).ln();
    let law = ChiSquared::new((outputs * lags) as f64).ok()?;
    Some((1.0 - with / without, law.sf(statistic.max(0.0))))
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
    use super::*;

    /// An input of steps, of its own or answering the residual of two samples before.
    fn recorded(gain: f64) -> (Series, Mask, Vec<Vec<f64>>) {
        let mut state = 7u64;
        let mut uniform = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 33) as f64 / f64::from(1u32 << 31) - 0.5
        };
        let e: Vec<f64> = (0..2000).map(|_| uniform()).collect();
        let mut level = 0.0;
        let u = (0..2000).map(|k| {
            if k % 25 == 0 {
                level = uniform();
            }
            let answer = match k {
                0 | 1 => 0.0,
                _ => gain * e[k - 2],
            };
            level + answer
        });
        let u: Vec<f64> = u.collect();
        (vec![e], vec![vec![true; 2000]], vec![u])
    }

    #[test]
    fn an_input_that_answers_residuals_is_told_from_one_that_does_not() {
        for (gain, feeds_back) in [(0.0, false), (0.005, false), (0.2, true)] {
            let (e, mask, inputs) = recorded(gain);
            assert_eq!(
                !inputs_foretold(&e, &mask, &[&inputs], 0).is_empty(),
                feeds_back,
                "{gain}"
            );
        }
    }
}
