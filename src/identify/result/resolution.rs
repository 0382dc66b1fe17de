//! What the steps of a recording do to the estimate.
//!
//! Rounding a regressor to steps of `h` adds an error of variance `h^2 / 12` to it that no noise model knows (errors in
//! variables). From what is estimated, the vector ARX coefficients have then moved by
//!
//! `dXi = -Xi Sigma_h (Rz' Rz - Sigma_h)^-1`, `Sigma_h = Nc diag(h^2 / 12)`,
//!
//! and in the metric of their own covariance that is a distance in standard deviations, which bounds the bias of
//! everything computed from them. Rounded inputs always do this. Rounded outputs are noise like any other, unless
//! a controller acted on what was not rounded.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use crate::identify::IdentifyError;
use crate::identify::data::Records;
use crate::identify::subspace::Varx;
use crate::linalg::{
    LinalgError, cholesky_upper, multiply_tn, solve_upper, solve_upper_transposed,
};
use crate::log::spacing;

/// Bias in standard deviations from which a warning is due: the stated uncertainty is then off by as much as it says.
pub(super) const WORTH_A_WARNING: f64 = 1.0;

/// A channel that was recorded in steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct CoarseChannel {
    /// Name of the channel.
    pub channel: String,
    /// The steps, in its unit.
    pub step: f64,
    /// Bias of the vector ARX model by the rounding, in standard deviations: the most that anything computed from it can
    /// be biased, if the signal was rounded and was not so to begin with.
    pub bias: f64,
}

/// Samples at the beginning of a recording that are looked at: steps that matter show in far fewer.
const SAMPLES: usize = 4000;

/// A channel whose samples lie on a lattice.
#[derive(Debug, Clone)]
pub(crate) struct Stepped {
    /// Index of the channel, inputs first.
    pub(crate) index: usize,
    /// Its name.
    pub(crate) name: String,
    /// The steps, in its unit.
    pub(crate) step: f64,
}

/// The channels that were recorded in steps, by the first recording.
///
/// # Errors
/// [`IdentifyError`] when the recording can no longer be read.
pub(crate) fn stepped(records: &mut dyn Records) -> Result<Vec<Stepped>, IdentifyError> {
    let names: Vec<String> = records
        .inputs()
        .iter()
        .chain(records.outputs())
        .map(|channel| channel.name.clone())
        .collect();
    let samples = records.kept_samples(0).min(SAMPLES);
    let mut columns = vec![Vec::with_capacity(samples); names.len()];
    records.read(0, Some(samples), &mut |block| {
        for (column, part) in columns.iter_mut().zip(block) {
            column.extend_from_slice(part);
        }
    })?;
    let with_step = |(index, (name, column)): (usize, (String, Vec<f64>))| {
        let step = spacing(&column)?;
        Some(Stepped { index, name, step })
    };
    Ok(names
        .into_iter()
        .zip(columns)
        .enumerate()
        .filter_map(with_step)
        .collect())
}

/// What the steps of each channel do to the estimate.
///
/// # Errors
/// [`LinalgError`] for a singular innovation covariance.
pub(crate) fn coarse(
    stepped: &[Stepped],
    varx: &Varx,
    scale: &[f64],
) -> Result<Vec<CoarseChannel>, LinalgError> {
    stepped
        .iter()
        .map(|of| {
            Ok(CoarseChannel {
                channel: of.name.clone(),
                step: of.step,
                bias: bias(varx, of.index, of.step, scale)?,
            })
        })
        .collect()
}

/// Bias of the vector ARX coefficients, in standard deviations, when `channel` of `scale.len()` was rounded to steps of
/// `step` in its unit.
///
/// # Errors
/// [`LinalgError`] for a singular innovation covariance.
fn bias(varx: &Varx, channel: usize, step: f64, scale: &[f64]) -> Result<f64, LinalgError> {
    let q = scale.len();
    let variance = (step / scale[channel]).powi(2) / 12.0 * varx.columns as f64;
    // The channel in every block of the past window, and of the same sample with feedthrough.
    let moved = DMatrix::from_fn(
        varx.regressors(),
        varx.coefficients.nrows(),
        |regressor, output| {
            if regressor % q == channel {
                variance * varx.coefficients[(output, regressor)]
            } else {
                0.0
            }
        },
    );
    let factor = &varx.regressor_factor;
    let mut exact = multiply_tn(factor, factor);
    for regressor in (channel..varx.regressors()).step_by(q) {
        exact[(regressor, regressor)] -= variance;
    }
    // Where rounding is most of a direction, the rounded recording stands in for the exact one: a bias that is too small,
    // and still far beyond any warning.
    let error = match cholesky_upper(&exact) {
        Ok(exact) => factor * solve_upper(&exact, &solve_upper_transposed(&exact, &moved)),
        Err(_) => solve_upper_transposed(factor, &moved),
    };
    let upper = cholesky_upper(&varx.innovation_covariance)?;
    let bias = solve_upper_transposed(&upper, &error.transpose()).norm();
    // Also what is no number, where the signals are next to dependent.
    Ok(bias.min(MOST_DEVIATIONS))
}

/// A bias of so many standard deviations says that the stated uncertainty says nothing; more would say no more.
const MOST_DEVIATIONS: f64 = 1e6;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identify::subspace::varx;
    use crate::moments::RFactor;
    use crate::systems::two_by_two;

    /// Against what rounding does to the same recording.
    #[test]
    fn the_bias_is_that_of_a_rounded_input() {
        let exact = two_by_two().record(40_000, 3);
        let step = 1.0;
        let model = |rounded: bool| {
            let mut log = exact.clone();
            if rounded {
                for value in &mut log.input_data[1] {
                    *value = (*value / step).round() * step;
                }
            }
            let columns: Vec<&[f64]> = log
                .input_data
                .iter()
                .chain(&log.output_data)
                .map(Vec::as_slice)
                .collect();
            varx(&RFactor::of_samples(&columns, 2, 6).unwrap(), false).unwrap()
        };
        let (plain, rounded) = (model(false), model(true));
        let upper = cholesky_upper(&rounded.innovation_covariance).unwrap();
        let moved =
            (&rounded.coefficients - &plain.coefficients) * rounded.regressor_factor.transpose();
        let seen = solve_upper_transposed(&upper, &moved).norm();
        let stated = bias(&rounded, 1, step, &[1.0; 4]).unwrap();
        // Beside its bias the rounding is noise: 24 coefficients have an error of their own.
        assert!(
            stated > 20.0 && (seen / stated - 1.0).abs() < 0.1,
            "{seen} {stated}"
        );
    }
}
