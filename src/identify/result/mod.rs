//! What is delivered.
//!
//! | file | what it holds |
//! |---|---|
//! | `final_estimate` | the final model: polish or not, stability, covariance |
//! | `scaling` | from scaled channels back to the user's units |
//! | `resolution` | what the steps of a recording do to the estimate |
//! | `summary`, `warnings` | what is reported beside the matrices; what to know before trusting a model |

mod final_estimate;
mod resolution;
mod scaling;
mod summary;
mod warnings;

pub(crate) use final_estimate::Fit;
pub(crate) use final_estimate::{Chosen, finish};
pub use resolution::CoarseChannel;
pub(crate) use resolution::stepped;
pub use summary::{Asked, Diagnostics, Horizons, OrderTest, PastEvidence, StabilityCost, Summary};
pub(crate) use warnings::of_closed_loop;
