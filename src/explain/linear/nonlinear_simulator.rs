//! A simulator that is not linear and known by its outputs only.

use std::sync::Arc;

use super::check::{Checked, constant_inputs};
use super::data::{Data, Series};
use super::fit::{Effort, Fit, Problem};
use super::known::Known;
use super::model::structure::Structure;
use super::search::null_models::Boring;
use super::search::single_effects::single_effects;
use crate::explain::document::explain_error::ExplainError;
use crate::explain::effects::{Action, Definition};
use crate::noise::Colours;

/// A simulated output that no model explains better than this is not a simulation of these inputs.
const UNDERSTOOD: f64 = 0.5;

/// What is known of a nonlinear simulator before the effect that it holds.
#[derive(Debug, Clone)]
pub(crate) struct NonlinearSimulator {
    /// What messages call it.
    pub(crate) name: String,
    /// The recordings.
    pub(crate) data: Data,
    /// The same with the simulated outputs.
    pub(crate) noise_free: Data,
    /// The linear model that is closest.
    pub(crate) structure: Structure,
    /// Norm of what that misses of the simulated outputs, over theirs.
    pub(crate) misfit: f64,
}

impl NonlinearSimulator {
    /// The linear model with the effect that the simulator holds, and the recordings relative to what these miss.
    ///
    /// # Errors
    /// Outputs that follow no model; too many states, too few samples.
    pub(crate) fn learn(&self, checked: &Checked) -> Result<Known, ExplainError> {
        let known = self.learnt().ok_or_else(|| ExplainError::NotUnderstood {
            name: self.name.clone(),
            misfit: self.misfit,
            constant: constant_inputs(&checked.recordings),
        })?;
        known.check(checked)?;
        Ok(known)
    }

    /// The effect is learnt from the noise-free outputs. What is missed even so is taken off the recording, so that it cancels.
    fn learnt(&self) -> Option<Known> {
        let (noise_free, structure) = (&self.noise_free, &self.structure);
        let mut data = self.data.clone();
        let mut problem = Problem::new(noise_free);
        problem.colours = Colours::White;
        let boring = Boring::fit(&problem, structure, None)?;
        let physical = |d: &Definition| {
            d.persists
                && matches!(
                    d.action,
                    Action::Force(..) | Action::Input(_) | Action::Sensor(_)
                )
        };
        let ranked = single_effects(&problem, &boring, &physical);
        let best = ranked.into_iter().next()?.fit;
        let best = Fit::run(
            &problem,
            best.structure.clone(),
            best.theta.clone(),
            Some(&best.noise),
            Effort::FINAL,
        )
        .unwrap_or(best);
        let fitted = &best.structure;
        let initial: Vec<Vec<f64>> = (0..noise_free.segments.len())
            .map(|s| fitted.initial_state(&best.theta, s).to_vec())
            .collect();
        let coordinates = fitted.coordinates.around(fitted.plant(&best.theta));
        let structure = Structure {
            coordinates: Arc::new(coordinates),
            plant_free: false,
            initial_free: false,
            feedthrough_free: false,
            substeps: 1,
            recording: None,
            initial,
            known: (0..fitted.effects.len())
                .map(|i| fitted.effect_numbers(&best.theta, i).to_vec())
                .collect(),
            adjusted: 0,
            ..fitted.clone()
        };
        let missed: Series = noise_free.residual(&structure.simulate(&[], noise_free)?);
        let size: f64 = missed.iter().flatten().map(|v| v * v).sum();
        let there: f64 = noise_free
            .outputs_as_series()
            .flatten()
            .map(|v| v * v)
            .sum();
        if size > UNDERSTOOD * UNDERSTOOD * there && self.misfit > UNDERSTOOD {
            return None;
        }
        let l = data.outputs;
        for (s, segment) in data.segments.iter_mut().enumerate() {
            for (o, y) in segment.outputs.iter_mut().enumerate() {
                for (y, missed) in y.iter_mut().zip(&missed[s * l + o]) {
                    *y -= missed;
                }
            }
        }
        Some(Known {
            delays: vec![0; data.inputs],
            data,
            structure,
            relative: true,
            identified: false,
            uncertainty: None,
        })
    }
}
