//! The robust combined subspace algorithm as a [`Method`](super::Method).

use std::sync::Arc;

use nalgebra::DMatrix;

use super::knudsen::in_basis_of;
use super::{Decomposed, Estimated, Windows};
use crate::covariance::ParameterCovariance;
use crate::identify::baselines::{BaselineEstimate, ProjectionWeight, subid};
use crate::identify::error::IdentifyError;
use crate::identify::knudsen::Regression;
use crate::identify::pbsid_opt::Weight;
use crate::identify::source::Source;
use crate::model::StateSpace;
use crate::moments::RFactor;

#[derive(Debug)]
struct Subid {
    windows: Windows,
    regression: Regression,
    weight: ProjectionWeight,
    singular_values: Vec<f64>,
}

/// The regression of a future as long as the past.
///
/// # Errors
/// [`IdentifyError`] when the recordings are too short for the windows.
pub(super) fn decomposed(
    windows: &Windows,
    source: &mut Source<'_>,
) -> Result<Arc<dyn Decomposed>, IdentifyError> {
    let past = windows.factor.past;
    let regression = Regression::new(&*source.factor(past + windows.future - 1)?, past)?;
    let weight = match windows.weight {
        Weight::Identity => ProjectionWeight::Moesp,
        Weight::Cva => ProjectionWeight::Cva,
    };
    let feedthrough = windows.varx.feedthrough;
    let singular_values =
        subid(&regression, 1, weight, feedthrough, windows.sample_time)?.singular_values;
    Ok(Arc::new(Subid {
        windows: windows.clone(),
        regression,
        weight,
        singular_values,
    }))
}

impl Decomposed for Subid {
    fn singular_values(&self) -> &[f64] {
        &self.singular_values
    }

    fn largest_order(&self) -> usize {
        (self.regression.future - 1) * self.regression.outputs
    }

    fn estimate(
        &self,
        order: usize,
        _source: &mut Source<'_>,
    ) -> Result<Arc<dyn Estimated>, IdentifyError> {
        let windows = self.windows.clone();
        let feedthrough = windows.varx.feedthrough;
        let time = windows.sample_time;
        Ok(Arc::new(OfOrder {
            estimate: subid(&self.regression, order, self.weight, feedthrough, time)?,
            past: self.regression.past,
            future: self.regression.future,
            weight: self.weight,
            windows,
        }))
    }
}

#[derive(Debug)]
struct OfOrder {
    windows: Windows,
    estimate: BaselineEstimate,
    past: usize,
    future: usize,
    weight: ProjectionWeight,
}

impl Estimated for OfOrder {
    fn system(&self) -> &StateSpace {
        &self.estimate.system
    }

    fn innovation_covariance(&self) -> &DMatrix<f64> {
        &self.estimate.innovation_covariance
    }

    fn covariance(&self) -> Result<Option<ParameterCovariance>, IdentifyError> {
        Ok(None)
    }

    fn window(&self) -> usize {
        self.past + self.future - 1
    }

    fn replicate(&self, factor: &RFactor) -> Result<StateSpace, IdentifyError> {
        let regression = Regression::new(factor, self.past)?;
        let reference = &self.estimate.system;
        let made = subid(
            &regression,
            reference.states(),
            self.weight,
            self.windows.varx.feedthrough,
            reference.sample_time,
        )?;
        in_basis_of(&made.system, reference, self.future)
    }
}
