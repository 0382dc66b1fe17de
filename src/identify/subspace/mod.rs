//! The steps that predictor-based subspace methods share.
//!
//! | file | step | source |
//! |---|---|---|
//! | `varx` | the high-order vector ARX model | van Wingerden (22)-(23) |
//! | `weighted` | the singular value decomposition that states are taken from | van Wingerden (28)-(29) |
//! | `pbsid_opt` | states by that decomposition, system matrices by least squares | van Wingerden (24)-(34) |
//! | `nested` | states from nested regressions, growing past | Chiuso & Picci; Qin & Ljung |
//! | `truncation` | what the past window cuts off | |

mod nested;
mod pbsid_opt;
mod truncation;
mod varx;
mod weighted;

pub use nested::Prediction;
pub(crate) use nested::{Nested, NestedDecomposition, decompose_nested, nested_system_matrices};
pub(crate) use pbsid_opt::Decomposition;
pub use pbsid_opt::{Estimate, Weight, decompose, system_matrices};
pub(crate) use truncation::{
    LARGEST_FOR_POLISH, past_for_truncation, state_covariance, truncation,
};
pub use varx::{Varx, varx};
