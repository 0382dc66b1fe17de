//! What is known of the simulation, and the recordings prepared to be compared with it.

use super::check::{Checked, INTERPOLATION, constant_inputs};
use super::data::{Data, Segment, delayed};
use super::identification::autoregression::{Simulator as Identified, identify_simulator};
use super::identification::minimal_order::{Simplest, simplest};
use super::identification::simulator_offset::operating_point;
use super::identification::step_response_test::Uncertainty;
use super::known::Known;
use super::model::coordinates::Coordinates;
use super::model::linear_plant::Plant;
use super::model::structure::Structure;
use super::model::structure::without_effects::bare;
use super::nonlinear_simulator::NonlinearSimulator;
use crate::explain::document::explain_error::ExplainError;
use crate::explain::simulation::Simulation;
use crate::identify::Model;
use crate::log::{Channel, LARGEST_SIZE, Log, counted};
use crate::physics::{Comparison, compare, rounded};

/// What a simulation turns out to be.
#[derive(Debug, Clone)]
pub(crate) enum Simulator {
    Linear(Box<Known>),
    /// Known by its outputs, which no linear model reproduces.
    Nonlinear(Box<NonlinearSimulator>),
}

/// Checks and prepares everything.
pub(crate) fn know(checked: &Checked) -> Result<Simulator, ExplainError> {
    let (recordings, simulation) = (checked.recordings.as_slice(), &checked.simulation);
    let first = recordings.first().ok_or(ExplainError::NoRecording)?;
    if first.inputs.is_empty() {
        return Err(ExplainError::NoChannels {
            recording: first.name.clone(),
        });
    }
    check(recordings, simulation)?;
    let simulator = match simulation {
        Simulation::Model(model, name) => {
            Simulator::Linear(Box::new(of_model(recordings, model, name)?))
        }
        Simulation::Outputs(logs) => of_outputs(recordings, logs, checked.interpolated)?,
    };
    if let Simulator::Linear(known) = &simulator {
        known.check(checked)?;
    }
    Ok(simulator)
}

/// Refuses recordings that cannot be explained, and columns that do not belong to them.
pub(crate) fn check(recordings: &[Log], simulation: &Simulation) -> Result<(), ExplainError> {
    let first = recordings.first().ok_or(ExplainError::NoRecording)?;
    for log in recordings {
        log.check()?;
        first.check_same_kind(log)?;
    }
    if first.outputs.is_empty() {
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
    if let Simulation::Outputs(logs) = simulation {
        logs.iter().try_for_each(Log::check)?;
        logs.iter().try_for_each(check_sizes)?;
        check_outputs(recordings, logs)?;
    }
    Ok(())
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
    let (Some(recorded), Some(simulated)) = (&ours.unit, &theirs.unit) else {
        return Ok(());
    };
    let factor = match compare(simulated, recorded) {
        Comparison::Alike => return Ok(()),
        Comparison::Factor(factor) => format!(" (1 {simulated} is {} {recorded})", rounded(factor)),
        Comparison::Offset(offset) => format!(" (add {} to the simulation)", rounded(offset)),
        Comparison::Line(factor, offset) => format!(
            " (multiply the simulation by {} and add {})",
            rounded(factor),
            rounded(offset)
        ),
        Comparison::Dimension => String::new(),
    };
    Err(ExplainError::Unit {
        simulation: name.to_owned(),
        channel: ours.name.clone(),
        recorded: recorded.clone(),
        simulated: simulated.clone(),
        factor,
    })
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

fn of_outputs(
    recordings: &[Log],
    logs: &[Log],
    interpolated: bool,
) -> Result<Simulator, ExplainError> {
    let delays = vec![0; recordings[0].inputs.len()];
    let linear = |structure: Structure, data: Data| {
        Simulator::Linear(Box::new(Known {
            structure,
            data,
            delays: delays.clone(),
            relative: false,
            identified: false,
            uncertainty: None,
        }))
    };
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
        return Ok(linear(bare(&plant, &initial), data));
    }
    let simulator = identify_simulator(&noise_free).ok_or_else(|| ExplainError::NotUnderstood {
        name: name(),
        misfit: 1.0,
        constant: constant_inputs(recordings),
    })?;
    let structure = bare(&simulator.plant, &simulator.initial);
    if simulator.is_linear() || interpolated && simulator.misfit < INTERPOLATION {
        return Ok(linear(structure, data));
    }
    if let Some(known) = about_a_level(&data, &noise_free, &delays) {
        return Ok(Simulator::Linear(Box::new(known)));
    }
    Ok(Simulator::Nonlinear(Box::new(NonlinearSimulator {
        name: name(),
        data,
        noise_free,
        structure,
        misfit: simulator.misfit,
    })))
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
    let mut simulator = identify_simulator(&about).filter(Identified::is_linear)?;
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
