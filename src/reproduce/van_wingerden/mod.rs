//! van Wingerden, *The asymptotic variance of the PBSIDopt algorithm*: both examples.
//!
//! | file | what it holds |
//! |---|---|
//! | `estimation_run` | one run: PBSID_opt at the paper's windows, its covariance, its polish |
//! | `measure` | how well the bounds of many runs hold |
//! | `bode` | the Monte Carlo study and its figure, which both examples share |
//! | `sign` | the sign of the terms beta, by a path-wise check |
//! | `fourth_order_example`, `acoustic_duct_example` | the examples |

mod acoustic_duct_example;
mod bode;
mod estimation_run;
mod fourth_order_example;
mod measure;
mod sign;

pub(crate) use acoustic_duct_example::VanWingerdenTwo;
pub(crate) use fourth_order_example::VanWingerdenOne;

/// The paper.
const PAPER: &str = "J.W. van Wingerden, The asymptotic variance of the PBSIDopt algorithm";

/// A standard deviation that is wrong by less than this factor still tells how accurate an estimate is: this is
/// what the paper's "realistic" and "similar" are held against. Finer claims are told by coverage.
const REALISTIC: f64 = 1.25;

/// Whether two standard deviations are equal within [`REALISTIC`].
fn similar(ratio: f64) -> bool {
    (1.0 / REALISTIC..=REALISTIC).contains(&ratio)
}
