//! What the errors of the parameters do to the residuals and to the tests.
//!
//! | file | what it holds |
//! |---|---|
//! | `filters`, `residual_sensitivity` | how residuals move with the parameters |
//! | `curvature` | what first-order theory misses |
//! | `statistic` | statistic, degrees of freedom, bounds |

mod curvature;
mod filters;
mod residual_sensitivity;
mod statistic;

pub(crate) use filters::Filters;
pub(crate) use residual_sensitivity::{Regressor, Sensitivity, directions};
pub(crate) use statistic::{Outcome, ScoreCovariance, outcome};
