//! The stochastic step: `K` and `Lambda` for a deterministic part `A, B, C, D` that is already there.
//!
//! Every method has such a step of its own; [`Stochastic`] names those that can replace it, for any
//! deterministic part. A step is one variant of [`Stochastic`] and one module.
//!
//! | file | step | source |
//! |---|---|---|
//! | `innovations` | [`Stochastic::Innovations`] | least squares in the vector ARX coefficients |
//! | `residual` | [`Stochastic::FirstColumn`], [`Stochastic::Cholesky`] | Knudsen (35)-(40) |
//! | `combined` | a method's deterministic part with another stochastic step | |

mod combined;
mod innovations;
mod residual;

use nalgebra::DMatrix;

pub(crate) use super::algorithms::Stochastic;
use super::identify_error::IdentifyError;
use super::knudsen::ResidualStep;
use super::method::{Decomposed, Windows};
use super::variance::Propagation;
use crate::model::StateSpace;
use crate::moments::RFactor;

/// What a stochastic step delivers, in the scaled units and the state basis of the deterministic part.
#[derive(Debug, Clone)]
pub(crate) struct StochasticPart {
    /// Observer gain `K`, `n x l`.
    pub(crate) gain: DMatrix<f64>,
    /// Covariance of the innovations, `l x l`.
    pub(crate) innovation_covariance: DMatrix<f64>,
}

impl Stochastic {
    /// Past window of the data factor that [`Stochastic::estimate`] takes.
    pub(crate) fn window(self, windows: &Windows) -> usize {
        match self {
            Self::Innovations => windows.factor.past,
            Self::FirstColumn | Self::Cholesky => windows.factor.past + windows.future - 1,
        }
    }

    /// Estimates the stochastic part from a data factor of window [`Stochastic::window`]. The `K` of
    /// `deterministic` is not looked at.
    ///
    /// # Errors
    /// [`IdentifyError`] when the data do not determine it.
    pub(crate) fn estimate(
        self,
        deterministic: &StateSpace,
        windows: &Windows,
        factor: &RFactor,
    ) -> Result<StochasticPart, IdentifyError> {
        match self {
            Self::Innovations => innovations::estimate(deterministic, windows, factor),
            Self::FirstColumn => {
                residual::estimate(deterministic, windows, factor, ResidualStep::FirstColumn)
            }
            Self::Cholesky => {
                residual::estimate(deterministic, windows, factor, ResidualStep::Cholesky)
            }
        }
    }

    /// Errors of the parameters of `system`, whose `K` this step has estimated, when the errors of its
    /// deterministic part are those of `of_method` (whose rows for `K` are not looked at). `None` when there is
    /// no formula.
    ///
    /// # Errors
    /// [`IdentifyError::Linalg`] when a factorisation fails.
    pub(crate) fn propagation(
        self,
        system: &StateSpace,
        windows: &Windows,
        of_method: Propagation,
    ) -> Result<Option<Propagation>, IdentifyError> {
        match self {
            Self::Innovations => {
                innovations::propagation(system, &windows.varx, of_method).map(Some)
            }
            Self::FirstColumn | Self::Cholesky => Ok(None),
        }
    }

    /// The method whose deterministic part is `inner`, with this stochastic step in the place of its own.
    pub(crate) fn instead_of_own(self, inner: Decomposed, windows: Windows) -> Decomposed {
        combined::combined(self, inner, windows)
    }
}
