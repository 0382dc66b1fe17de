//! Simulation of a plant with sensitivities, and its linearisation.
//!
//! `tape` compiles the equations to instructions, `execute` runs them with derivatives (`dual`), `field` is the derivative of the
//! states at a point, `step` one step of an integration method, `step_control` the choice of the steps, `integrator` a run; `linear`
//! takes plants that are linear in their states from sample to sample by matrices.

mod dense;
mod dual;
mod field;
mod frozen;
mod integrator;
mod linear;
mod linearise;
mod plant;
mod run;
mod step;
mod step_control;
mod tape;
#[cfg(test)]
mod tests;

pub use linearise::LinearPlant;
pub use plant::{Plant, SimulationError};
pub use run::{Direction, Excitation, Hold, Observer, Plan, Point, Trajectory};
