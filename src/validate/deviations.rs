//! Recordings as a model sees them: deviations from the operating point, known delays taken out; and the model
//! judged on them.

use super::{RecordView, Relation, ValidateError, Validation, ValidationOptions, validate};
use crate::identify::{AlignedColumns, IdentifiedChannel, Model, Records, channel_names};
use crate::log::{Log, LogError};
use crate::moments::{Detrend, LagAccumulator, Trend};

/// Values of a long recording that the residual tests look at, from its beginning: more do not sharpen their
/// verdict, but cost time and memory.
const VALUES_TESTED: usize = 1 << 19;

/// One experiment: columns relative to what stands for zero, inputs aligned with the outputs.
#[derive(Debug)]
pub struct Deviations {
    inputs: Vec<Vec<f64>>,
    outputs: Vec<Vec<f64>>,
}

/// What stands for zero in an experiment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Zero {
    /// The operating point of the model.
    Levels,
    /// What this experiment says by itself.
    Own(Detrend),
}

impl Zero {
    /// That of a recording which the model was estimated from.
    pub fn of_estimation(model: &Model) -> Self {
        let detrend = model.summary.as_ref().map(|s| s.options.detrend);
        match detrend {
            // One recording: its mean is the operating point, of the whole of it and not only of a part.
            Some(Detrend::Mean) if model.recordings.len() == 1 => Self::Levels,
            Some(Detrend::None) | None => Self::Levels,
            Some(own) => Self::Own(own),
        }
    }
}

impl Deviations {
    /// Takes `zero` out of aligned columns, inputs first.
    fn new(mut columns: Vec<Vec<f64>>, model: &Model, zero: Zero) -> Self {
        let trend = match zero {
            Zero::Levels => levels(model),
            Zero::Own(detrend) => {
                let mut moments = LagAccumulator::new(columns.len(), 0);
                moments.push(&as_slices(&columns));
                moments.moments().trend(detrend)
            }
        };
        trend.remove_from(&mut columns);
        let outputs = columns.split_off(model.inputs.len());
        Self {
            inputs: columns,
            outputs,
        }
    }

    /// Of a recording in memory, whose channels are those of the model.
    pub fn of_log(log: &Log, model: &Model, zero: Zero) -> Self {
        let mut aligned = aligned(model);
        aligned.push(&log.channel_data());
        Self::new(aligned.columns, model, zero)
    }

    /// Of what is still in memory of the recordings that the model was just estimated from.
    ///
    /// # Errors
    /// When reading them again fails.
    pub fn of_records(records: &mut dyn Records, model: &Model) -> Result<Vec<Self>, LogError> {
        let channels = model.inputs.len() + model.outputs.len();
        let experiments = records.experiments();
        let most = VALUES_TESTED / (channels * experiments).max(1);
        let mut out = Vec::with_capacity(experiments);
        for experiment in 0..experiments {
            let limit = records.kept_samples(experiment).min(most);
            if limit == 0 {
                continue;
            }
            let mut aligned = aligned(model);
            records.read(experiment, Some(limit), &mut |block| aligned.push(block))?;
            out.push(Self::new(
                aligned.columns,
                model,
                Zero::of_estimation(model),
            ));
        }
        Ok(out)
    }
}

/// Judges a model on records; `level` is the probability that a right model is rejected, 0.01 without it.
///
/// # Errors
/// As [`validate`](super::validate()).
pub fn judge(
    model: &Model,
    records: &[Deviations],
    relation: Relation,
    level: Option<f64>,
) -> Result<Validation, ValidateError> {
    let inputs: Vec<Vec<&[f64]>> = records.iter().map(|r| as_slices(&r.inputs)).collect();
    let outputs: Vec<Vec<&[f64]>> = records.iter().map(|r| as_slices(&r.outputs)).collect();
    let views: Vec<RecordView<'_>> = inputs
        .iter()
        .zip(&outputs)
        .map(|(inputs, outputs)| RecordView { inputs, outputs })
        .collect();
    let default = ValidationOptions::default();
    validate(
        &model.system,
        model.innovation_covariance.as_ref(),
        model.covariance.as_ref(),
        &views,
        relation,
        &ValidationOptions {
            level: level.unwrap_or(default.level),
            input_names: channel_names(&model.inputs),
            output_names: channel_names(&model.outputs),
            ..default
        },
    )
}

fn as_slices(columns: &[Vec<f64>]) -> Vec<&[f64]> {
    columns.iter().map(Vec::as_slice).collect()
}

/// The operating point of a model as a trend without slope.
fn levels(model: &Model) -> Trend {
    let level = |of: &[IdentifiedChannel]| of.iter().map(|c| c.level).collect::<Vec<_>>();
    let mut trend = Trend::zero(model.inputs.len() + model.outputs.len());
    trend.level = level(&model.inputs);
    trend.level.extend(level(&model.outputs));
    trend
}

/// Empty columns of the channels of a model.
fn aligned(model: &Model) -> AlignedColumns {
    let delays: Vec<usize> = model.inputs.iter().map(|c| c.delay).collect();
    AlignedColumns::new(&delays, model.outputs.len())
}
