//! From recordings to a model: windows, order, estimate, polish.
//!
//! [`identify()`] does it all. Its steps:
//!
//! | folder or file | step | source |
//! |---|---|---|
//! | `options`, `algorithms` | what the user may choose | |
//! | `data` | recordings, streamed once, aligned, as moments | |
//! | `fit_recordings`, `fit_aligned` | all of it, with and without a search for dead time | |
//! | `horizon` | past window by Akaike's criterion, future window | |
//! | `subspace` | high-order vector ARX model, states, system matrices, truncation | van Wingerden; Chiuso & Picci; Qin & Ljung |
//! | `method` | which algorithm: one enum variant and one module each | |
//! | `variance` | the covariance of an estimate in closed form | van Wingerden (35)-(41); Chiuso & Picci (3.1)-(3.5) |
//! | `stochastic` | `K` and `Lambda` by a step of its own, for any deterministic part | |
//! | `knudsen` | regression of future outputs on past and future inputs; tk, tk-chol | Knudsen |
//! | `pem` | the prediction error method in the time domain | Ljung |
//! | `baselines` | subid, an n4sid, the methods of Knudsen's table 2 | van Overschee & De Moor; Ljung |
//! | `order` | how many states: proposed, tested, chosen; dead time of the inputs | Bauer 2001; Breiman et al. 1984 |
//! | `polish` | the maximum-likelihood model of that order | Soderstrom, Stoica & Friedlander 1991 |
//! | `stable` | a stable model, guaranteed | |
//! | `result` | covariance, the user's units, summary, what to know before trusting it | |
//! | `identified_model`, `simulate_recording` | the model that is delivered | |
//!
//! Conventions: `x[k+1] = A x[k] + B u[k] + K e[k]`, `y[k] = C x[k] + D u[k] + e[k]`; `r` inputs, `l` outputs,
//! `n` states, `z = [u; y]`, `q = r + l`; past window `p`, future window `f <= p`, `Nc = N - p` windows.

mod algorithms;
pub(crate) mod baselines;
mod data;
mod fit_aligned;
pub(crate) mod fit_recordings;
mod horizon;
mod identified_model;
mod identify_error;
pub(crate) mod knudsen;
pub(crate) mod method;
mod options;
mod order;
pub(crate) mod pem;
pub(crate) mod polish;
mod result;
mod simulate_recording;
mod stable;
pub(crate) mod stochastic;
pub(crate) mod subspace;
pub(crate) mod variance;

pub use crate::moments::{Detrend, Route};
pub use algorithms::{Method, Stochastic};
pub(crate) use data::AlignedColumns;
#[cfg(feature = "cli")]
pub(crate) use data::on_files;
pub use data::{
    FileRecords, MemoryRecords, ReadProgress, Recording, Records, ReducedRecords, SAMPLES_KEPT,
};
pub(crate) use identified_model::channel_names;
pub use identified_model::{IdentifiedChannel, Model, identify, identify_records};
pub use identify_error::IdentifyError;
pub use options::{CovarianceKind, Options, Order, Polish};
pub use order::{FreeRunRest, OrderEvidence};
#[cfg(feature = "cli")]
pub(crate) use polish::{Effort, polish, predictor_coefficients};
#[cfg(test)]
pub(crate) use result::Fit;
pub(crate) use result::of_closed_loop as warnings_of_closed_loop;
pub use result::{
    Asked, CoarseChannel, Diagnostics, Horizons, OrderTest, PastEvidence, StabilityCost, Summary,
};
#[cfg(feature = "cli")]
pub(crate) use subspace::{Decomposition, Estimate, Varx, decompose, system_matrices, varx};
pub use subspace::{Prediction, Weight};
