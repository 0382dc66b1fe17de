//! The augmented model as a document, and back.

use std::sync::Arc;

use nalgebra::DMatrix;

use crate::explain::effects::{self, Action};
use crate::explain::explanation::{AugmentedModel, ModelEffect, SignalReference};
use crate::explain::linear::data::{Segment, delayed};
use crate::explain::linear::model::coordinates::Coordinates;
use crate::explain::linear::model::functionals::{Functionals, Signal};
use crate::explain::linear::model::linear_plant::{Plant, row_major};
use crate::explain::linear::model::structure::{Direction, Instance, Structure};
use crate::linalg::Rows;
use crate::log::{Channel, is_sample_time};

/// Why an augmented model cannot be run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages explain the fields")]
pub enum AugmentedError {
    /// An effect that this version does not know.
    #[error("the model holds the effect `{id}` {variant}, which this version does not know")]
    Unknown { id: String, variant: String },
    /// Numbers that do not fit together.
    #[error("the model is damaged: {what}")]
    Damaged { what: String },
    /// Inputs that do not fit.
    #[error("the model needs {needed} inputs of equal length, and {found} are given")]
    Inputs { needed: usize, found: usize },
    /// Recorded outputs that do not fit.
    #[error(
        "the model has {needed} outputs, and as many recorded ones of the length of the inputs are needed; {found} are given"
    )]
    Outputs { needed: usize, found: usize },
    /// The outputs run away.
    #[error(
        "the simulation diverges on this input: it leaves the range that the model was fitted in; give an input of the amplitude of the recording"
    )]
    Diverges,
    /// A correction is needed and was not given.
    #[error(
        "this explanation is relative to a simulator that is not linear: give its answer to the same input with --simulation FILE.csv (one column an output)"
    )]
    SimulationNeeded,
}

impl AugmentedModel {
    /// Writes `structure` at `theta` down.
    pub(crate) fn describe(
        structure: &Structure,
        theta: &[f64],
        inputs: &[Channel],
        outputs: &[Channel],
        delays: &[usize],
        constant: bool,
    ) -> Self {
        let plant = structure.plant(theta);
        let rows = Functionals::new(&plant);
        let effects = structure
            .effects
            .iter()
            .enumerate()
            .map(|(index, effect)| {
                let force = effect.definition.action.is_force();
                let numbers = structure.effect_numbers(theta, index);
                let before =
                    effect.amplitudes(structure.states()) + effect.definition.parameters.len();
                ModelEffect {
                    effect: effect.definition.id.to_owned(),
                    variant: effect.definition.variant.to_owned(),
                    channel: match effect.direction {
                        Direction::Matched(input) if force => input,
                        _ => effect.channel,
                    },
                    looks_at: match effect.signal {
                        Signal::Output(o) => SignalReference::Output(o),
                        Signal::Integral(o) => SignalReference::Integral(o),
                        Signal::Difference(i, j) => SignalReference::Difference(i, j),
                    },
                    direction: if force {
                        structure.direction(theta, &plant, &rows, index)
                    } else {
                        Vec::new()
                    },
                    parameters: structure.shape(theta, index),
                    coefficients: numbers[before..].to_vec(),
                }
            })
            .collect();
        Self {
            sample_time: plant.sample_time,
            inputs: inputs.to_vec(),
            input_delays: delays.to_vec(),
            constant_input: constant,
            outputs: outputs.to_vec(),
            a: Rows(plant.a_matrix()),
            b: Rows(plant.b_matrix()),
            c: Rows(plant.c_matrix()),
            d: Rows(plant.d_matrix()),
            initial_states: (0..structure.initial.len())
                .map(|s| structure.initial_state(theta, s).to_vec())
                .collect(),
            effects,
            substeps: structure.substeps,
            mechanics: None,
            reference: None,
        }
    }

    /// The state that is meant where none is given: the operating point.
    pub(super) fn rest(&self) -> Vec<f64> {
        vec![0.0; self.a.0.nrows()]
    }

    /// Outputs on a new input (`inputs[channel][sample]`, in the units of the recording), from rest or from `initial`.
    ///
    /// What changed in the recording has changed; events of the recording (a drift, a frozen sensor, a disturbance whose
    /// phase is not known) are over. `simulation` is the answer of the original simulator to the same input, which a
    /// model relative to a nonlinear simulator needs.
    ///
    /// # Errors
    /// [`AugmentedError`]: a damaged model, inputs that do not fit, a simulation that diverges or is missing.
    pub fn simulate(
        &self,
        inputs: &[&[f64]],
        initial: Option<&[f64]>,
        simulation: Option<&[&[f64]]>,
    ) -> Result<Vec<Vec<f64>>, AugmentedError> {
        let mut outputs = self.run(inputs, initial)?;
        if let Some(reference) = &self.reference {
            let simulation = simulation.ok_or(AugmentedError::SimulationNeeded)?;
            let known = reference.run(inputs, None)?;
            for ((y, known), given) in outputs.iter_mut().zip(&known).zip(simulation) {
                if given.len() != y.len() {
                    return Err(AugmentedError::Damaged {
                        what: format!("{} simulated samples for {} inputs", given.len(), y.len()),
                    });
                }
                for ((y, known), given) in y.iter_mut().zip(known).zip(*given) {
                    *y += given - known;
                }
            }
        }
        Ok(outputs)
    }

