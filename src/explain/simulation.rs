//! The simulation as the caller gives it.

use crate::identify::Model;
use crate::log::Log;

/// What stands for the simulation.
#[derive(Debug, Clone)]
pub enum Simulation {
    /// A linear model, with the name that messages call it.
    Model(Box<Model>, String),
    /// Simulated outputs of any simulator, one log a recording (only its outputs are used).
    Outputs(Vec<Log>),
}
