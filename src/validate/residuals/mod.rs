//! The one pass over the records, and what it leaves.
//!
//! | file | what it holds |
//! |---|---|
//! | `residual_pass` | residuals, and their lag products with the inputs |
//! | `fit_measure` | fit measures, accumulated block by block |
//! | `own_past` | how much of its own past a signal needs to be predicted |
//! | `partial` | partial correlations from lag products |

mod fit_measure;
mod own_past;
mod partial;
mod residual_pass;

pub(crate) use fit_measure::fit_measure;
pub(crate) use own_past::{longest, order};
pub(crate) use partial::Partial;
pub(crate) use residual_pass::{ROUNDING, Residuals, Start, cut, residuals, start_up};
