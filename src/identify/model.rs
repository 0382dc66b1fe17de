//! The model that an identification delivers.

use nalgebra::{DMatrix, DVector};

use super::error::IdentifyError;
use super::fit::{Fit, fit};
use super::options::Options;
use super::records::{MemoryRecords, Recording, Records};
use super::source::deviations;
use super::summary::Summary;
use crate::covariance::ParameterCovariance;
use crate::log::{Channel, Log};
use crate::model::{StateSpace, estimate_initial_state};

/// An input or output of a model.
#[derive(Debug, Clone, PartialEq)]
pub struct IdentifiedChannel {
    /// Name and unit.
    pub channel: Channel,
    /// Operating point: the system describes deviations from it.
    pub level: f64,
    /// Known delay in samples (inputs).
    pub delay: usize,
}

/// A state-space model with what is known about its uncertainty.
///
/// The system describes deviations from the levels of the channels; [`Model::simulate`] takes and gives
/// values in the units of the recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// System matrices in innovation form.
    pub system: StateSpace,
    /// Inputs.
    pub inputs: Vec<IdentifiedChannel>,
    /// Outputs.
    pub outputs: Vec<IdentifiedChannel>,
    /// Covariance of the innovations; `None` for a model without a noise model.
    pub innovation_covariance: Option<DMatrix<f64>>,
    /// State at the first sample of the first recording.
    pub initial_state: DVector<f64>,
    /// Covariance of the parameters; `None` for a model that was not identified here.
    pub covariance: Option<ParameterCovariance>,
    /// How the model came about; `None` for a model that was not identified here.
    pub summary: Option<Summary>,
    /// The recordings it was estimated from.
    pub recordings: Vec<Recording>,
}

/// Samples at the beginning of a recording that the initial state is estimated from, at most.
const INITIAL_STATE_SAMPLES: usize = 20_000;

/// Identifies a model from recordings in memory: several are experiments of one plant.
///
/// ```
/// use innovant::{Options, identify, systems};
///
/// let recording = systems::van_wingerden_one().record(2000, 1); // closed loop, two inputs, two outputs
/// let model = identify(&[recording], &Options::default())?;
/// assert_eq!(model.system.states(), 4);
/// println!("{model}");
/// # Ok::<(), innovant::IdentifyError>(())
/// ```
///
/// # Errors
/// [`IdentifyError`] says what is wrong with the recordings or the options.
pub fn identify(logs: &[Log], options: &Options) -> Result<Model, IdentifyError> {
    identify_records(&mut MemoryRecords::new(logs)?, options)
}

/// Identifies a model from recordings that are streamed, in memory that does not grow with their length.
///
/// # Errors
/// [`IdentifyError`] says what is wrong with the recordings or the options.
pub fn identify_records(
    records: &mut dyn Records,
    options: &Options,
) -> Result<Model, IdentifyError> {
    let fit = fit(records, options)?;
    let initial_state = initial_state(records, &fit)?;
    let Fit {
        system,
        covariance,
        innovation_covariance,
        levels,
        delays,
        summary,
        ..
    } = fit;
    let (input_levels, output_levels) = levels.split_at(records.inputs().len());
    let identified = |channels: &[Channel], levels: &[f64], delays: &[usize]| {
        channels
            .iter()
            .zip(levels)
            .enumerate()
            .map(|(i, (channel, level))| IdentifiedChannel {
                channel: channel.clone(),
                level: *level,
                delay: delays.get(i).copied().unwrap_or(0),
            })
            .collect()
    };
    Ok(Model {
        inputs: identified(records.inputs(), input_levels, &delays),
        outputs: identified(records.outputs(), output_levels, &[]),
        system,
        innovation_covariance: Some(innovation_covariance),
        initial_state,
        covariance: Some(covariance),
        summary: Some(summary),
        recordings: records.recordings(),
    })
}

fn initial_state(records: &mut dyn Records, fit: &Fit) -> Result<DVector<f64>, IdentifyError> {
    let kept = records.kept_samples(0).min(INITIAL_STATE_SAMPLES);
    let columns = deviations(records, 0, &fit.delays, &fit.first_trend, Some(kept))?;
    let (inputs, outputs) = columns.split_at(fit.system.inputs());
    let inputs: Vec<&[f64]> = inputs.iter().map(Vec::as_slice).collect();
    let outputs: Vec<&[f64]> = outputs.iter().map(Vec::as_slice).collect();
    Ok(estimate_initial_state(
        &fit.system,
        &inputs,
        &outputs,
        Some(&fit.innovation_covariance),
    )
    .unwrap_or_else(|_| DVector::zeros(fit.system.states())))
}
