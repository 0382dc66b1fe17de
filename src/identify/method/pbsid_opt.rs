//! PBSID_opt as a [`Method`](super::Method).

use std::sync::Arc;

use nalgebra::DMatrix;

use super::{Decomposed, Estimated, Propagation, Windows};
use crate::covariance::{ParameterCovariance, subspace_covariance, subspace_propagation};
use crate::identify::error::IdentifyError;
use crate::identify::pbsid_opt::{Decomposition, Estimate, decompose, system_matrices};
use crate::identify::source::Source;
use crate::identify::varx::varx;
use crate::model::StateSpace;
use crate::moments::RFactor;

#[derive(Debug)]
struct PbsidOpt {
    windows: Windows,
    decomposition: Decomposition,
}

/// The weighted decomposition of `Gamma K Z`.
///
/// # Errors
/// [`IdentifyError::Linalg`] when it does not converge.
pub(super) fn decomposed(windows: &Windows) -> Result<Arc<dyn Decomposed>, IdentifyError> {
    let Windows {
        factor,
        varx,
        future,
        weight,
        ..
    } = windows;
    Ok(Arc::new(PbsidOpt {
        decomposition: decompose(factor, varx, *future, *weight)?,
        windows: windows.clone(),
    }))
}

impl Decomposed for PbsidOpt {
    fn singular_values(&self) -> &[f64] {
        &self.decomposition.singular_values
    }

    fn largest_order(&self) -> usize {
        self.decomposition.largest_order()
    }

    fn estimate(
        &self,
        order: usize,
        _source: &mut Source<'_>,
    ) -> Result<Arc<dyn Estimated>, IdentifyError> {
        let windows = self.windows.clone();
        let estimate = system_matrices(
            &windows.factor,
            &windows.varx,
            &self.decomposition,
            self.decomposition.state_map(order),
            windows.sample_time,
        )?;
        Ok(Arc::new(OfOrder { windows, estimate }))
    }
}

#[derive(Debug)]
struct OfOrder {
    windows: Windows,
    estimate: Estimate,
}

impl Estimated for OfOrder {
    fn system(&self) -> &StateSpace {
        &self.estimate.system
    }

    fn innovation_covariance(&self) -> &DMatrix<f64> {
        &self.windows.varx.innovation_covariance
    }

    fn covariance(&self) -> Result<Option<ParameterCovariance>, IdentifyError> {
        Ok(Some(subspace_covariance(
            &self.estimate,
            &self.windows.varx,
        )?))
    }

    fn propagation(&self) -> Result<Option<Propagation>, IdentifyError> {
        Ok(Some(subspace_propagation(
            &self.estimate,
            &self.windows.varx,
        )?))
    }

    fn window(&self) -> usize {
        self.windows.factor.past
    }

    /// The map to the state stays that of all data.
    fn replicate(&self, factor: &RFactor) -> Result<StateSpace, IdentifyError> {
        let windows = &self.windows;
        let varx = varx(factor, windows.varx.feedthrough)?;
        let decomposition = decompose(factor, &varx, windows.future, windows.weight)?;
        let map = self.estimate.state_map.clone();
        let estimate = system_matrices(factor, &varx, &decomposition, map, windows.sample_time)?;
        Ok(estimate.system)
    }
}
