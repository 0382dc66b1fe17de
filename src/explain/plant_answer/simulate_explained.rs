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
    /// The start of the original simulator cannot be found.
    #[error(transparent)]
    Start(#[from] EstimateError),
    /// The equations cannot be simulated.
    #[error(transparent)]
    Equations(#[from] SimulationError),
}

/// The equations of a simulator beside its answer to an input.
#[derive(Debug, Clone, PartialEq)]
pub struct Original {
    /// Where its states start.
    pub start: Vec<(String, f64)>,
    /// Simulated outputs less those of the equations.
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

    /// Finds where the simulator started that was known by its columns, and what its equations miss of its answer to the inputs
    /// of `log`; none where the simulation was given as equations.
    ///
    /// # Errors
    /// [`AugmentedPlantError`]: a damaged explanation, columns that do not fit, equations that cannot be simulated.
    pub fn original(
        &self,
        log: &Log,
        simulated: &[Vec<f64>],
        hold: Hold,
    ) -> Result<Option<Original>, AugmentedPlantError> {
        let Some(text) = &self.simulation else {
            return Ok(None);
        };
        let plant = plant_of(text)?;
        let fits = simulated.iter().filter(|y| y.len() == log.samples());
        let (needed, found) = (plant.spec.outputs().len(), fits.count());
        if found != needed || simulated.len() != needed {
            return Err(AugmentedPlantError::Simulation { needed, found });
        }
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
        let original = match simulated {
            Some(simulated) => self.original(log, simulated, self.hold())?,
            None => None,
        };
        let Some(original) = original else {
            return Ok(plant.run(log, &point, self.hold())?.outputs);
        };
        for (start, v) in point.start.iter_mut().zip(plant.spec.states()) {
            let known = original.start.iter().find(|(name, _)| name == named(v));
            *start = known.map_or(*start, |(_, value)| Some(*value));
        }
        let mut outputs = plant.run(log, &point, self.hold())?.outputs;
        for (y, rest) in outputs.iter_mut().zip(&original.remainder) {
            y.iter_mut().zip(rest).for_each(|(y, rest)| *y += rest);
        }
        Ok(outputs)
    }
}