    pub(super) fn run(
        &self,
        inputs: &[&[f64]],
        initial: Option<&[f64]>,
    ) -> Result<Vec<Vec<f64>>, AugmentedError> {
        let structure = self.structure()?;
        let signals = structure.coordinates.given.inputs - usize::from(self.constant_input);
        let samples = inputs.first().map_or(0, |u| u.len());
        if inputs.len() != signals || inputs.iter().any(|u| u.len() != samples) {
            return Err(AugmentedError::Inputs {
                needed: signals,
                found: inputs.len(),
            });
        }
        let mut columns: Vec<Vec<f64>> = inputs
            .iter()
            .enumerate()
            .map(|(j, u)| delayed(u, self.input_delays.get(j).copied().unwrap_or(0)))
            .collect();
        if self.constant_input {
            columns.push(vec![1.0; samples]);
        }
        let segment = Segment {
            inputs: columns,
            outputs: Vec::new(),
            start_time: 0.0,
        };
        let rest = self.rest();
        structure
            .simulate_fresh(&[], &segment, self.sample_time, initial.unwrap_or(&rest))
            .ok_or(AugmentedError::Diverges)
    }

    /// Whether the parts fit together, those of the reference too.
    ///
    /// # Errors
    /// [`AugmentedError::Unknown`] or [`AugmentedError::Damaged`].
    pub(crate) fn check(&self) -> Result<(), AugmentedError> {
        self.structure()?;
        let Some(reference) = &self.reference else {
            return Ok(());
        };
        if reference.inputs.len() != self.inputs.len()
            || reference.outputs.len() != self.outputs.len()
        {
            return Err(AugmentedError::Damaged {
                what: "the reference has other inputs or outputs than the model".to_owned(),
            });
        }
        reference.check()
    }

    /// The structure with all numbers fixed.
    pub(crate) fn structure(&self) -> Result<Structure, AugmentedError> {
        let damaged = |what: &str| AugmentedError::Damaged {
            what: what.to_owned(),
        };
        let (n, l) = (self.a.0.nrows(), self.outputs.len());
        let r = self.inputs.len() + usize::from(self.constant_input);
        let shaped = |m: &Rows,
                      rows: usize,
                      columns: usize,
                      name: &str|
         -> Result<DMatrix<f64>, AugmentedError> {
            let m = m.clone().shaped(rows, columns);
            if m.shape() == (rows, columns) && m.iter().all(|v| v.is_finite()) {
                Ok(m)
            } else {
                Err(damaged(&format!(
                    "{name} is {} x {}, not {rows} x {columns}",
                    m.nrows(),
                    m.ncols()
                )))
            }
        };
        if n > crate::explain::linear::model::time_stepping::MOST_STATES || l == 0 || r == 0 {
            return Err(damaged("too many states, or no input or output"));
        }
        if !(1..=crate::explain::linear::model::substeps::MOST_STEPS).contains(&self.substeps) {
            return Err(damaged(&format!(
                "substeps is {}, and can be 1 to {}",
                self.substeps,
                crate::explain::linear::model::substeps::MOST_STEPS
            )));
        }
        if !is_sample_time(self.sample_time) {
            return Err(damaged("the sample time is no positive number of seconds"));
        }
        if let Some(mechanics) = &self.mechanics
            && mechanics.window.partial_cmp(&0.0) != Some(std::cmp::Ordering::Greater)
        {
            return Err(damaged(
                "the window of the equation of motion has no length",
            ));
        }
        if self.input_delays.len() != self.inputs.len() {
            return Err(damaged("there is not one delay for each input"));
        }
        if self.initial_states.iter().any(|x0| x0.len() != n) {
            return Err(damaged("an initial state does not fit A"));
        }
        let plant = Plant {
            states: n,
            inputs: r,
            outputs: l,
            a: row_major(&shaped(&self.a, n, n, "A")?),
            b: row_major(&shaped(&self.b, n, r, "B")?),
            c: row_major(&shaped(&self.c, l, n, "C")?),
            d: row_major(&shaped(&self.d, l, r, "D")?),
            sample_time: self.sample_time,
        };
        let mut instances = Vec::new();
        let mut known = Vec::new();
        for effect in &self.effects {
            let definition = effects::find(&effect.effect, &effect.variant).ok_or_else(|| {
                AugmentedError::Unknown {
                    id: effect.effect.clone(),
                    variant: effect.variant.clone(),
                }
            })?;
            let (signal, places) = match effect.looks_at {
                SignalReference::Output(o) => (Signal::Output(o), vec![o]),
                SignalReference::Integral(o) => (Signal::Integral(o), vec![o]),
                SignalReference::Difference(i, j) => (Signal::Difference(i, j), vec![i, j]),
            };
            let instance = Instance {
                definition,
                channel: effect.channel,
                signal,
                direction: Direction::Free,
            };
            let on_output = matches!(definition.action, Action::Sensor(_));
            let channels = if on_output { l } else { r };
            if places.iter().any(|o| *o >= l) || effect.channel >= channels {
                return Err(damaged(
                    "an effect belongs to a channel that does not exist",
                ));
            }
            let mut numbers = effect.direction.clone();
            for (p, v) in definition.parameters.iter().zip(&effect.parameters) {
                if !v.is_finite() || p.logarithmic && *v <= 0.0 {
                    return Err(damaged(&format!("{} of {} is {v}", p.name, definition.id)));
                }
                numbers.push(if p.logarithmic { v.ln() } else { *v });
            }
            numbers.extend(&effect.coefficients);
            if numbers.len() != instance.len(n, l) || numbers.iter().any(|v| !v.is_finite()) {
                return Err(damaged(&format!(
                    "{} has the wrong number of numbers",
                    definition.id
                )));
            }
            instances.push(instance);
            known.push(numbers);
        }
        Ok(Structure {
            recording: None,
            coordinates: Arc::new(Coordinates::fixed(plant, Vec::new())),
            plant_free: false,
            initial_free: false,
            initial: self.initial_states.clone(),
            feedthrough_free: false,
            substeps: self.substeps,
            effects: instances,
            known,
            adjusted: 0,
        })
    }
}
