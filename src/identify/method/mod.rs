//! Methods: from the data of one past and one future window to a model of a given order.
//!
//! A method is one variant of [`Method`] and one module that makes what all orders share ([`Decomposed`]) and what one
//! order gives ([`Estimated`]). Everything else (windows, order, the chi-square
//! referee, the polish, stability, the jackknife, units, documents) is the same for all of them.
//!
//! | file | method | source |
//! |---|---|---|
//! | `pbsid_opt` | [`Method::PbsidOpt`] | van Wingerden |
//! | `knudsen` | [`Method::Knudsen`] | Knudsen |
//! | `pem` | [`Method::Pem`] | Ljung |
//! | `subid` | [`Method::Subid`] | van Overschee & De Moor |
//! | `closed_loop` | [`Method::Whitening`], [`Method::InnovationEstimation`] | Chiuso & Picci |

mod closed_loop;
mod knudsen;
mod pbsid_opt;
mod pem;
mod subid;

use std::fmt::Debug;
use std::sync::Arc;

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::error::IdentifyError;
use super::horizon;
use super::nested::Prediction;
use super::pbsid_opt::Weight;
use super::source::Source;
use super::stochastic::Stochastic;
use super::variance::Propagation;
use super::varx::Varx;
use crate::covariance::ParameterCovariance;
use crate::model::StateSpace;
use crate::moments::RFactor;

