//! The robust combined subspace algorithm as a [`Method`](super::Method).

use std::sync::Arc;

use super::knudsen_method::{in_basis_of, regression};
use super::{Decomposed, Estimated, Orders, Uncertain, Windows};
use crate::identify::IdentifyError;
use crate::identify::baselines::{BaselineEstimate, ProjectionWeight, subid};
use crate::identify::data::Source;
use crate::identify::knudsen::Regression;
use crate::identify::subspace::Weight;
use crate::model::StateSpace;
use crate::moments::RFactor;

#[derive(Debug)]
struct Subid {
    windows: Windows,
    regression: Regression,
    weight: ProjectionWeight,
}

/// The regression of a future as long as the past.
///
/// # Errors
/// [`IdentifyError`] when the recordings are too short for the windows.
pub(super) fn decomposed(
    windows: &Windows,
    source: &mut Source<'_>,
) -> Result<Decomposed, IdentifyError> {
    let regression = regression(windows, source)?;
    let weight = match windows.weight {
        Weight::Identity => ProjectionWeight::Moesp,
        Weight::Cva => ProjectionWeight::Cva,
    };
    let of = Subid {
        windows: windows.clone(),
        regression,
        weight,
    };
    let largest = (of.regression.future - 1) * of.regression.outputs;
    Ok(Decomposed::new(
        of.made(&of.regression, 1)?.singular_values,
        largest,
        Arc::new(of),
    ))
}

impl Subid {
    fn made(
        &self,
        regression: &Regression,
        order: usize,
    ) -> Result<BaselineEstimate, IdentifyError> {
        let feedthrough = self.windows.varx.feedthrough;
        let time = self.windows.sample_time;
        subid(regression, order, self.weight, feedthrough, time)
    }
}

impl Orders for Arc<Subid> {
    fn estimate(&self, order: usize, _: &mut Source<'_>) -> Result<Estimated, IdentifyError> {
        let made = self.made(&self.regression, order)?;
        Ok(Estimated {
            system: made.system.clone(),
            innovation_covariance: made.innovation_covariance,
            window: self.regression.past + self.regression.future - 1,
            converged: true,
            uncertain: Arc::new(OfOrder {
                method: Arc::clone(self),
                system: made.system,
            }),
        })
    }
}

#[derive(Debug)]
struct OfOrder {
    method: Arc<Subid>,
    system: StateSpace,
}

impl Uncertain for OfOrder {
    fn replicate(&self, factor: &RFactor) -> Result<StateSpace, IdentifyError> {
        let of_all = &self.method.regression;
        let regression = Regression::new(factor, of_all.past)?;
        let made = self.method.made(&regression, self.system.states())?;
        in_basis_of(&made.system, &self.system, of_all.future)
    }
}
