//! The algorithms by name, and what is known of each before there are any data.
//!
//! `method` and `stochastic` carry them out.

use serde::{Deserialize, Serialize};

use super::horizon;
use super::subspace::Weight;

/// The smallest past window that is chosen automatically for Knudsen's method. The paper finds that a larger one than `n + 2` performs
/// poorly; with the future window kept at `n / l + 2` the opposite was measured: the rms of the noise parameters falls
/// by a third and more in two of its three systems.
const SMALLEST_PAST_OF_KNUDSEN: usize = 20;

/// Algorithm that estimates the system matrices.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, schemars::JsonSchema,
)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Predictor-based subspace identification, optimised (van Wingerden); the first step of the
    /// maximum-likelihood polish
    #[default]
    PbsidOpt,
    /// Knudsen's tk-chol (with --stochastic first-column tk); open loop only
    Knudsen,
    /// Prediction error method: maximum likelihood in the time domain, started from tk-chol or PBSID_opt
    Pem,
    /// Robust combined subspace algorithm of van Overschee and De Moor; open loop only
    Subid,
    /// Predictor-based with nested regressions, also called the whitening filter (Chiuso & Picci)
    Whitening,
    /// Innovation estimation (Qin & Ljung): least disturbed by a past window that is short for the noise dynamics
    InnovationEstimation,
}

impl Method {
    /// Every method there is.
    pub fn all() -> &'static [Self] {
        &[
            Self::PbsidOpt,
            Self::Knudsen,
            Self::Pem,
            Self::Subid,
            Self::Whitening,
            Self::InnovationEstimation,
        ]
    }

    /// The name on the command line and in documents.
    pub fn name(self) -> &'static str {
        match self {
            Self::PbsidOpt => "pbsid-opt",
            Self::Knudsen => "knudsen",
            Self::Pem => "pem",
            Self::Subid => "subid",
            Self::Whitening => "whitening",
            Self::InnovationEstimation => "innovation-estimation",
        }
    }

    /// Lags that the moments must hold for these windows; `future` is `None` when it is chosen later, and is at
    /// most `past` then.
    pub(crate) fn lags(self, past: usize, future: Option<usize>) -> usize {
        match self {
            Self::PbsidOpt => past,
            Self::Whitening | Self::InnovationEstimation => {
                past.saturating_add(future.unwrap_or(past))
            }
            // An order that fits the past window of l outputs has a future of at most past + 2.
            Self::Knudsen | Self::Pem | Self::Subid => {
                past.saturating_add(future.unwrap_or(past.saturating_add(2)))
            }
        }
    }

    /// Whether the future window may be longer than the past window.
    pub fn allows_longer_future(self) -> bool {
        match self {
            Self::PbsidOpt | Self::Pem | Self::Subid => false,
            Self::Whitening | Self::InnovationEstimation | Self::Knudsen => true,
        }
    }

    /// Future window for an order when none is asked for.
    pub(crate) fn future(self, past: usize, outputs: usize, order: usize) -> usize {
        match self {
            Self::PbsidOpt | Self::Whitening | Self::InnovationEstimation | Self::Pem => {
                horizon::future_for_order(past, outputs, order)
            }
            // Longer ones add noise to the Toeplitz matrices faster than they add information.
            Self::Knudsen => order.div_ceil(outputs) + 2,
            // The algorithm needs both windows equal.
            Self::Subid => past,
        }
    }

    /// Smallest past window that is chosen automatically, for the largest order that is asked for.
    pub(crate) fn smallest_past(self, outputs: usize, order: usize) -> usize {
        match self {
            Self::PbsidOpt | Self::Whitening | Self::InnovationEstimation | Self::Pem => 1,
            Self::Knudsen => SMALLEST_PAST_OF_KNUDSEN,
            // n states are seen over n / l samples, and the future window is shifted by one.
            Self::Subid => order.div_ceil(outputs).saturating_add(2),
        }
    }

    /// The method that stands in while orders are compared: the prediction error method runs once, in the end.
    pub(crate) fn for_comparing_orders(self) -> Self {
        match self {
            Self::Pem => Self::PbsidOpt,
            other => other,
        }
    }

    /// Whether the method does `--polish always` itself: its numbers are then those of its own improvement.
    pub(crate) fn polishes_itself(self) -> bool {
        match self {
            // One Gauss-Newton step in the time domain; the other is maximum likelihood as it is.
            Self::Knudsen | Self::Pem => true,
            Self::PbsidOpt | Self::Whitening | Self::InnovationEstimation | Self::Subid => false,
        }
    }

    /// Whether feedback biases the estimate.
    pub fn open_loop_only(self) -> bool {
        match self {
            Self::Knudsen | Self::Subid => true,
            Self::PbsidOpt | Self::Pem | Self::Whitening | Self::InnovationEstimation => false,
        }
    }

    /// Whether the method does this stochastic step itself, with its covariance.
    pub(crate) fn has_own(self, step: Stochastic) -> bool {
        self == Self::Knudsen && matches!(step, Stochastic::FirstColumn | Stochastic::Cholesky)
    }

    /// Whether `Uncertain::covariance` has a formula.
    pub fn has_covariance(self) -> bool {
        match self {
            Self::PbsidOpt
            | Self::Whitening
            | Self::InnovationEstimation
            | Self::Knudsen
            | Self::Pem => true,
            Self::Subid => false,
        }
    }

    /// Whether `Uncertain::propagation` has a formula, which a stochastic step of another method builds on.
    pub(crate) fn has_propagation(self) -> bool {
        match self {
            Self::PbsidOpt | Self::Whitening | Self::InnovationEstimation => true,
            Self::Knudsen | Self::Pem | Self::Subid => false,
        }
    }

    /// Whether `--polish auto` polishes. Who asks for another method by name wants that method's numbers: the
    /// polished model is the same whatever method it started from.
    pub(crate) fn polishes_by_default(self) -> bool {
        self == Self::PbsidOpt
    }

    /// The weight of the singular value decomposition when none is asked for; `automatic` is what the sizes of
    /// the innovations speak for.
    ///
    /// Innovation estimation takes canonical variates: its stacked noise has the covariance `G (I (x) Lambda) G'`
    /// with `G` the impulse response of the noise model, far from the identity even for one output, so the identity
    /// weight costs variance (3 times the Cramer-Rao bound in example 1 of Chiuso & Picci, 22 times in example 2 at
    /// 3 rad; with canonical variates 1.0 and 1.5 times).
    pub(crate) fn default_weight(self, automatic: Weight) -> Weight {
        match self {
            Self::PbsidOpt | Self::Whitening => automatic,
            Self::InnovationEstimation => Weight::Cva,
            // Their one weight is part of them; subid's own is called SV.
            Self::Knudsen | Self::Pem | Self::Subid => Weight::Identity,
        }
    }
}

/// Step that estimates `K` and `Lambda` in the place of the method's own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
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

impl Stochastic {
    /// Every step there is.
    pub fn all() -> &'static [Self] {
        &[Self::Innovations, Self::FirstColumn, Self::Cholesky]
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

    /// Whether `Stochastic::propagation` has a formula.
    pub fn has_covariance(self) -> bool {
        match self {
            Self::Innovations => true,
            Self::FirstColumn | Self::Cholesky => false,
        }
    }

    /// Lags that the moments must hold for these windows; `future` is `None` when it is chosen later, and is at
    /// most `past` then.
    pub(crate) fn lags(self, past: usize, future: Option<usize>) -> usize {
        match self {
            Self::Innovations => past,
            Self::FirstColumn | Self::Cholesky => past.saturating_add(future.unwrap_or(past)),
        }
    }
}
