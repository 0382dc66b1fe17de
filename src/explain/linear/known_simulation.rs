//! What is known of the simulation, and the recordings prepared to be compared with it.

use std::sync::Arc;

use super::check::{Checked, INTERPOLATION, between};
use super::data::{Data, Segment, Series, delayed};
use super::fit::{Effort, Fit, Problem};
use super::identification::autoregression::{Simulator, identify_simulator};
use super::identification::minimal_order::{Simplest, simplest};
use super::identification::simulator_offset::operating_point;
use super::identification::step_response_test::Uncertainty;
use super::model::coordinates::Coordinates;
use super::model::linear_plant::Plant;
use super::model::structure::Structure;
use super::model::structure::without_effects::bare;
use super::model::time_stepping::MOST_STATES;
use super::search::null_models::Boring;
use super::search::single_effects::single_effects;
use crate::explain::document::explain_error::ExplainError;
use crate::explain::effects::{Action, Definition};
use crate::explain::simulation::Simulation;
use crate::identify::Model;
use crate::linalg::spectral_radius;
use crate::log::{Channel, LARGEST_SIZE, Log};
use crate::noise::Colours;

/// The simulation as the engine knows it, beside the data in the form that it is compared with.
#[derive(Debug, Clone)]
pub(crate) struct Known {
    pub(crate) data: Data,
    /// Plant and effects that the simulation holds, all numbers fixed.
    pub(crate) structure: Structure,
    /// Delay of each input in samples, applied to `data` already.
    pub(crate) delays: Vec<usize>,
    /// The simulator is not linear and known by its outputs only: `data` is relative to what `structure` misses.
    pub(crate) relative: bool,
    /// The simulation is a model that was identified from a recording.
    pub(crate) identified: bool,
    /// How well it is known, if it says so.
    pub(crate) uncertainty: Option<Uncertainty>,
}

/// Samples that a state needs, so that blocks can be held out.
const SAMPLES_A_STATE: usize = 40;
/// Least samples at all.
const LEAST_SAMPLES: usize = 150;
/// A simulated output that no model explains better than this is not a simulation of these inputs.
const UNDERSTOOD: f64 = 0.5;

/// Checks and prepares everything.
pub(crate) fn know(checked: &Checked) -> Result<Known, ExplainError> {
    let (recordings, simulation) = (checked.recordings.as_slice(), &checked.simulation);
    let first = recordings.first().ok_or(ExplainError::NoRecording)?;
    for log in recordings {
        log.check()?;
        first.check_same_kind(log)?;
    }
    if first.inputs.is_empty() || first.outputs.is_empty() {
        return Err(ExplainError::NoChannels {
            recording: first.name.clone(),
        });
    }
    for log in recordings {
        for (channel, y) in log.outputs.iter().zip(&log.output_data) {
            if y.iter().all(|v| *v == y[0]) {
                return Err(ExplainError::Constant {
                    recording: log.name.clone(),
                    output: channel.name.clone(),
                });
            }
        }
    }
    recordings.iter().try_for_each(check_sizes)?;
    let known = match simulation {
        Simulation::Model(model, name) => of_model(recordings, model, name)?,
        Simulation::Outputs(logs) => {
            logs.iter().try_for_each(Log::check)?;
            logs.iter().try_for_each(check_sizes)?;
            check_outputs(recordings, logs)?;
            of_outputs(recordings, logs, checked.interpolated)?
        }
    };
    let states = known.structure.states();
    if states > MOST_STATES {
        return Err(ExplainError::TooLarge {
            name: simulation_name(simulation),
            states,
            most: MOST_STATES,
        });
    }
    let needed = LEAST_SAMPLES.max(SAMPLES_A_STATE * states);
    if known.data.samples() < needed {
        return Err(ExplainError::TooShort {
            recording: first.name.clone(),
            samples: known.data.samples(),
            needed,
            states,
        });
    }
    if known
        .structure
        .simulate(&known.structure.given(), &known.data)
        .is_none()
    {
        return Err(ExplainError::Unstable {
            name: simulation_name(simulation),
            radius: spectral_radius(&known.structure.coordinates.given.a_matrix())
                .unwrap_or(f64::NAN),
        });
    }
    Ok(known)
}

