//! Covariance.
mod jackknife;
mod parameters;
mod subspace;
pub use jackknife::jackknife_covariance;
pub use parameters::{ParameterCovariance, ParameterLayout};
pub use subspace::{subspace_covariance, subspace_jacobian};
