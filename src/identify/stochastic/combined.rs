//! The deterministic part of one method with the stochastic step of another.

use std::sync::Arc;

use super::{Stochastic, StochasticPart};
use crate::identify::IdentifyError;
use crate::identify::data::Source;
use crate::identify::method::{Decomposed, Estimated, Orders, Uncertain, Windows};
use crate::identify::variance::Propagation;
use crate::model::StateSpace;
use crate::moments::RFactor;

#[derive(Debug)]
struct Combined {
    step: Stochastic,
    inner: Decomposed,
    windows: Windows,
}

pub(super) fn combined(step: Stochastic, inner: Decomposed, windows: Windows) -> Decomposed {
    Decomposed::new(
        inner.singular_values.clone(),
        inner.largest_order,
        Combined {
            step,
            inner,
            windows,
        },
    )
}

impl Orders for Combined {
    fn estimate(&self, order: usize, source: &mut Source<'_>) -> Result<Estimated, IdentifyError> {
        let inner = self.inner.estimate(order, source)?;
        let window = self.step.window(&self.windows);
        let factor = source.factor(window)?;
        let part = self.step.estimate(&inner.system, &self.windows, &factor)?;
        let system = with_gain(&inner.system, &part);
        Ok(Estimated {
            system: system.clone(),
            innovation_covariance: part.innovation_covariance,
            window: inner.window.max(window),
            converged: inner.converged,
            uncertain: Arc::new(OfOrder {
                system,
                step: self.step,
                inner,
                windows: self.windows.clone(),
            }),
        })
    }
}

#[derive(Debug)]
struct OfOrder {
    step: Stochastic,
    inner: Estimated,
    windows: Windows,
    system: StateSpace,
}

fn with_gain(deterministic: &StateSpace, part: &StochasticPart) -> StateSpace {
    StateSpace {
        k: part.gain.clone(),
        ..deterministic.clone()
    }
}

impl Uncertain for OfOrder {
    fn propagation(&self) -> Result<Option<Propagation>, IdentifyError> {
        match self.inner.uncertain.propagation()? {
            Some(of_method) => self
                .step
                .propagation(&self.system, &self.windows, of_method),
            None => Ok(None),
        }
    }

    fn replicate(&self, factor: &RFactor) -> Result<StateSpace, IdentifyError> {
        let own = factor.leading(self.inner.window);
        let deterministic = self.inner.uncertain.replicate(&own)?;
        let of_step = factor.leading(self.step.window(&self.windows));
        let part = self
            .step
            .estimate(&deterministic, &self.windows, &of_step)?;
        Ok(with_gain(&deterministic, &part))
    }
}
