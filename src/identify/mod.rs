//! From recordings to a model: windows, order, estimate, polish.
//!
//! [`identify()`] does it all. Its steps, each in a file of its own:
//!
//! | file | step | source |
//! |---|---|---|
//! | `records`, `delay`, `data` | recordings, streamed once, aligned, as moments | |
//! | `options`, `algorithms` | what the user may choose | |
//! | `fit`, `aligned` | all of it, with and without a search for dead time | |
//! | `dead_time` | inputs that do nothing for some samples | |
//! | `reduced` | recordings of which only moments are left: pieces of a cluster's work | |
//! | `lags`, `horizon` | windows that are asked for; past window by Akaike's criterion, future window | |
//! | `varx` | the high-order vector ARX model | van Wingerden (22)-(23) |
//! | `method` | which algorithm: one enum variant and one module each | |
//! | `pbsid_opt` | states by a weighted singular value decomposition, system matrices by least squares | van Wingerden (24)-(34) |
//! | `variance` | the covariance of an estimate in closed form | van Wingerden (35)-(41); Chiuso & Picci (3.1)-(3.5) |
//! | `stochastic` | `K` and `Lambda` by a step of its own, for any deterministic part | |
//! | `weighted` | the singular value decomposition that states are taken from | van Wingerden (28)-(29) |
//! | `nested` | states from nested regressions, growing past | Chiuso & Picci; Qin & Ljung |
//! | `knudsen` | regression of future outputs on past and future inputs; tk, tk-chol | Knudsen |
//! | `pem` | the prediction error method in the time domain | Ljung |
//! | `baselines` | subid, an n4sid, the methods of Knudsen's table 2 | van Overschee & De Moor; Ljung |
//! | `order`, `select` | which order: singular values propose, a chi-square test referees | Bauer 2001 |
//! | `free_run` | the order of a plant that is not linear: by free runs on blocks held out | Breiman et al. 1984 |
//! | `truncation` | what the past window cuts off | |
//! | `polish` | the maximum-likelihood model of that order | Soderstrom, Stoica & Friedlander 1991 |
//! | `stable` | a stable model, guaranteed | |
//! | `resolution` | what the steps of a recording do to the estimate | |
//! | `finish`, `scaling`, `warnings` | covariance, the user's units, what to know before trusting it | |
//! | `model`, `simulate`, `summary` | the result | |
//!
//! Conventions: `x[k+1] = A x[k] + B u[k] + K e[k]`, `y[k] = C x[k] + D u[k] + e[k]`; `r` inputs, `l` outputs,
//! `n` states, `z = [u; y]`, `q = r + l`; past window `p`, future window `f <= p`, `Nc = N - p` windows.

mod algorithms;
mod aligned;
pub mod baselines;
mod candidate;
mod data;
mod dead_time;
mod delay;
mod error;
mod finish;
mod fit;
mod free_run;
mod horizon;
pub mod knudsen;
mod lags;
mod memory;
pub mod method;
mod model;
mod nested;
mod options;
mod order;
mod pbsid_opt;
pub mod pem;
mod polish;
mod records;
mod reduced;
mod resolution;
mod scaling;
mod select;
mod simulate;
mod source;
mod stable;
pub mod stochastic;
mod summary;
mod truncation;
pub mod variance;
mod varx;
mod warnings;
mod weighted;

pub use algorithms::{Method, Stochastic};
pub use delay::{AlignedColumns, Aligner};
pub use error::IdentifyError;
pub use finish::Fit;
pub use fit::fit;
pub use free_run::FreeRunRest;
pub(crate) use model::channel_names;
pub use model::{IdentifiedChannel, Model, identify, identify_records};
pub use nested::{
    Nested, NestedDecomposition, Prediction, decompose_nested, nested_system_matrices,
};
pub use options::{CovarianceKind, Options, Order, Polish};
pub use order::OrderEvidence;
pub use pbsid_opt::{Decomposition, Estimate, Weight, decompose, system_matrices};
pub use polish::{Effort, Polished, coefficient_cost, polish, predictor_coefficients};
pub use records::{FileRecords, MemoryRecords, ReadProgress, Recording, Records, on_files};
pub use reduced::{ReducedRecords, SAMPLES_KEPT};
pub use resolution::CoarseChannel;
pub use source::Source;
pub use summary::{Asked, Diagnostics, Horizons, OrderTest, PastEvidence, StabilityCost, Summary};
pub use variance::Propagation;
pub use varx::{Varx, varx};
pub use warnings::of_closed_loop as warnings_of_closed_loop;
pub use weighted::WeightedSvd;
