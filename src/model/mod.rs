//! The model: a state-space system in innovation form, and what can be computed from it alone.
//!
//! | file | what it holds |
//! |---|---|
//! | `state_space` | [`StateSpace`]: matrices, checks, change of basis |
//! | `recursion` | the one loop over samples that simulation and prediction share |
//! | `simulate_system` | free run from inputs (and innovations), also block by block: [`Simulator`] |
//! | `predict` | one-step predictions and innovations, also block by block: [`Predictor`] |
//! | `initial_state` | the initial state that explains a recording best |
//! | `frequency` | frequency responses from input and from innovation, default frequency grid |
//! | `poles` | poles with natural frequency, damping, time constant |
//! | `zeros` | invariant zeros |
//! | `response` | impulse and step responses, static gain |
//! | `armax` | the polynomials of a single-input single-output model |
//! | `model_error` | [`ModelError`] |

mod armax;
mod frequency;
mod initial_state;
mod model_error;
mod poles;
mod predict;
mod recursion;
mod response;
mod simulate_system;
mod state_space;
mod zeros;

pub use armax::Armax;
pub(crate) use frequency::resolvent_products;
pub use initial_state::estimate_initial_state;
pub use model_error::ModelError;
pub use poles::Pole;
pub(crate) use poles::slowest_first;
pub use predict::{Prediction, Predictor};
pub use simulate_system::Simulator;
pub use state_space::StateSpace;
pub(crate) use zeros::zero_directions;
