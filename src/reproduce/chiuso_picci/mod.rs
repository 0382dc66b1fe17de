//! Chiuso & Picci, *Estimating the asymptotic variance of closed loop subspace estimators*: both examples of
//! section 5.
//!
//! | file | what it holds |
//! |---|---|
//! | `algorithm` | the algorithms; one run of one of them; its true asymptotic variance |
//! | `variance` | estimated variances of many runs against the true one |
//! | `statements` | what the paper says, held against that |
//! | `one`, `two` | the examples |

mod algorithm;
mod one;
mod statements;
mod two;
mod variance;

pub use one::ChiusoPicciOne;
pub use two::ChiusoPicciTwo;

/// The paper.
const PAPER: &str =
    "A. Chiuso, G. Picci, Estimating the asymptotic variance of closed loop subspace estimators";

/// Number of Monte Carlo runs in section 5.
const PAPER_RUNS: usize = 1000;