/// Refuses channels so large or so small that their squares and products leave the range of numbers. A channel that does
/// not move at all is small in no unit.
fn check_sizes(log: &Log) -> Result<(), ExplainError> {
    let channels = log.inputs.iter().chain(&log.outputs);
    for (channel, column) in channels.zip(log.channel_data()) {
        let largest = column.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
        let first = column.first().copied().unwrap_or(0.0);
        let size = column
            .iter()
            .fold(0.0_f64, |most, v| most.max((v - first).abs()));
        if largest >= LARGEST_SIZE || (size > 0.0 && size < 1.0 / LARGEST_SIZE) {
            return Err(ExplainError::Size {
                recording: log.name.clone(),
                channel: channel.name.clone(),
                size,
                largest,
            });
        }
    }
    Ok(())
}

/// "1 input", "2 inputs".
fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

fn simulation_name(simulation: &Simulation) -> String {
    match simulation {
        Simulation::Model(_, name) => name.clone(),
        Simulation::Outputs(logs) => logs.first().map_or_else(String::new, |l| l.name.clone()),
    }
}

fn of_model(recordings: &[Log], model: &Model, name: &str) -> Result<Known, ExplainError> {
    let first = &recordings[0];
    let wrong = |simulated: String, recorded: usize, option: &'static str| ExplainError::Channels {
        simulation: name.to_owned(),
        simulated,
        recording: first.name.clone(),
        recorded,
        option,
    };
    let system = &model.system;
    if system.inputs() != first.inputs.len() {
        let has = format!("the model has {}", counted(system.inputs(), "input"));
        return Err(wrong(has, first.inputs.len(), "--inputs"));
    }
    if system.outputs() != first.outputs.len() {
        let has = format!("the model has {}", counted(system.outputs(), "output"));
        return Err(wrong(has, first.outputs.len(), "--outputs"));
    }
    if relative_difference(system.sample_time, first.sample_time) > SAMPLING_TOLERANCE {
        return Err(ExplainError::Sampling {
            recording: first.name.clone(),
            recorded: first.sample_time,
            simulation: name.to_owned(),
            simulated: system.sample_time,
        });
    }
    let known = model
        .inputs
        .iter()
        .chain(&model.outputs)
        .map(|c| &c.channel);
    for (ours, theirs) in first.inputs.iter().chain(&first.outputs).zip(known) {
        check_unit(name, ours, theirs)?;
    }
    let delays: Vec<usize> = if model.inputs.is_empty() {
        vec![0; system.inputs()]
    } else {
        model.inputs.iter().map(|c| c.delay).collect()
    };
    let mut data = data_of(recordings, &delays);
    let mut plant = Plant::from_state_space(system);
    if Coordinates::new(&plant).given.states == 0 {
        return Err(ExplainError::Static {
            name: name.to_owned(),
        });
    }
    trimmed(&mut data);
    let level = |list: &[crate::identify::IdentifiedChannel]| -> Vec<f64> {
        list.iter().map(|c| c.level).collect()
    };
    let (u_level, y_level) = (level(&model.inputs), level(&model.outputs));
    if u_level.iter().chain(&y_level).any(|v| *v != 0.0) {
        add_constant(&mut data, &mut plant, &u_level, &y_level);
    }
    let initial = vec![vec![0.0; plant.states]; data.segments.len()];
    let structure = bare(&plant, &initial);
    let uncertainty = model
        .covariance
        .as_ref()
        .and_then(|covariance| Uncertainty::of(model, covariance));
    Ok(Known {
        structure,
        data,
        delays,
        relative: false,
        identified: model.summary.is_some(),
        uncertainty,
    })
}

/// Samples that are explained, at most: more than a name needs (250 to 2000, math/explain.md), and quick.
const MOST_SAMPLES: usize = 8000;

/// Cuts each recording to the stretch in which the outputs go furthest: what was left out shows at the ends of the range.
fn trimmed(data: &mut Data) {
    let most = (MOST_SAMPLES / data.segments.len().max(1)).max(1000);
    let scale = data.output_scale();
    for segment in &mut data.segments {
        let n = segment.samples();
        if n <= most + most / 4 {
            continue;
        }
        let mut best = (f64::NEG_INFINITY, 0);
        let last = n - most;
        for from in (0..last).step_by(most / 4).chain([last]) {
            let size: f64 = segment
                .outputs
                .iter()
                .zip(&scale)
                .map(|(y, s)| {
                    let stretch = &y[from..from + most];
                    let end = |of: fn(f64, f64) -> f64| stretch.iter().copied().reduce(of);
                    (end(f64::max).unwrap_or(0.0) - end(f64::min).unwrap_or(0.0)) / s
                })
                .sum();
            if size > best.0 * 1.01 {
                best = (size, from);
            }
        }
        for channel in segment.inputs.iter_mut().chain(&mut segment.outputs) {
            *channel = channel[best.1..best.1 + most].to_vec();
        }
        segment.start_time += best.1 as f64 * data.sample_time;
    }
}

