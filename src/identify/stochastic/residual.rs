//! Knudsen's stochastic steps for the deterministic part of any method.

use super::StochasticPart;
use crate::identify::IdentifyError;
use crate::identify::knudsen::{
    Observability, Regression, ResidualStep, minimum_phase, stochastic,
};
use crate::identify::method::Windows;
use crate::model::StateSpace;
use crate::moments::RFactor;

/// The regression on the past of the windows gives the residual covariance, the given `A` and `C` the observability
/// matrix that it is read with.
pub(super) fn estimate(
    deterministic: &StateSpace,
    windows: &Windows,
    factor: &RFactor,
    step: ResidualStep,
) -> Result<StochasticPart, IdentifyError> {
    let (a, c) = (&deterministic.a, &deterministic.c);
    let regression = Regression::new(factor, windows.factor.past)?;
    let observability = Observability::of(a, c, regression.future)?;
    let raw = stochastic(&regression, &observability, a, c, step)?;
    let (noise, _) = minimum_phase(a, c, raw);
    Ok(StochasticPart {
        gain: noise.k,
        innovation_covariance: noise.innovation_covariance,
    })
}
