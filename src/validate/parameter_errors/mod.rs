//! What the errors of the parameters do to the residuals and to the tests.
//!
//! | file | what it holds |
//! |---|---|
//! | `filters`, `residual_sensitivity`, `averages` | how residuals move with the parameters |
//! | `curvature` | what first-order theory misses |
//! | `statistic` | statistic, degrees of freedom, bounds |

mod averages;
mod curvature;
mod filters;
mod residual_sensitivity;
mod statistic;

pub(crate) use averages::Regressor;
pub(crate) use filters::Filters;
pub(crate) use residual_sensitivity::{Sensitivity, directions};
pub(crate) use statistic::{Outcome, ScoreCovariance, outcome};