/// Operating points as a constant input: `x+ = A x + B (u - u0)`, `y = y0 + C x + D (u - u0)`. Laws then see the
/// channels with their physical zero.
fn add_constant(data: &mut Data, plant: &mut Plant, u_level: &[f64], y_level: &[f64]) {
    let (n, r, l) = (plant.states, plant.inputs, plant.outputs);
    let widened = |rows: usize, matrix: &[f64], level: &dyn Fn(usize) -> f64| -> Vec<f64> {
        (0..rows)
            .flat_map(|i| {
                let row = &matrix[i * r..(i + 1) * r];
                let shift: f64 = row.iter().zip(u_level).map(|(b, u)| b * u).sum();
                row.iter()
                    .copied()
                    .chain([level(i) - shift])
                    .collect::<Vec<_>>()
            })
            .collect()
    };
    plant.b = widened(n, &plant.b, &|_| 0.0);
    plant.d = widened(l, &plant.d, &|o| y_level.get(o).copied().unwrap_or(0.0));
    plant.inputs = r + 1;
    for segment in &mut data.segments {
        let samples = segment.samples();
        segment.inputs.push(vec![1.0; samples]);
    }
    data.inputs += 1;
    data.constant = true;
}

/// Sample times that differ by less are the same (the logs are read with the same tolerance).
const SAMPLING_TOLERANCE: f64 = 1e-3;

fn relative_difference(a: f64, b: f64) -> f64 {
    (a - b).abs() / a.abs().max(b.abs())
}

fn check_unit(name: &str, ours: &Channel, theirs: &Channel) -> Result<(), ExplainError> {
    match (&ours.unit, &theirs.unit) {
        (Some(recorded), Some(simulated)) if recorded != simulated => Err(ExplainError::Unit {
            simulation: name.to_owned(),
            channel: ours.name.clone(),
            recorded: recorded.clone(),
            simulated: simulated.clone(),
            factor: between(recorded, simulated).map_or_else(String::new, |f| {
                format!(
                    " (1 {simulated} is {} {recorded})",
                    crate::explain::document::sentences::number(f)
                )
            }),
        }),
        _ => Ok(()),
    }
}

fn check_outputs(recordings: &[Log], logs: &[Log]) -> Result<(), ExplainError> {
    if recordings.len() != logs.len() {
        return Err(ExplainError::Count {
            recordings: recordings.len(),
            simulations: logs.len(),
        });
    }
    for (log, simulated) in recordings.iter().zip(logs) {
        if log.outputs.len() != simulated.outputs.len() {
            return Err(ExplainError::Channels {
                simulation: simulated.name.clone(),
                simulated: counted(simulated.outputs.len(), "simulated output"),
                recording: log.name.clone(),
                recorded: log.outputs.len(),
                option: "--outputs",
            });
        }
        for (ours, theirs) in log.outputs.iter().zip(&simulated.outputs) {
            check_unit(&simulated.name, ours, theirs)?;
        }
        if relative_difference(log.sample_time, simulated.sample_time) > SAMPLING_TOLERANCE {
            return Err(ExplainError::Sampling {
                recording: log.name.clone(),
                recorded: log.sample_time,
                simulation: simulated.name.clone(),
                simulated: simulated.sample_time,
            });
        }
        if log.samples() != simulated.samples() {
            return Err(ExplainError::Length {
                recording: log.name.clone(),
                recorded: log.samples(),
                simulation: simulated.name.clone(),
                simulated: simulated.samples(),
            });
        }
    }
    Ok(())
}

fn of_outputs(recordings: &[Log], logs: &[Log], interpolated: bool) -> Result<Known, ExplainError> {
    let delays = vec![0; recordings[0].inputs.len()];
    let data = data_of(recordings, &delays);
    let mut noise_free = data.clone();
    for (segment, log) in noise_free.segments.iter_mut().zip(logs) {
        segment.outputs = log.output_data.clone();
    }
    let name = || logs[0].name.clone();
    if let Some(Simplest {
        mut plant,
        initial,
        level,
    }) = simplest(&noise_free)
    {
        let mut data = data;
        if let Some(level) = level {
            add_constant(&mut data, &mut plant, &vec![0.0; delays.len()], &level);
        }
        return Ok(Known {
            structure: bare(&plant, &initial),
            data,
            delays,
            relative: false,
            identified: false,
            uncertainty: None,
        });
    }
    let simulator = identify_simulator(&noise_free).ok_or_else(|| ExplainError::NotUnderstood {
        name: name(),
        misfit: 1.0,
    })?;
    let structure = bare(&simulator.plant, &simulator.initial);
    if simulator.is_linear() || interpolated && simulator.misfit < INTERPOLATION {
        return Ok(Known {
            data,
            structure,
            delays,
            relative: false,
            identified: false,
            uncertainty: None,
        });
    }
    if let Some(known) = about_a_level(&data, &noise_free, &delays) {
        return Ok(known);
    }
    learn_nonlinear(data, &noise_free, &structure, &simulator).ok_or(ExplainError::NotUnderstood {
        name: name(),
        misfit: simulator.misfit,
    })
}

