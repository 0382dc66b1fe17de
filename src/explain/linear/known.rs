//! The simulation as the engine knows it.

use super::check::Checked;
use super::data::Data;
use super::identification::step_response_test::Uncertainty;
use super::model::structure::Structure;
use super::model::time_stepping::MOST_STATES;
use crate::explain::document::explain_error::ExplainError;
use crate::explain::simulation::Simulation;
use crate::linalg::spectral_radius;

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

impl Known {
    /// Refuses what is too large, too short or unstable.
    pub(super) fn check(&self, checked: &Checked) -> Result<(), ExplainError> {
        let simulation = &checked.simulation;
        let states = self.structure.states();
        if states > MOST_STATES {
            return Err(ExplainError::TooLarge {
                name: simulation_name(simulation),
                states,
                most: MOST_STATES,
            });
        }
        let needed = LEAST_SAMPLES.max(SAMPLES_A_STATE * states);
        if self.data.samples() < needed {
            return Err(ExplainError::TooShort {
                recording: checked.recordings[0].name.clone(),
                samples: self.data.samples(),
                needed,
                states,
            });
        }
        if self
            .structure
            .simulate(&self.structure.given(), &self.data)
            .is_none()
        {
            return Err(ExplainError::Unstable {
                name: simulation_name(simulation),
                radius: spectral_radius(&self.structure.coordinates.given.a_matrix())
                    .unwrap_or(f64::NAN),
            });
        }
        Ok(())
    }
}

fn simulation_name(simulation: &Simulation) -> String {
    match simulation {
        Simulation::Model(_, name) => name.clone(),
        Simulation::Outputs(logs) => logs.first().map_or_else(String::new, |l| l.name.clone()),
    }
}
