//! Knudsen, *Subspace identification - reducing uncertainty on the stochastic part* (2001).
//!
//! A regression of `h` future outputs on `i` past samples and the future inputs gives `Gamma_h`, and through its
//! orthogonal complement the deterministic part; the covariance of the residuals gives the stochastic part, by its
//! first block column (**tk**) or by its Cholesky factor (**tk-chol**). All of it comes from the triangular factor of
//! the data, at a cost that does not depend on the number of samples.
//!
//! | file | step | equations |
//! |---|---|---|
//! | `future_regression` | `Theta` and `P` | (7)-(8), (25) |
//! | `observability` | `Gamma_h`, its complement, the Toeplitz least-squares problem | (13)-(15), (24), (38) |
//! | `deterministic` | `A`, `B`, `C`, `D` | (22)-(24) |
//! | `stochastic` | `K`, `R`; the minimum-phase noise model | (35)-(40) |
//! | `jacobian`, `influence` | their covariance by the delta method | |
//!
//! Errors in print: (23) has to read `A = pinv(Gamma^u) Gamma^l`; the right-hand side of (17) is `Theta_f`; the rms
//! (42) lacks its square root; and the BJ row of table 1 is that of noise models converted to minimum phase, which the
//! paper does not mention. It says that a larger `i` performs poorly: with `h = n + 2` kept, `i = 20` lowers the rms
//! of the noise parameters by a third and more in two of the paper's three systems.
//!
//! The inputs must not depend on past outputs: in closed loop the future inputs are correlated with the noise, and
//! every part of the estimate is biased.

mod deterministic;
mod future_regression;
mod influence;
mod jacobian;
mod observability;
mod stochastic;
#[cfg(test)]
mod tests;

use super::identify_error::IdentifyError;
use crate::model::StateSpace;

pub(crate) use deterministic::{Deterministic, deterministic, inputs};
pub(crate) use future_regression::Regression;
pub(crate) use influence::Influence;
pub(crate) use jacobian::jacobian;
pub(crate) use observability::{Decomposition, Observability, extended_observability};
pub(crate) use stochastic::{NoiseModel, ResidualStep, minimum_phase, stochastic};

/// A model of one order with what its covariance needs.
#[derive(Debug, Clone)]
pub(crate) struct Knudsen {
    /// Innovation form with a stable predictor, in the units of the regression.
    pub(crate) system: StateSpace,
    /// Covariance of the innovations.
    pub(crate) innovation_covariance: nalgebra::DMatrix<f64>,
    /// The deterministic part.
    pub(crate) deterministic: Deterministic,
    /// The noise model before it was made minimum phase.
    pub(crate) raw_noise: NoiseModel,
}

/// Knudsen's estimate of one order.
///
/// # Errors
/// [`IdentifyError::Order`] for an order that the future window does not allow, [`IdentifyError::SingularRegression`]
/// when the data do not determine the model.
pub(crate) fn knudsen(
    regression: &Regression,
    decomposition: &Decomposition,
    order: usize,
    feedthrough: bool,
    step: ResidualStep,
    sample_time: f64,
) -> Result<Knudsen, IdentifyError> {
    let deterministic = deterministic(regression, decomposition, order, feedthrough)?;
    let (a, c) = (&deterministic.a, &deterministic.c);
    let raw_noise = stochastic(regression, &deterministic.observability, a, c, step)?;
    let (noise, _) = minimum_phase(a, c, raw_noise.clone());
    Ok(Knudsen {
        system: StateSpace {
            a: a.clone(),
            b: deterministic.b.clone(),
            c: c.clone(),
            d: deterministic.d.clone(),
            k: noise.k,
            sample_time,
        },
        innovation_covariance: noise.innovation_covariance,
        deterministic,
        raw_noise,
    })
}
