//! An explained plant on another input.

use crate::explain::explanation::AugmentedPlant;
use crate::log::Log;
use crate::physics::estimate::{EstimateError, EstimateOptions, Form, PlantRecording, estimate};
use crate::physics::{Hold, Plant, SimulationError, parse};

/// Why an explained plant cannot be run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages explain the fields")]
pub enum AugmentedPlantError {
    /// Equations that cannot be read.
    #[error("the explanation is damaged: {what}")]
    Damaged { what: String },
    /// The original simulator's answer has another length, or other outputs.
    #[error(
        "the simulation has {found} columns of the length of the input, and the plant has {needed} outputs; give the simulator's \
         answer to exactly this input"
    )]
    Simulation { needed: usize, found: usize },
    /// Equations that need the original simulator's answer.
    #[error(
        "its sensors measure {}, the outputs of the simulation that was explained: give that simulator's answer to this input with --simulation \
         FILE.csv",
        .inputs.join(", ")
    )]
    NeedsSimulation { inputs: Vec<String> },
    /// The start of the original simulator cannot be found.
    #[error(transparent)]
    Start(#[from] EstimateError),
    /// The equations cannot be simulated.
    #[error(transparent)]
    Equations(#[from] SimulationError),
}

/// What the answer of the original simulator to an input tells an explained plant.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Original {
    /// Further inputs: the answer itself, where sensors are explained.
    pub inputs: Vec<Vec<f64>>,
    /// Where its states start.
    pub start: Vec<(String, f64)>,
    /// Simulated outputs less those of the equations; none where the answer is an input.
    pub remainder: Vec<Vec<f64>>,
}

fn plant_of(text: &str) -> Result<Plant, AugmentedPlantError> {
    let damaged = |e: crate::physics::SpecError| AugmentedPlantError::Damaged {
        what: e.render("plant", text),
    };
    Ok(Plant::new(parse(text).map_err(damaged)?))
}

impl AugmentedPlant {
    /// How the inputs behave between samples.
    pub fn hold(&self) -> Hold {
        match self.hold.as_str() {
            "linear" => Hold::Linear,
            _ => Hold::Zero,
        }
    }

    /// What is known of a simulator that was known by its columns from its answer to the inputs of `log`: where it started, and what
    /// its equations miss; or the inputs that its answer is. None where the simulation was given as equations, or no answer is
    /// given or needed.
    ///
    /// # Errors
    /// [`AugmentedPlantError`]: a damaged explanation, columns that do not fit, equations that cannot be simulated.
    pub fn original(
        &self,
        log: &Log,
        simulated: Option<&[Vec<f64>]>,
        hold: Hold,
    ) -> Result<Option<Original>, AugmentedPlantError> {
        let Some(simulated) = simulated else {
            return match self.simulated_inputs.is_empty() {
                true => Ok(None),
                false => Err(AugmentedPlantError::NeedsSimulation {
                    inputs: self.simulated_inputs.clone(),
                }),
            };
        };
        let fits = simulated.iter().filter(|y| y.len() == log.samples());
        let (needed, found) = (self.outputs.len(), fits.count());
        let fit = found == needed && simulated.len() == needed;
        let wrong = || AugmentedPlantError::Simulation { needed, found };
        if !self.simulated_inputs.is_empty() {
            return match fit {
                true => Ok(Some(Original {
                    inputs: simulated.to_vec(),
                    ..Original::default()
                })),
                false => Err(wrong()),
            };
        }
        let Some(text) = &self.simulation else {
            return Ok(None);
        };
        if !fit {
            return Err(wrong());
        }
        let plant = plant_of(text)?;
        let recording = PlantRecording {
            outputs: simulated.to_vec(),
            ..PlantRecording::from(log)
        };
        let options = EstimateOptions {
            free: vec![false; plant.spec.parameters().len()],
            hold,
            form: Some(Form::FreeRun),
            least_squares: true,
        };
        let fitted = estimate(&plant, std::slice::from_ref(&recording), &options)?;
        let Some(point) = fitted.points.first() else {
            return Ok(None);
        };
        let own = plant.run(log, point, hold)?.outputs;
        let states = plant.spec.states().into_iter().zip(&point.start);
        Ok(Some(Original {
            inputs: vec![],
            start: states
                .filter_map(|(v, start)| Some((plant.spec.variable(v).name.clone(), (*start)?)))
                .collect(),
            remainder: simulated
                .iter()
                .zip(&own)
                .map(|(y, own)| y.iter().zip(own).map(|(y, own)| y - own).collect())
                .collect(),
        }))
    }

    /// Outputs on the inputs of `log`, which is another recording: what has changed has changed before it. `simulated` is the
    /// answer of the original simulator to the same inputs.
    ///
    /// # Errors
    /// [`AugmentedPlantError`]: as for [`Self::original`].
    pub fn simulate(
        &self,
        log: &Log,
        simulated: Option<&[Vec<f64>]>,
    ) -> Result<Vec<Vec<f64>>, AugmentedPlantError> {
        let plant = plant_of(&self.modelica)?;
        let mut point = plant.nominal();
        let named = |v| plant.spec.variable(v).name.as_str();
        for (value, v) in point.parameters.iter_mut().zip(plant.spec.parameters()) {
            if self.times_of_change.iter().any(|name| name == named(v)) {
                *value = log.start_time - log.sample_time;
            }
        }
        let original = self.original(log, simulated, self.hold())?;
        let original = original.unwrap_or_default();
        for (start, v) in point.start.iter_mut().zip(plant.spec.states()) {
            let known = original.start.iter().find(|(name, _)| name == named(v));
            *start = known.map_or(*start, |(_, value)| Some(*value));
        }
        let mut log = log.clone();
        log.input_data.extend(original.inputs.iter().cloned());
        let mut outputs = plant.run(&log, &point, self.hold())?.outputs;
        original.add_remainder(&mut outputs);
        Ok(outputs)
    }
}

impl Original {
    /// Adds what the equations miss to their outputs.
    pub fn add_remainder(&self, outputs: &mut [Vec<f64>]) {
        for (y, rest) in outputs.iter_mut().zip(&self.remainder) {
            y.iter_mut().zip(rest).for_each(|(y, rest)| *y += rest);
        }
    }
}
