//! Whether the free runs of a recording mislead: its inputs react to disturbances, or the plant adds them up.
//!
//! In a closed loop the input answers what disturbs the plant. A function of the input then follows the disturbance, and takes
//! error off a free run without being physics: least squares of the free run is biased, in blocks left out as well. One-step
//! predictions are not (L. Ljung, *System Identification*, 2nd ed. 1999, sec. 13.4: the direct method). Feedback shows as
//! residuals that foretell what the input will do beyond its own past (C. W. J. Granger, *Econometrica* 37, 1969).
//!
//! A plant that integrates adds up what disturbs it. Its free run leaves a random walk, and of two such series one seems to explain
//! the other (C. W. J. Granger and P. Newbold, *J. Econometrics* 2, 1974).

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::noise::{Mask, Series};
use crate::physics::estimate::{Fit, PlantRecording, Study};
use crate::physics::{Hold, Plant};

/// Samples of the input's own past, and of the residuals, that its next value is regressed on.
const OWN_PAST: usize = 16;
const REACTS_WITHIN: usize = 6;
/// Probability by chance below which the residuals foretell the input.
const LEVEL: f64 = 1e-6;
/// Share of what an input does of itself that the residuals must foretell for a free run to be misled: long recordings show the
/// least.
const SHARE: f64 = 0.02;

/// A pole whose time constant is longer than this many recordings integrates.
const INTEGRATES: f64 = 3.0;
/// Samples of a recording at which a plant is linearised.
const LOOKED_AT: usize = 16;

/// Logarithm of what a small difference grows by over a recording, by the poles along it; none where the plant cannot be simulated.
pub(crate) fn growth(
    plant: &Plant,
    study: &Study,
    fit: &Fit,
    recordings: &[PlantRecording],
) -> Option<f64> {
    let trajectories = study.trajectories(fit)?;
    if plant.spec.states().is_empty() {
        return Some(f64::NEG_INFINITY);
    }
    let points = study.points(fit);
    let each = trajectories.iter().zip(recordings).zip(points);
    let growths = each.map(|((trajectory, recording), point)| {
        let samples = recording.samples();
        let mut lineariser = plant.lineariser(&point);
        let every = (samples / LOOKED_AT).max(1);
        let (mut growth, mut looked_at) = (0.0, 0.0);
        for k in (0..samples).step_by(every) {
            let state: Vec<f64> = trajectory.states.iter().map(|x| x[k]).collect();
            let inputs: Vec<f64> = recording.inputs.iter().map(|u| u[k]).collect();
            let time = recording.start_time + k as f64 * recording.sample_time;
            let poles = lineariser.at(&state, &inputs, time).a.complex_eigenvalues();
            growth += poles.iter().map(|p| p.re).fold(f64::NEG_INFINITY, f64::max);
            looked_at += 1.0;
        }
        growth / looked_at * samples as f64 * recording.sample_time
    });
    growths.reduce(f64::max)
}

/// Whether a plant adds up what disturbs it.
pub(super) fn integrates(
    plant: &Plant,
    study: &Study,
    fit: &Fit,
    recordings: &[PlantRecording],
) -> bool {
    growth(plant, study, fit, recordings).is_some_and(|growth| growth > -1.0 / INTEGRATES)
}

/// Whether any input reacts to what a fit leaves.
pub(super) fn has_feedback(
    study: &Study,
    fit: &Fit,
    recordings: &[PlantRecording],
    hold: Hold,
) -> bool {
    let Some(residual) = study.residual(fit) else {
        return false;
    };
    let innovations = fit.noise.whiten(&residual, study.mask());
    let inputs = recordings.first().map_or(0, |r| r.inputs.len());
    // What the input is between samples acts on the output that ends them, unless it is held.
    let first = usize::from(hold != Hold::Zero);
    (0..inputs).any(|input| {
        let reaction = reaction(&innovations, study.mask(), recordings, input, first);
        reaction.is_some_and(|(share, p)| share > SHARE && p * (inputs as f64) < LEVEL)
    })
}

/// The share of an input's own doing that past residuals foretell, and its probability by chance.
fn reaction(
    innovations: &Series,
    mask: &Mask,
    recordings: &[PlantRecording],
    input: usize,
    first: usize,
) -> Option<(f64, f64)> {
    let outputs = innovations.len() / recordings.len().max(1);
    let own = 1 + OWN_PAST;
    let lags = REACTS_WITHIN - first;
    let all = own + outputs * lags;
    let (mut normal, mut product) = (DMatrix::zeros(all, all), DVector::zeros(all));
    let (mut total, mut rows) = (0.0, 0usize);
    let mut row = DVector::zeros(all);
    for (r, recording) in recordings.iter().enumerate() {
        let u = standardised(&recording.inputs[input]);
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
    if rows < 2 * all {
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
    fn recorded(gain: f64) -> (Series, Mask, Vec<PlantRecording>) {
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
        let recording = PlantRecording {
            sample_time: 0.1,
            start_time: 0.0,
            inputs: vec![u.collect()],
            outputs: vec![vec![0.0; 2000]],
        };
        (vec![e], vec![vec![true; 2000]], vec![recording])
    }

    #[test]
    fn an_input_that_answers_residuals_is_told_from_one_that_does_not() {
        for (gain, feeds_back) in [(0.0, false), (0.005, false), (0.2, true)] {
            let (e, mask, recordings) = recorded(gain);
            let (share, p) = reaction(&e, &mask, &recordings, 0, 0).unwrap();
            assert_eq!(
                share > SHARE && p < LEVEL,
                feeds_back,
                "{gain}: {share} {p}"
            );
        }
    }
}
