//! Knudsen, *Subspace identification - reducing uncertainty on the stochastic part* (2001): section 6, all three test
//! systems, all methods of table 2 that run here.
//!
//! | file | what it holds |
//! |---|---|
//! | `methods` | the methods, one recording at a time |
//! | `errors` | errors of the parameters over many recordings |
//! | `knudsen_statements` | what the paper says, held against that |
//! | `experiment` | the three experiments |

mod errors;
mod experiment;
mod knudsen_statements;
mod methods;

pub(crate) use experiment::knudsen_experiments;

/// The paper.
const PAPER: &str =
    "T. Knudsen, Subspace identification - reducing uncertainty on the stochastic part (2001)";

/// Replications in section 6.
const PAPER_RUNS: usize = 200;
/// Samples of a recording in section 6.
const SAMPLES: usize = 500;
