//! The model.
mod state_space;
pub use state_space::StateSpace;
