//! Covariance.
mod parameters;
pub use parameters::{ParameterCovariance, ParameterLayout};
