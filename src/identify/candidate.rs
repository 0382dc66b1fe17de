//! One order, estimated, polished and tested.

use nalgebra::DMatrix;
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

use super::error::IdentifyError;
use super::pbsid_opt::{Decomposition, Estimate, system_matrices};
use super::polish::{Effort, Polished, polish};
use super::stable::with_stable_predictor;
use super::truncation::{state_covariance, truncation};
use super::varx::Varx;
use crate::model::StateSpace;
use crate::moments::RFactor;

/// A model of one order with what was learnt about it.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// Order.
    pub order: usize,
    /// PBSID_opt.
    pub estimate: Estimate,
    /// Maximum likelihood, when it was tried. An iteration that did not converge has still gone downhill: its
    /// cost is an upper bound of the smallest.
    pub polished: Option<Polished>,
    /// The best estimate there is, with a stable predictor.
    pub predictor: StateSpace,
    /// Covariance of its state.
    pub state_covariance: DMatrix<f64>,
    /// Its truncation measure for the past window.
    pub truncation: f64,
}

/// Everything that candidates of one past window share.
#[derive(Debug, Clone, Copy)]
pub struct Window<'a> {
    /// Data.
    pub factor: &'a RFactor,
    /// Vector ARX estimate.
    pub varx: &'a Varx,
    /// Sample time.
    pub sample_time: f64,
    /// Whether candidates are polished.
    pub polish: bool,
    /// And how far.
    pub effort: Effort,
}

impl Window<'_> {
    /// Estimates one order.
    ///
    /// # Errors
    /// [`IdentifyError::SingularRegression`] for an order that the data do not support.
    pub fn candidate(
        &self,
        decomposition: &Decomposition,
        order: usize,
    ) -> Result<Candidate, IdentifyError> {
        let estimate = system_matrices(
            self.factor,
            self.varx,
            decomposition,
            decomposition.state_map(order),
            self.sample_time,
        )?;
        let polished = if self.polish {
            polish(&estimate.system, self.varx, None, self.effort).ok()
        } else {
            None
        };
        let innovation_covariance = &self.varx.innovation_covariance;
        let best = polished.as_ref().map_or(&estimate.system, |p| &p.system);
        let predictor =
            with_stable_predictor(best, innovation_covariance).unwrap_or_else(|| best.clone());
        let state_covariance = state_covariance(&predictor, self.varx);
        let truncation = truncation(
            &predictor,
            &state_covariance,
            innovation_covariance,
            self.varx.past,
            self.varx.columns,
        )
        .unwrap_or(f64::INFINITY);
        Ok(Candidate {
            order,
            estimate,
            polished,
            predictor,
            state_covariance,
            truncation,
        })
    }
}

/// Probability of a cost of at least this size when order and window are right.
///
/// The cost is chi-square when the innovation covariance is known. It is estimated with
/// `residual_degrees_of_freedom` of its own for each output, which the F distribution takes into account.
pub fn cost_p_value(
    cost: f64,
    degrees_of_freedom: usize,
    residual_degrees_of_freedom: usize,
) -> Option<f64> {
    if degrees_of_freedom == 0 || !cost.is_finite() {
        return None;
    }
    let d = degrees_of_freedom as f64;
    if residual_degrees_of_freedom as f64 > 1e4 * d {
        return ChiSquared::new(d).ok().map(|law| law.sf(cost));
    }
    FisherSnedecor::new(d, residual_degrees_of_freedom as f64)
        .ok()
        .map(|law| law.sf(cost / d))
}
