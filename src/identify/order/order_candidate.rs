//! One order, estimated, polished and tested.

use nalgebra::DMatrix;
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

use crate::identify::data::Source;
use crate::identify::method::{Decomposed, Estimated, Windows};
use crate::identify::polish::{Effort, Polished, polish, reduced};
use crate::identify::stable::with_stable_predictor;
use crate::identify::subspace::{LARGEST_FOR_POLISH, state_covariance, truncation};
use crate::identify::{IdentifyError, Options, Polish};
use crate::model::StateSpace;

/// The polish is also used when it gains this many times more (in chi-square) than the truncation can distort:
/// then the estimate that it starts from is the poorer one by far.
const GAIN_OVER_TRUNCATION: f64 = 10.0;

/// A model of one order with what was learnt about it.
#[derive(Debug, Clone)]
pub(crate) struct Candidate {
    /// Order.
    pub(crate) order: usize,
    /// The estimate of the method.
    pub(crate) estimate: Estimated,
    /// Maximum likelihood, when it was tried. An iteration that did not converge has still gone downhill: its
    /// cost is an upper bound of the smallest.
    pub(crate) polished: Option<Polished>,
    /// The best estimate there is, with a stable predictor.
    pub(crate) predictor: StateSpace,
    /// Covariance of its state.
    pub(crate) state_covariance: DMatrix<f64>,
    /// Its truncation measure for the past window.
    pub(crate) truncation: f64,
}

/// Everything that candidates of one past window share.
#[derive(Debug, Clone)]
pub(super) struct Window {
    /// Data, with the weight; the future window depends on the order.
    pub(super) windows: Windows,
    /// Whether candidates are polished.
    pub(super) polish: bool,
    /// And how far.
    pub(super) effort: Effort,
}

impl Window {
    /// Estimates one order.
    ///
    /// # Errors
    /// [`IdentifyError::SingularRegression`] for an order that the data do not support.
    pub(crate) fn candidate(
        &self,
        decomposition: &Decomposed,
        order: usize,
        source: &mut Source<'_>,
    ) -> Result<Candidate, IdentifyError> {
        let estimate = decomposition.estimate(order, source)?;
        let polished = if self.polish {
            polish(&estimate.system, &self.windows.varx, None, self.effort).ok()
        } else {
            None
        };
        Ok(self.made(order, estimate, polished))
    }

    /// `candidate` polished from another start, that of a larger model without the states that matter least, where that
    /// ends lower.
    pub(super) fn reconsidered(
        &self,
        candidate: &Candidate,
        larger: &StateSpace,
    ) -> Option<Candidate> {
        let varx = &self.windows.varx;
        let start = reduced(larger, varx, candidate.order)?;
        let mut found = polish(&start, varx, None, self.effort).ok()?;
        if let Some(before) = &candidate.polished {
            if found.cost > before.cost {
                return None;
            }
            // What the polish gains, it gains over the estimate of the method.
            found.start_cost = before.start_cost;
        }
        Some(self.made(candidate.order, candidate.estimate.clone(), Some(found)))
    }

    /// A candidate with which a referee was content, polished to the minimum: where a referee stops depends on rounding.
    pub(crate) fn finished(&self, candidate: Candidate) -> Candidate {
        let Some(content) = &candidate.polished else {
            return candidate;
        };
        match polish(&content.system, &self.windows.varx, None, Effort::Full) {
            Ok(end) => {
                let polished = Polished {
                    start_cost: content.start_cost,
                    iterations: content.iterations + end.iterations,
                    ..end
                };
                self.made(candidate.order, candidate.estimate, Some(polished))
            }
            Err(_) => candidate,
        }
    }

    fn made(&self, order: usize, estimate: Estimated, polished: Option<Polished>) -> Candidate {
        let varx = &self.windows.varx;
        let innovation_covariance = &varx.innovation_covariance;
        let best = polished.as_ref().map_or(&estimate.system, |p| &p.system);
        let predictor =
            with_stable_predictor(best, innovation_covariance).unwrap_or_else(|| best.clone());
        let state_covariance = state_covariance(&predictor, varx);
        let truncation = truncation(
            &predictor,
            &state_covariance,
            innovation_covariance,
            varx.past,
            varx.columns,
        )
        .unwrap_or(f64::INFINITY);
        Candidate {
            order,
            estimate,
            polished,
            predictor,
            state_covariance,
            truncation,
        }
    }
}

/// Whether the final numbers are those of the polish.
pub(crate) fn polish_is_used(options: &Options, candidate: &Candidate) -> bool {
    match options.polish {
        Polish::Never => false,
        Polish::Always => true,
        Polish::Auto => {
            options.polishes_by_default()
                && candidate.polished.as_ref().is_some_and(|p| {
                    candidate.truncation <= LARGEST_FOR_POLISH
                        || p.start_cost - p.cost > GAIN_OVER_TRUNCATION * candidate.truncation
                })
        }
    }
}

/// Probability of a cost of at least this size when order and window are right.
///
/// The cost is chi-square when the innovation covariance is known. It is estimated with
/// `residual_degrees_of_freedom` of its own for each output, which the F distribution takes into account.
pub(crate) fn cost_p_value(
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
