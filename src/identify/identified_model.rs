//! The model that an identification delivers.

use nalgebra::{DMatrix, DVector};

use super::data::{MemoryRecords, Recording, Records, deviations};
use super::fit_recordings::fit;
use super::identify_error::IdentifyError;
use super::options::Options;
use super::result::{Fit, Summary};
use crate::covariance::ParameterCovariance;
use crate::log::{Channel, Log};
use crate::model::{StateSpace, estimate_initial_state};
use crate::moments::Detrend;

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

/// The names of channels.
pub(crate) fn channel_names(channels: &[IdentifiedChannel]) -> Vec<String> {
    channels.iter().map(|c| c.channel.name.clone()).collect()
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
/// use innovant::log::{Log, Roles, Source};
/// use innovant::{Options, identify};
///
/// let log = Log::read(&Source::from("data/closed_loop.csv"), &Roles::default())?; // two inputs, two outputs
/// let model = identify(&[log], &Options::default())?;
/// assert_eq!(model.system.states(), 4);
/// println!("{model}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
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
    let mut fit = fit(records, options)?;
    let initial_state = start(records, &mut fit, options)?;
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

/// The initial state of the first recording; with it the operating point of the outputs, where the recording says that it
/// is not the mean.
///
/// The mean of a recording that begins or ends away from rest, or whose noise is slow, is not the output that belongs
/// to the mean of the inputs, and a free run would be off by the difference for good. The difference is a state that
/// stands still, seen by the output alone, and is estimated as such, together with the initial state.
fn start(
    records: &mut dyn Records,
    fit: &mut Fit,
    options: &Options,
) -> Result<DVector<f64>, IdentifyError> {
    let kept = records.kept_samples(0).min(INITIAL_STATE_SAMPLES);
    let columns = deviations(records, 0, &fit.delays, &fit.first_trend, Some(kept))?;
    let (inputs, outputs) = columns.split_at(fit.system.inputs());
    let inputs: Vec<&[f64]> = inputs.iter().map(Vec::as_slice).collect();
    let outputs: Vec<&[f64]> = outputs.iter().map(Vec::as_slice).collect();
    let (n, l) = (fit.system.states(), fit.system.outputs());
    let lambda = &fit.innovation_covariance;
    let plain = estimate_initial_state(&fit.system, &inputs, &outputs, Some(lambda))
        .unwrap_or_else(|_| DVector::zeros(n));
    // Of several recordings each has a mean of its own, and a line that was taken out has taken the mean with it.
    if options.detrend != Detrend::Mean || records.experiments() > 1 {
        return Ok(plain);
    }
    let with_level = standing_state(&fit.system);
    let Ok(moved) = estimate_initial_state(&with_level, &inputs, &outputs, Some(lambda)) else {
        return Ok(plain);
    };
    let cost = |system: &StateSpace, state: &DVector<f64>| -> Option<f64> {
        let innovations = system
            .one_step(&inputs, &outputs, Some(state))
            .ok()?
            .innovations;
        // `sum e' inv(Lambda) e` by the products of the innovations: one matrix, not one vector a sample.
        let products = DMatrix::from_fn(l, l, |i, j| {
            let both = innovations[i].iter().zip(&innovations[j]);
            both.map(|(a, b)| a * b).sum::<f64>()
        });
        Some(lambda.clone().cholesky()?.solve(&products).trace())
    };
    let gain = cost(&fit.system, &plain)
        .zip(cost(&with_level, &moved))
        .map(|(without, with)| without - with);
    // Akaike's criterion: a level that the recording does not show stays where it is.
    if gain.is_some_and(|gain| gain > 2.0 * l as f64) {
        let levels = &mut fit.levels[inputs.len()..];
        for (level, shift) in levels.iter_mut().zip(moved.rows(n, l).iter()) {
            *level += shift;
        }
        return Ok(moved.rows(0, n).into_owned());
    }
    Ok(plain)
}

/// The system with a constant added to each output, as states that stand still.
fn standing_state(system: &StateSpace) -> StateSpace {
    let (n, l) = (system.states(), system.outputs());
    let mut a = DMatrix::identity(n + l, n + l);
    a.view_mut((0, 0), (n, n)).copy_from(&system.a);
    let mut c = DMatrix::identity(l, n + l);
    c.view_mut((0, 0), (l, n)).copy_from(&system.c);
    for o in 0..l {
        for i in 0..l {
            c[(o, n + i)] = f64::from(u8::from(o == i));
        }
    }
    StateSpace {
        a,
        b: system.b.clone().resize_vertically(n + l, 0.0),
        k: system.k.clone().resize_vertically(n + l, 0.0),
        c,
        ..system.clone()
    }
}
