//! One order, estimated, polished and tested.

use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

use super::error::IdentifyError;
use super::pbsid_opt::{Decomposition, Estimate, system_matrices};
use super::polish::{Polished, polish};
use super::stable::with_stable_predictor;
use super::truncation::truncation;
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
    /// Maximum likelihood, when it was tried and the iteration converged.
    pub polished: Option<Polished>,
    /// Truncation measure of the past window.
    pub truncation: f64,
}

/// Everything that candidates of one past window share.
#[derive(Debug)]
pub struct Window<'a> {
    /// Data.
    pub factor: &'a RFactor,
    /// Vector ARX estimate.
    pub varx: &'a Varx,
    /// Sample time.
    pub sample_time: f64,
    /// Whether candidates are polished.
    pub polish: bool,
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
        let innovation_covariance = &self.varx.innovation_covariance;
        let measure = |system: &StateSpace| {
            let stable = with_stable_predictor(system, innovation_covariance);
            truncation(
                stable.as_ref().unwrap_or(system),
                &estimate.state_covariance,
                innovation_covariance,
                self.varx.past,
                self.varx.columns,
            )
            .unwrap_or(f64::INFINITY)
        };
        let mut truncation = measure(&estimate.system);
        let polished = if self.polish {
            polish(&estimate.system, self.varx, None)
                .ok()
                .filter(|p| p.converged)
        } else {
            None
        };
        if let Some(polished) = &polished {
            truncation = truncation.max(measure(&polished.system));
        }
        Ok(Candidate {
            order,
            estimate,
            polished,
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
