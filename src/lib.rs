//! innovant
pub mod covariance;
pub mod linalg;
pub mod model;
pub mod moments;
