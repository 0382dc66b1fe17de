//! Chiuso & Picci, *Estimating the asymptotic variance of closed loop subspace estimators*: both examples of
//! section 5.
//!
//! | file | what it holds |
//! |---|---|
//! | `algorithm` | the algorithms; one run of one of them; its true asymptotic variance |
//! | `variance` | estimated variances of many runs against the true one |
//! | `chiuso_picci_statements` | what the paper says, held against that |
//! | `variance_study` | what both examples share |
//! | `first_order_example`, `fifth_order_example` | the examples |

mod algorithm;
mod chiuso_picci_statements;
mod fifth_order_example;
mod first_order_example;
mod variance;
mod variance_study;

pub(crate) use fifth_order_example::ChiusoPicciTwo;
pub(crate) use first_order_example::ChiusoPicciOne;

/// The paper.
const PAPER: &str =
    "A. Chiuso, G. Picci, Estimating the asymptotic variance of closed loop subspace estimators";

/// Number of Monte Carlo runs in section 5.
const PAPER_RUNS: usize = 1000;