/// Algorithm that estimates the system matrices.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    Default,
    Serialize,
    Deserialize,
    schemars::JsonSchema,
    clap::ValueEnum,
)]
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
        clap::ValueEnum::value_variants()
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
    pub fn lags(self, past: usize, future: Option<usize>) -> usize {
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
    pub fn future(self, past: usize, outputs: usize, order: usize) -> usize {
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
    pub fn smallest_past(self, outputs: usize, order: usize) -> usize {
        match self {
            Self::PbsidOpt | Self::Whitening | Self::InnovationEstimation | Self::Pem => 1,
            Self::Knudsen => knudsen::SMALLEST_PAST,
            // n states are seen over n / l samples, and the future window is shifted by one.
            Self::Subid => order.div_ceil(outputs).saturating_add(2),
        }
    }

    /// The method that stands in while orders are compared: the prediction error method runs once, in the end.
    pub fn for_comparing_orders(self) -> Self {
        match self {
            Self::Pem => Self::PbsidOpt,
            other => other,
        }
    }

    /// Whether the method does `--polish always` itself: its numbers are then those of its own improvement.
    pub fn polishes_itself(self) -> bool {
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
    pub fn has_own(self, step: Stochastic) -> bool {
        self == Self::Knudsen && matches!(step, Stochastic::FirstColumn | Stochastic::Cholesky)
    }

    /// Whether [`Uncertain::covariance`] has a formula.
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

    /// Whether [`Uncertain::propagation`] has a formula, which a stochastic step of another method builds on.
    pub fn has_propagation(self) -> bool {
        match self {
            Self::PbsidOpt | Self::Whitening | Self::InnovationEstimation => true,
            Self::Knudsen | Self::Pem | Self::Subid => false,
        }
    }

    /// Whether `--polish auto` polishes. Who asks for another method by name wants that method's numbers: the
    /// polished model is the same whatever method it started from.
    pub fn polishes_by_default(self) -> bool {
        self == Self::PbsidOpt
    }

    /// The weight of the singular value decomposition when none is asked for; `automatic` is what the sizes of
    /// the innovations speak for.
    ///
    /// Innovation estimation takes canonical variates: its stacked noise has the covariance `G (I (x) Lambda) G'`
    /// with `G` the impulse response of the noise model, far from the identity even for one output, so the identity
    /// weight costs variance (3 times the Cramer-Rao bound in example 1 of Chiuso & Picci, 22 times in example 2 at
    /// 3 rad; with canonical variates 1.0 and 1.5 times).
    pub fn default_weight(self, automatic: Weight) -> Weight {
        match self {
            Self::PbsidOpt | Self::Whitening => automatic,
            Self::InnovationEstimation => Weight::Cva,
            // Their one weight is part of them; subid's own is called SV.
            Self::Knudsen | Self::Pem | Self::Subid => Weight::Identity,
        }
    }

    /// The step that all orders share.
    ///
    /// # Errors
    /// [`IdentifyError`] when the windows do not fit the data, or a factorisation fails.
    pub fn decompose(
        self,
        windows: &Windows,
        source: &mut Source<'_>,
    ) -> Result<Decomposed, IdentifyError> {
        match self {
            Self::PbsidOpt => pbsid_opt::decomposed(windows),
            Self::Whitening => closed_loop::decomposed(Prediction::Whitening, windows, source),
            Self::InnovationEstimation => {
                closed_loop::decomposed(Prediction::InnovationEstimation, windows, source)
            }
            Self::Knudsen => knudsen::decomposed(windows, source),
            Self::Pem => pem::decomposed(windows, source),
            Self::Subid => subid::decomposed(windows, source),
        }
    }
}

/// The data of one past window, and the future window and weight to be used.
#[derive(Debug, Clone)]
pub struct Windows {
    /// Data factor of the past window, over all windows of the recordings.
    pub factor: Arc<RFactor>,
    /// Vector ARX estimate of the past window.
    pub varx: Arc<Varx>,
    /// Future window `f`.
    pub future: usize,
    /// Weight of the singular value decomposition.
    pub weight: Weight,
    /// The stochastic step that was asked for, for a method that does it itself ([`Method::has_own`]).
    pub stochastic: Option<Stochastic>,
    /// Whether orders are still being compared: what only the final model needs can wait.
    pub comparing: bool,
    /// Whether a method that polishes its estimate itself ([`Method::polishes_itself`]) is to do so.
    pub polish_by_method: bool,
    /// Sample time in seconds.
    pub sample_time: f64,
}

/// What all orders of one past and one future window share.
#[derive(Debug, Clone)]
pub struct Decomposed {
    /// Singular values of the weighted product, decreasing.
    pub singular_values: Vec<f64>,
    /// Largest order that the decomposition can give.
    pub largest_order: usize,
    orders: Arc<dyn Orders>,
}

impl Decomposed {
    /// What the decomposition shows, and how one order is estimated from it.
    pub fn new(
        singular_values: Vec<f64>,
        largest_order: usize,
        orders: impl Orders + 'static,
    ) -> Self {
        Self {
            singular_values,
            largest_order,
            orders: Arc::new(orders),
        }
    }

    /// The model of one order, in scaled units.
    ///
    /// # Errors
    /// [`IdentifyError::SingularRegression`] for an order that the data do not support.
    pub fn estimate(
        &self,
        order: usize,
        source: &mut Source<'_>,
    ) -> Result<Estimated, IdentifyError> {
        self.orders.estimate(order, source)
    }
}

/// How a method estimates one order.
pub trait Orders: Debug + Send + Sync {
    /// See [`Decomposed::estimate`].
    ///
    /// # Errors
    /// [`IdentifyError::SingularRegression`] for an order that the data do not support.
    fn estimate(&self, order: usize, source: &mut Source<'_>) -> Result<Estimated, IdentifyError>;
}

/// A model of one order, in scaled units (every channel divided by [`RFactor::scale`]).
#[derive(Debug, Clone)]
pub struct Estimated {
    /// System matrices.
    pub system: StateSpace,
    /// Covariance of the innovations.
    pub innovation_covariance: DMatrix<f64>,
    /// Past window of the data factor that [`Uncertain::replicate`] takes.
    pub window: usize,
    /// Whether the estimate is what the method aims at; a search may run out of steps.
    pub converged: bool,
    /// Where its covariance comes from.
    pub uncertain: Arc<dyn Uncertain>,
}

/// Where the covariance of an estimate comes from. Nothing is computed before it is asked for.
pub trait Uncertain: Debug + Send + Sync {
    /// How the errors of the parameters follow from unit white noise, to first order, together with the errors of
    /// the vector ARX coefficients; `None` when that is not known. It gives covariances to models whose
    /// stochastic part comes from another step.
    ///
    /// # Errors
    /// [`IdentifyError::Linalg`] when a factorisation fails.
    fn propagation(&self) -> Result<Option<Propagation>, IdentifyError> {
        Ok(None)
    }

    /// Covariance of the parameters, in the basis of [`Estimated::system`]; `None` when there is no formula: the
    /// jackknife takes its place then.
    ///
    /// # Errors
    /// [`IdentifyError::Linalg`] when a factorisation fails.
    fn covariance(&self) -> Result<Option<ParameterCovariance>, IdentifyError> {
        let errors = self.propagation()?;
        Ok(errors.map(|e| ParameterCovariance::of_root(e.layout, &e.parameters)))
    }

    /// The model of other data (a factor of window [`Estimated::window`]) in the same state basis, for the
    /// jackknife.
    ///
    /// # Errors
    /// [`IdentifyError`] when those data do not allow it.
    fn replicate(&self, factor: &RFactor) -> Result<StateSpace, IdentifyError>;
}
