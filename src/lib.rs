//! innovant
pub mod cli;
pub mod covariance;
pub mod identify;
pub mod linalg;
pub mod log;
pub mod model;
pub mod moments;
pub mod report;
pub mod systems;
pub mod validate;

pub use identify::{IdentifyError, Model, Options, identify};
