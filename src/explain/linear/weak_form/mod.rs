//! Drives: what is missing where a free run cannot tell.
//!
//! A mass that a force moves against friction integrates. In free run its position drifts away with any error, the more
//! so when the recording was taken in closed loop, and the free-run error then has a flat valley along which mass,
//! friction and offset trade against each other. Its equation of motion, averaged over short windows, has none of this:
//!
//! ```text
//! u = M a + d v + F0 + laws(x, v, u)     times a bump, summed over its window, derivatives moved onto the bump
//! ```
//!
//! It is linear in mass, friction and laws, needs no initial state, and feedback does no harm to it. So laws are
//! chosen there, and the free run only trims the coefficients within what the averaged equation leaves open.
//!
//! | file | what it holds |
//! |---|---|
//! | `windows` | bumps, rates, how long the windows must be |
//! | `correlated_regression` | least squares with correlated errors |
//! | `laws`, `equation_of_motion` | the library as columns; an equation of motion, and the same as a plant |
//! | `rank` | which law |
//! | `force_adequacy` | the test of the residual force |
//! | `tether` | the free run with the averaged equation as prior |
//! | `equation_proof` | the tethered fit, its errors across halves, what it adds to a decision |
//!
//! When this is the way, and what it decides, is said in [`averaged_decision`](super::decision::averaged_decision).

pub(crate) mod correlated_regression;
pub(crate) mod equation_of_motion;
pub(crate) mod equation_proof;
pub(crate) mod force_adequacy;
pub(crate) mod laws;
pub(crate) mod rank;
#[cfg(test)]
mod tests;
pub(crate) mod tether;
pub(crate) mod windows;
