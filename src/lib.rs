//! innovant
pub mod covariance;
pub mod identify;
pub mod linalg;
pub mod log;
pub mod model;
pub mod moments;
pub mod systems;

pub use identify::{IdentifyError, Model, Options, identify};
