//! Methods: from the data of one past and one future window to a model of a given order.
//!
//! A method is one variant of [`Method`] and one module that makes what all orders share ([`Decomposed`]) and what one
//! order gives ([`Estimated`]). Everything else (windows, order, the chi-square
//! referee, the polish, stability, the jackknife, units, documents) is the same for all of them.
//!
//! | file | method | source |
//! |---|---|---|
//! | `pbsid_opt_method` | [`Method::PbsidOpt`] | van Wingerden |
//! | `knudsen_method` | [`Method::Knudsen`] | Knudsen |
//! | `pem_method` | [`Method::Pem`] | Ljung |
//! | `subid_method` | [`Method::Subid`] | van Overschee & De Moor |
//! | `closed_loop_method` | [`Method::Whitening`], [`Method::InnovationEstimation`] | Chiuso & Picci |

mod closed_loop_method;
mod knudsen_method;
mod pbsid_opt_method;
mod pem_method;
mod subid_method;

use std::fmt::Debug;
use std::sync::Arc;

use nalgebra::DMatrix;

pub(crate) use super::algorithms::Method;
use super::algorithms::Stochastic;
use super::data::Source;
use super::identify_error::IdentifyError;
use super::subspace::{Prediction, Varx, Weight};
use super::variance::Propagation;
use crate::covariance::ParameterCovariance;
use crate::model::StateSpace;
use crate::moments::RFactor;

impl Method {
    /// The step that all orders share.
    ///
    /// # Errors
    /// [`IdentifyError`] when the windows do not fit the data, or a factorisation fails.
    pub(crate) fn decompose(
        self,
        windows: &Windows,
        source: &mut Source<'_>,
    ) -> Result<Decomposed, IdentifyError> {
        match self {
            Self::PbsidOpt => pbsid_opt_method::decomposed(windows),
            Self::Whitening => {
                closed_loop_method::decomposed(Prediction::Whitening, windows, source)
            }
            Self::InnovationEstimation => {
                closed_loop_method::decomposed(Prediction::InnovationEstimation, windows, source)
            }
            Self::Knudsen => knudsen_method::decomposed(windows, source),
            Self::Pem => pem_method::decomposed(windows, source),
            Self::Subid => subid_method::decomposed(windows, source),
        }
    }
}

/// The data of one past window, and the future window and weight to be used.
#[derive(Debug, Clone)]
pub(crate) struct Windows {
    /// Data factor of the past window, over all windows of the recordings.
    pub(crate) factor: Arc<RFactor>,
    /// Vector ARX estimate of the past window.
    pub(crate) varx: Arc<Varx>,
    /// Future window `f`.
    pub(crate) future: usize,
    /// Weight of the singular value decomposition.
    pub(crate) weight: Weight,
    /// The stochastic step that was asked for, for a method that does it itself ([`Method::has_own`]).
    pub(crate) stochastic: Option<Stochastic>,
    /// Whether orders are still being compared: what only the final model needs can wait.
    pub(crate) comparing: bool,
    /// Whether a method that polishes its estimate itself ([`Method::polishes_itself`]) is to do so.
    pub(crate) polish_by_method: bool,
    /// Sample time in seconds.
    pub(crate) sample_time: f64,
}

/// What all orders of one past and one future window share.
#[derive(Debug, Clone)]
pub(crate) struct Decomposed {
    /// Singular values of the weighted product, decreasing.
    pub(crate) singular_values: Vec<f64>,
    /// Largest order that the decomposition can give.
    pub(crate) largest_order: usize,
    orders: Arc<dyn Orders>,
}

impl Decomposed {
    /// What the decomposition shows, and how one order is estimated from it.
    pub(crate) fn new(
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
    pub(crate) fn estimate(
        &self,
        order: usize,
        source: &mut Source<'_>,
    ) -> Result<Estimated, IdentifyError> {
        self.orders.estimate(order, source)
    }
}

/// How a method estimates one order.
pub(crate) trait Orders: Debug + Send + Sync {
    /// See [`Decomposed::estimate`].
    ///
    /// # Errors
    /// [`IdentifyError::SingularRegression`] for an order that the data do not support.
    fn estimate(&self, order: usize, source: &mut Source<'_>) -> Result<Estimated, IdentifyError>;
}

/// A model of one order, in scaled units (every channel divided by [`RFactor::scale`]).
#[derive(Debug, Clone)]
pub(crate) struct Estimated {
    /// System matrices.
    pub(crate) system: StateSpace,
    /// Covariance of the innovations.
    pub(crate) innovation_covariance: DMatrix<f64>,
    /// Past window of the data factor that [`Uncertain::replicate`] takes.
    pub(crate) window: usize,
    /// Whether the estimate is what the method aims at; a search may run out of steps.
    pub(crate) converged: bool,
    /// Where its covariance comes from.
    pub(crate) uncertain: Arc<dyn Uncertain>,
}

/// Where the covariance of an estimate comes from. Nothing is computed before it is asked for.
pub(crate) trait Uncertain: Debug + Send + Sync {
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
