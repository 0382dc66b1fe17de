//! Whitening filter and innovation estimation as [`Method`](super::Method)s.

use std::sync::Arc;

use nalgebra::DMatrix;

use super::{Decomposed, Estimated, Orders, Uncertain, Windows};
use crate::identify::IdentifyError;
use crate::identify::data::Source;
use crate::identify::subspace::{
    Estimate, Nested, NestedDecomposition, Prediction, decompose_nested, nested_system_matrices,
};
use crate::identify::variance::{NestedErrors, Propagation, newest_first};
use crate::linalg::qr_r;
use crate::model::StateSpace;
use crate::moments::RFactor;

/// A direction of the past that is this much smaller than the largest is rounding.
const UNEXCITED: f64 = 1e-12;

#[derive(Debug)]
struct ClosedLoop {
    windows: Windows,
    factor: Arc<RFactor>,
    nested: Arc<Nested>,
    decomposition: NestedDecomposition,
}

/// The nested regressions and the weighted decomposition of their predictions.
///
/// # Errors
/// [`IdentifyError::TooShortForWindows`], or a decomposition that does not converge.
pub(super) fn decomposed(
    prediction: Prediction,
    windows: &Windows,
    source: &mut Source<'_>,
) -> Result<Decomposed, IdentifyError> {
    let past = windows.factor.past;
    let factor = source.factor(past + windows.future)?;
    let nested = Nested::new(&factor, past, windows.varx.feedthrough)?;
    let decomposition = decompose_nested(&nested, prediction, windows.weight)?;
    let svd = &decomposition.svd;
    Ok(Decomposed::new(
        svd.singular_values.clone(),
        svd.largest_order(),
        ClosedLoop {
            decomposition,
            nested: Arc::new(nested),
            factor,
            windows: windows.clone(),
        },
    ))
}

impl Orders for ClosedLoop {
    fn estimate(&self, order: usize, _: &mut Source<'_>) -> Result<Estimated, IdentifyError> {
        let estimate = nested_system_matrices(
            &self.nested,
            &self.decomposition,
            self.decomposition.svd.state_map(order),
            self.windows.sample_time,
        )?;
        Ok(Estimated {
            system: estimate.system.clone(),
            innovation_covariance: self.nested.varx.innovation_covariance.clone(),
            window: self.factor.past,
            converged: true,
            uncertain: Arc::new(OfOrder {
                prediction: self.decomposition.prediction(),
                windows: self.windows.clone(),
                factor: Arc::clone(&self.factor),
                nested: Arc::clone(&self.nested),
                estimate,
            }),
        })
    }
}

#[derive(Debug)]
struct OfOrder {
    prediction: Prediction,
    windows: Windows,
    factor: Arc<RFactor>,
    nested: Arc<Nested>,
    estimate: Estimate,
}

impl Uncertain for OfOrder {
    fn propagation(&self) -> Result<Option<Propagation>, IdentifyError> {
        let factor = &self.factor;
        let (q, columns) = (factor.channels(), factor.columns as f64);
        let direct = if self.windows.varx.feedthrough {
            factor.inputs
        } else {
            0
        };
        let order = newest_first(factor.past, q, direct);
        let reversed = DMatrix::from_fn(order.len(), order.len(), |i, j| factor.r[(i, order[j])]);
        let mut window_factor = qr_r(&reversed) / columns.sqrt();
        // What never occurs in the record has no error to first order; it must not divide by zero.
        let floor = UNEXCITED * window_factor.diagonal().amax();
        for i in 0..window_factor.nrows() {
            window_factor[(i, i)] = window_factor[(i, i)].max(floor);
        }
        let errors = NestedErrors {
            prediction: self.prediction,
            system: &self.estimate.system,
            innovation_covariance: &self.nested.varx.innovation_covariance,
            state_map: &self.estimate.state_map,
            state_regression: &self.estimate.state_regression,
            output_regression: &self.estimate.output_regression,
            window_factor: &window_factor,
            columns,
            past: self.windows.factor.past,
            feedthrough: self.windows.varx.feedthrough,
        };
        Ok(Some(errors.propagation()?))
    }

    /// The map to the state stays that of all data.
    fn replicate(&self, factor: &RFactor) -> Result<StateSpace, IdentifyError> {
        let windows = &self.windows;
        let nested = Nested::new(factor, windows.factor.past, windows.varx.feedthrough)?;
        let decomposition = decompose_nested(&nested, self.prediction, windows.weight)?;
        let map = self.estimate.state_map.clone();
        let estimate = nested_system_matrices(&nested, &decomposition, map, windows.sample_time)?;
        Ok(estimate.system)
    }
}