/// A simulator that is linear about an operating point.
fn about_a_level(data: &Data, noise_free: &Data, delays: &[usize]) -> Option<Known> {
    let level = operating_point(noise_free)?;
    let mut about = noise_free.clone();
    for segment in &mut about.segments {
        for (y, level) in segment.outputs.iter_mut().zip(&level) {
            for y in y {
                *y -= level;
            }
        }
    }
    let mut simulator = identify_simulator(&about).filter(Simulator::is_linear)?;
    let mut data = data.clone();
    let rest = vec![0.0; data.inputs];
    add_constant(&mut data, &mut simulator.plant, &rest, &level);
    Some(Known {
        structure: bare(&simulator.plant, &simulator.initial),
        data,
        delays: delays.to_vec(),
        relative: false,
        identified: false,
        uncertainty: None,
    })
}

/// The effect that a nonlinear simulator holds, learnt from its noise-free outputs. What is missed even so is taken off
/// the recording, so that it cancels.
fn learn_nonlinear(
    mut data: Data,
    noise_free: &Data,
    structure: &Structure,
    simulator: &Simulator,
) -> Option<Known> {
    let mut problem = Problem::new(noise_free);
    problem.colours = Colours::White;
    let boring = Boring::fit(&problem, structure, None)?;
    let physical = |d: &Definition| {
        d.persists
            && matches!(
                d.action,
                Action::Force(..) | Action::Input(_) | Action::Sensor(_)
            )
    };
    let ranked = single_effects(&problem, &boring, &physical);
    let best = ranked.into_iter().next()?.fit;
    let best = Fit::run(
        &problem,
        best.structure.clone(),
        best.theta.clone(),
        Some(&best.noise),
        Effort::FINAL,
    )
    .unwrap_or(best);
    let fitted = &best.structure;
    let initial: Vec<Vec<f64>> = (0..noise_free.segments.len())
        .map(|s| fitted.initial_state(&best.theta, s).to_vec())
        .collect();
    let coordinates = fitted.coordinates.around(fitted.plant(&best.theta));
    let structure = Structure {
        coordinates: Arc::new(coordinates),
        plant_free: false,
        initial_free: false,
        feedthrough_free: false,
        substeps: 1,
        recording: None,
        initial,
        known: (0..fitted.effects.len())
            .map(|i| fitted.effect_numbers(&best.theta, i).to_vec())
            .collect(),
        adjusted: 0,
        ..fitted.clone()
    };
    let missed: Series = noise_free.residual(&structure.simulate(&[], noise_free)?);
    let size: f64 = missed.iter().flatten().map(|v| v * v).sum();
    let there: f64 = noise_free
        .outputs_as_series()
        .flatten()
        .map(|v| v * v)
        .sum();
    if size > UNDERSTOOD * UNDERSTOOD * there && simulator.misfit > UNDERSTOOD {
        return None;
    }
    let l = data.outputs;
    for (s, segment) in data.segments.iter_mut().enumerate() {
        for (o, y) in segment.outputs.iter_mut().enumerate() {
            for (y, missed) in y.iter_mut().zip(&missed[s * l + o]) {
                *y -= missed;
            }
        }
    }
    Some(Known {
        delays: vec![0; data.inputs],
        data,
        structure,
        relative: true,
        identified: false,
        uncertainty: None,
    })
}

/// Recordings as segments; inputs are held back by their delays (before it begins, an input had its first value).
fn data_of(recordings: &[Log], delays: &[usize]) -> Data {
    Data {
        segments: recordings
            .iter()
            .map(|log| Segment {
                inputs: log
                    .input_data
                    .iter()
                    .zip(delays)
                    .map(|(u, delay)| delayed(u, *delay))
                    .collect(),
                outputs: log.output_data.clone(),
                start_time: log.start_time,
            })
            .collect(),
        sample_time: recordings[0].sample_time,
        inputs: recordings[0].input_data.len(),
        outputs: recordings[0].output_data.len(),
        constant: false,
    }
}

#[cfg(test)]
mod tests;
