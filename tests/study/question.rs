//! A drawn case in the types of the library.

use innovant::Model;
use innovant::explain::Simulation;
use innovant::identify::IdentifiedChannel;
use innovant::log::{Channel, Log};
use innovant::model::StateSpace;
use nalgebra::{DMatrix, DVector};

use crate::concealed;
use crate::concealed::Case;

/// What `explain` is asked.
#[derive(Debug, Clone)]
pub struct Question {
    pub recording: Log,
    pub simulation: Simulation,
}

impl Question {
    pub fn of(case: &Case) -> Self {
        let recording = log(
            "recording",
            case.truth.dt,
            &case.recording.inputs,
            &case.recording.outputs,
        );
        let simulation = match &case.simulation {
            concealed::Simulation::Model(model) => {
                Simulation::Model(Box::new(linear(model)), "simulation".to_owned())
            }
            concealed::Simulation::Column(columns) => Simulation::Outputs(vec![log(
                "simulation",
                case.truth.dt,
                &case.recording.inputs,
                columns,
            )]),
        };
        Self {
            recording,
            simulation,
        }
    }

    /// The same question in other units: inputs `u` and outputs `y` times as large, in recording and simulation.
    pub fn in_units(&self, u: f64, y: f64) -> Self {
        let mut scaled = self.clone();
        scale(&mut scaled.recording, u, y);
        match &mut scaled.simulation {
            Simulation::Model(model, _) => {
                let system = &model.system;
                let (b, c) = (&system.b / u, &system.c * y);
                let d = &system.d * (y / u);
                let time = system.sample_time;
                model.system = StateSpace::deterministic(system.a.clone(), b, c, d, time).unwrap();
            }
            Simulation::Outputs(logs) => logs.iter_mut().for_each(|log| scale(log, u, y)),
        }
        scaled
    }

    /// The same question with a time unit `unit` seconds long, in recording and simulation.
    pub fn in_time_of(&self, unit: f64) -> Self {
        let mut slower = self.clone();
        let stretch = |log: &mut Log| log.sample_time *= unit;
        stretch(&mut slower.recording);
        match &mut slower.simulation {
            Simulation::Model(model, _) => model.system.sample_time *= unit,
            Simulation::Outputs(logs) => logs.iter_mut().for_each(stretch),
        }
        slower
    }

    /// The same question with all channels in the opposite order.
    pub fn turned(&self) -> Self {
        let mut turned = self.clone();
        let turn = |log: &mut Log| {
            log.inputs.reverse();
            log.input_data.reverse();
            log.outputs.reverse();
            log.output_data.reverse();
        };
        turn(&mut turned.recording);
        match &mut turned.simulation {
            Simulation::Model(model, _) => {
                model.inputs.reverse();
                model.outputs.reverse();
                let system = &mut model.system;
                let flip = |m: &DMatrix<f64>, rows: bool, columns: bool| {
                    DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| {
                        let i = if rows { m.nrows() - 1 - i } else { i };
                        m[(i, if columns { m.ncols() - 1 - j } else { j })]
                    })
                };
                system.b = flip(&system.b, false, true);
                system.c = flip(&system.c, true, false);
                system.d = flip(&system.d, true, true);
            }
            Simulation::Outputs(logs) => logs.iter_mut().for_each(turn),
        }
        turned
    }

    /// The same question with another time of the first sample.
    pub fn starting_at(&self, time: f64) -> Self {
        let mut moved = self.clone();
        moved.recording.start_time = time;
        if let Simulation::Outputs(logs) = &mut moved.simulation {
            logs.iter_mut().for_each(|log| log.start_time = time);
        }
        moved
    }
}

fn scale(log: &mut Log, u: f64, y: f64) {
    log.input_data
        .iter_mut()
        .flatten()
        .for_each(|value| *value *= u);
    log.output_data
        .iter_mut()
        .flatten()
        .for_each(|value| *value *= y);
}

pub fn log(name: &str, sample_time: f64, inputs: &[Vec<f64>], outputs: &[Vec<f64>]) -> Log {
    Log {
        name: name.to_owned(),
        sample_time,
        start_time: 0.0,
        inputs: channels("u", inputs.len()),
        outputs: channels("y", outputs.len()),
        input_data: inputs.to_vec(),
        output_data: outputs.to_vec(),
        sha256: None,
    }
}

fn channels(letter: &str, count: usize) -> Vec<Channel> {
    (1..=count)
        .map(|i| Channel::new(format!("{letter}{i}")))
        .collect()
}

/// A linear simulator as a model of the library.
pub fn linear(model: &concealed::Model) -> Model {
    let (inputs, outputs) = (model.d.first().map_or(0, Vec::len), model.c.len());
    let states = model.a.len();
    let matrix = |rows: &[Vec<f64>], columns: usize| {
        DMatrix::from_row_iterator(rows.len(), columns, rows.iter().flatten().copied())
    };
    let system = StateSpace::deterministic(
        matrix(&model.a, states),
        matrix(&model.b, inputs),
        matrix(&model.c, states),
        matrix(&model.d, inputs),
        model.dt,
    )
    .unwrap();
    let identified = |letter: &str, count: usize| -> Vec<IdentifiedChannel> {
        channels(letter, count)
            .into_iter()
            .map(|channel| IdentifiedChannel {
                channel,
                level: 0.0,
                delay: 0,
            })
            .collect()
    };
    Model {
        system,
        inputs: identified("u", inputs),
        outputs: identified("y", outputs),
        innovation_covariance: None,
        initial_state: DVector::zeros(states),
        covariance: None,
        summary: None,
        recordings: Vec::new(),
    }
}
