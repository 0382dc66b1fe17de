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
use serde::{Deserialize, Serialize};

use super::error::IdentifyError;
use super::knudsen::ResidualStep;
use super::method::{Decomposed, Windows};
use super::variance::Propagation;
use crate::model::StateSpace;
use crate::moments::RFactor;

/// Step that estimates `K` and `Lambda` in the place of the method's own.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema, clap::ValueEnum,
)]
#[serde(rename_all = "kebab-case")]
pub enum Stochastic {
    /// The gain whose one-step predictor is nearest to the vector ARX model, given A, B, C, D: maximum
    /// likelihood for K alone, also in closed loop
    Innovations,
    /// Knudsen's tk: the first block column of the covariance of stacked residuals; open loop only
    FirstColumn,
    /// Knudsen's tk-chol: its Cholesky factor, which takes most of the bias of tk away; open loop only
    Cholesky,
}

/// What a stochastic step delivers, in the scaled units and the state basis of the deterministic part.
#[derive(Debug, Clone)]
pub struct StochasticPart {
    /// Observer gain `K`, `n x l`.
    pub gain: DMatrix<f64>,
    /// Covariance of the innovations, `l x l`.
    pub innovation_covariance: DMatrix<f64>,
}

impl Stochastic {
    /// Every step there is.
    pub fn all() -> &'static [Self] {
        clap::ValueEnum::value_variants()
    }

    /// The name on the command line and in documents.
    pub fn name(self) -> &'static str {
        match self {
            Self::Innovations => "innovations",
            Self::FirstColumn => "first-column",
            Self::Cholesky => "cholesky",
        }
    }

    /// Whether feedback biases the estimate.
    pub fn open_loop_only(self) -> bool {
        match self {
            Self::Innovations => false,
            Self::FirstColumn | Self::Cholesky => true,
        }
    }

    /// Whether [`Stochastic::propagation`] has a formula.
    pub fn has_covariance(self) -> bool {
        match self {
            Self::Innovations => true,
            Self::FirstColumn | Self::Cholesky => false,
        }
    }

    /// Lags that the moments must hold for these windows; `future` is `None` when it is chosen later, and is at
    /// most `past` then.
    pub fn lags(self, past: usize, future: Option<usize>) -> usize {
        match self {
            Self::Innovations => past,
            Self::FirstColumn | Self::Cholesky => past.saturating_add(future.unwrap_or(past)),
        }
    }

    /// Past window of the data factor that [`Stochastic::estimate`] takes.
    pub fn window(self, windows: &Windows) -> usize {
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
    pub fn estimate(
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
    pub fn propagation(
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
    pub fn instead_of_own(self, inner: Decomposed, windows: Windows) -> Decomposed {
        combined::combined(self, inner, windows)
    }
}
