//! The deterministic part of one method with the stochastic step of another.

use std::sync::Arc;

use nalgebra::DMatrix;

use super::{Stochastic, StochasticPart};
use crate::covariance::{ParameterCovariance, ParameterLayout};
use crate::identify::error::IdentifyError;
use crate::identify::method::{Decomposed, Estimated, Propagation, Windows};
use crate::identify::source::Source;
use crate::linalg::multiply_nt;
use crate::model::StateSpace;
use crate::moments::RFactor;

#[derive(Debug)]
struct Combined {
    step: Stochastic,
    inner: Arc<dyn Decomposed>,
    windows: Windows,
}

pub(super) fn combined(
    step: Stochastic,
    inner: Arc<dyn Decomposed>,
    windows: Windows,
) -> Arc<dyn Decomposed> {
    Arc::new(Combined {
        step,
        inner,
        windows,
    })
}

impl Decomposed for Combined {
    fn singular_values(&self) -> &[f64] {
        self.inner.singular_values()
    }

    fn largest_order(&self) -> usize {
        self.inner.largest_order()
    }

    fn estimate(
        &self,
        order: usize,
        source: &mut Source<'_>,
    ) -> Result<Arc<dyn Estimated>, IdentifyError> {
        let inner = self.inner.estimate(order, source)?;
        let factor = source.factor(self.step.window(&self.windows))?;
        let part = self.step.estimate(inner.system(), &self.windows, &factor)?;
        Ok(Arc::new(OfOrder {
            system: with_gain(inner.system(), &part),
            innovation_covariance: part.innovation_covariance,
            step: self.step,
            inner,
            windows: self.windows.clone(),
        }))
    }
}

#[derive(Debug)]
struct OfOrder {
    step: Stochastic,
    inner: Arc<dyn Estimated>,
    windows: Windows,
    system: StateSpace,
    innovation_covariance: DMatrix<f64>,
}

fn with_gain(deterministic: &StateSpace, part: &StochasticPart) -> StateSpace {
    StateSpace {
        k: part.gain.clone(),
        ..deterministic.clone()
    }
}

impl Estimated for OfOrder {
    fn system(&self) -> &StateSpace {
        &self.system
    }

    fn innovation_covariance(&self) -> &DMatrix<f64> {
        &self.innovation_covariance
    }

    fn covariance(&self) -> Result<Option<ParameterCovariance>, IdentifyError> {
        let layout = ParameterLayout {
            states: self.system.states(),
            inputs: self.system.inputs(),
            outputs: self.system.outputs(),
            feedthrough: self.windows.varx.feedthrough,
        };
        Ok(self.propagation()?.map(|errors| {
            let matrix = multiply_nt(&errors.parameters, &errors.parameters);
            ParameterCovariance {
                layout,
                matrix: (&matrix + matrix.transpose()) * 0.5,
                degrees_of_freedom: None,
            }
        }))
    }

    fn propagation(&self) -> Result<Option<Propagation>, IdentifyError> {
        match self.inner.propagation()? {
            Some(of_method) => self
                .step
                .propagation(&self.system, &self.windows, of_method),
            None => Ok(None),
        }
    }

    fn window(&self) -> usize {
        self.inner.window().max(self.step.window(&self.windows))
    }

    fn replicate(&self, factor: &RFactor) -> Result<StateSpace, IdentifyError> {
        let deterministic = self.inner.replicate(&factor.leading(self.inner.window()))?;
        let of_step = factor.leading(self.step.window(&self.windows));
        let part = self
            .step
            .estimate(&deterministic, &self.windows, &of_step)?;
        Ok(with_gain(&deterministic, &part))
    }
}
