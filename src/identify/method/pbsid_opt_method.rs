//! PBSID_opt as a [`Method`](super::Method).

use std::sync::Arc;

use super::{Decomposed, Estimated, Orders, Uncertain, Windows};
use crate::covariance::ParameterCovariance;
use crate::identify::IdentifyError;
use crate::identify::data::Source;
use crate::identify::subspace::{Decomposition, Estimate, decompose, system_matrices, varx};
use crate::identify::variance::{Propagation, subspace_covariance, subspace_propagation};
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
pub(super) fn decomposed(windows: &Windows) -> Result<Decomposed, IdentifyError> {
    let Windows {
        factor,
        varx,
        future,
        weight,
        ..
    } = windows;
    let decomposition = decompose(factor, varx, *future, *weight)?;
    let svd = &decomposition.svd;
    Ok(Decomposed::new(
        svd.singular_values.clone(),
        svd.largest_order(),
        PbsidOpt {
            windows: windows.clone(),
            decomposition,
        },
    ))
}

impl Orders for PbsidOpt {
    fn estimate(&self, order: usize, _: &mut Source<'_>) -> Result<Estimated, IdentifyError> {
        let windows = self.windows.clone();
        let estimate = system_matrices(
            &windows.factor,
            &windows.varx,
            &self.decomposition,
            self.decomposition.svd.state_map(order),
            windows.sample_time,
        )?;
        Ok(Estimated {
            system: estimate.system.clone(),
            innovation_covariance: windows.varx.innovation_covariance.clone(),
            window: windows.factor.past,
            converged: true,
            uncertain: Arc::new(OfOrder { windows, estimate }),
        })
    }
}

#[derive(Debug)]
struct OfOrder {
    windows: Windows,
    estimate: Estimate,
}

impl Uncertain for OfOrder {
    fn propagation(&self) -> Result<Option<Propagation>, IdentifyError> {
        let varx = &self.windows.varx;
        Ok(Some(subspace_propagation(&self.estimate, varx)?))
    }

    /// Direction by direction of the noise: the propagation as a whole takes as many times the memory as there are outputs.
    fn covariance(&self) -> Result<Option<ParameterCovariance>, IdentifyError> {
        let varx = &self.windows.varx;
        Ok(Some(subspace_covariance(&self.estimate, varx)?))
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
