//! The prediction error method as a [`Method`](super::Method).

use std::sync::Arc;

use super::knudsen_method::{experiments, slices};
use super::{Decomposed, Estimated, Method, Orders, Uncertain, Windows};
use crate::covariance::ParameterCovariance;
use crate::identify::IdentifyError;
use crate::identify::data::Source;
use crate::identify::pem::{Form, PredictionErrorEstimate, STEPS, prediction_error_method};
use crate::identify::polish::{Effort, polish};
use crate::identify::subspace::varx;
use crate::model::StateSpace;
use crate::moments::RFactor;

/// Where the search may start from. Its first step is enough to tell which of them leads lower.
#[derive(Debug)]
struct Pem {
    windows: Windows,
    /// tk-chol, and PBSID_opt, which closed loops do not mislead.
    starts: Vec<Decomposed>,
}

/// The decompositions of the methods that the search starts from.
///
/// # Errors
/// [`IdentifyError`] when neither can be had.
pub(super) fn decomposed(
    windows: &Windows,
    source: &mut Source<'_>,
) -> Result<Decomposed, IdentifyError> {
    let plain = Windows {
        stochastic: None,
        polish_by_method: false,
        ..windows.clone()
    };
    let mut starts = vec![Method::PbsidOpt.decompose(&plain, source)?];
    // A recording that is too short for the longer window of tk-chol has the other start.
    if let Ok(chol) = Method::Knudsen.decompose(&plain, source) {
        starts.insert(0, chol);
    }
    Ok(Decomposed::new(
        starts[0].singular_values.clone(),
        starts.iter().map(|s| s.largest_order).max().unwrap_or(0),
        Pem {
            windows: windows.clone(),
            starts,
        },
    ))
}

impl Orders for Pem {
    fn estimate(&self, order: usize, source: &mut Source<'_>) -> Result<Estimated, IdentifyError> {
        let experiments = experiments(source)?;
        let signals = slices(&experiments);
        let feedthrough = self.windows.varx.feedthrough;
        let search = |start: &StateSpace, steps: usize| {
            prediction_error_method(start, &signals, feedthrough, Form::Innovation, steps)
        };
        let mut best: Option<PredictionErrorEstimate> = None;
        let mut last_error = None;
        for start in &self.starts {
            let tried = start
                .estimate(order, source)
                .and_then(|estimate| search(&estimate.system, 1));
            match tried {
                Ok(made) if best.as_ref().is_none_or(|b| made.cost < b.cost) => best = Some(made),
                Ok(_) => {}
                Err(error) => last_error = Some(error),
            }
        }
        let Some(best) = best else {
            return Err(last_error.unwrap_or(IdentifyError::SingularRegression {
                what: "states and inputs",
            }));
        };
        let estimate = if best.converged {
            best
        } else {
            search(&best.system, STEPS)?
        };
        Ok(Estimated {
            system: estimate.system.clone(),
            innovation_covariance: estimate.innovation_covariance.clone(),
            window: self.windows.factor.past,
            converged: estimate.converged,
            uncertain: Arc::new(OfOrder {
                feedthrough,
                estimate,
            }),
        })
    }
}

#[derive(Debug)]
struct OfOrder {
    feedthrough: bool,
    estimate: PredictionErrorEstimate,
}

impl Uncertain for OfOrder {
    fn covariance(&self) -> Result<Option<ParameterCovariance>, IdentifyError> {
        Ok(Some(self.estimate.covariance.clone()))
    }

    /// The maximum-likelihood model of the vector ARX coefficients, from the model of all data: the same estimate
    /// but for what the past window cuts off.
    fn replicate(&self, factor: &RFactor) -> Result<StateSpace, IdentifyError> {
        let varx = varx(factor, self.feedthrough)?;
        Ok(polish(&self.estimate.system, &varx, None, Effort::Full)?.system)
    }
}
