//! An augmented model's structure: which numbers are free, and how they become a simulation.
//!
//! The parameter vector holds, in this order, the free numbers of the plant ([`Coordinates`]), the initial state of
//! every segment, the levels of the outputs, and the numbers of each effect. Logarithmic parameters are held as
//! logarithms.

mod added;
#[cfg(test)]
mod tests;
pub(crate) mod without_effects;

use std::borrow::Cow;
use std::sync::Arc;

use super::coordinates::Coordinates;
use super::functionals::{Functionals, Signal, dot, matched_sign};
use super::linear_plant::Plant;
use super::substeps::Finer;
use super::time_stepping::{ActiveForce, Grid, run};
use crate::explain::effects::{Action, CHARGE_ORDERS, Clock, Definition, Moments, Needs};
use crate::explain::linear::data::{Data, Segment, Series};
pub(crate) use added::{add_charge, add_mode, add_sine, with_moments};

/// How a force enters the state equation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Direction {
    /// As this input does: one amplitude, in the input's unit.
    Matched(usize),
    /// Through a direction of its own: a number a state.
    Free,
}

/// One effect at one place.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Instance {
    pub(crate) definition: &'static Definition,
    /// Input or output index, for effects on channels and paths.
    pub(crate) channel: usize,
    /// What a force looks at.
    pub(crate) signal: Signal,
    /// How a force enters.
    pub(crate) direction: Direction,
}

impl Instance {
    /// Whether it is the same effect at the same place.
    pub(crate) fn is_same(&self, other: &Self) -> bool {
        std::ptr::eq(self.definition, other.definition)
            && self.channel == other.channel
            && self.signal == other.signal
            && self.direction == other.direction
    }

    /// Numbers before the shape parameters: amplitude or direction of a force.
    pub(crate) fn amplitudes(&self, states: usize) -> usize {
        match self.direction {
            _ if !self.definition.action.is_force() => 0,
            Direction::Matched(_) => 1,
            Direction::Free => states,
        }
    }

    /// Numbers after the shape parameters: residues of a mode, cosine and sine parts at the outputs, the column of a
    /// missing path and the levels it brings, coefficients of a curve of a charge.
    pub(crate) fn coefficients(&self, states: usize, outputs: usize) -> usize {
        match self.definition.action {
            Action::Mode | Action::Sine => 2 * outputs,
            Action::Charge => CHARGE_ORDERS * outputs,
            Action::MissingPath => states + outputs,
            _ => 0,
        }
    }

    /// All its numbers.
    pub(crate) fn len(&self, states: usize, outputs: usize) -> usize {
        self.amplitudes(states)
            + self.definition.parameters.len()
            + self.coefficients(states, outputs)
    }
}

/// Which numbers are free.
#[derive(Debug, Clone)]
pub(crate) struct Structure {
    pub(crate) coordinates: Arc<Coordinates>,
    /// The plant's numbers are free; else those of the simulation.
    pub(crate) plant_free: bool,
    /// The initial states are free; else they are `initial`.
    pub(crate) initial_free: bool,
    /// Initial state of each segment while it is not free.
    pub(crate) initial: Vec<Vec<f64>>,
    /// The direct feedthrough is free (it then is of the plant's numbers, so the plant must be free too).
    pub(crate) feedthrough_free: bool,
    /// Steps of the recursion in a sample interval, more than one where a law decides within it (see `substeps`).
    pub(crate) substeps: usize,
    /// The new effects act in this recording only; else in all.
    pub(crate) recording: Option<usize>,
    /// All effects; the first `known.len()` of them are in the simulation already.
    pub(crate) effects: Vec<Instance>,
    /// Numbers of the effects that the simulation knows; they are free when the plant is.
    pub(crate) known: Vec<Vec<f64>>,
    /// So many effects after those are adjustments of a number (`effects::linear`), not new physics.
    pub(crate) adjusted: usize,
}

impl Structure {
    pub(crate) fn states(&self) -> usize {
        self.coordinates.given.states
    }

    pub(crate) fn outputs(&self) -> usize {
        self.coordinates.given.outputs
    }

    /// Numbers before those of the effects.
    pub(crate) fn linear_len(&self) -> usize {
        (if self.plant_free {
            self.coordinates.len()
        } else {
            0
        }) + (if self.initial_free {
            self.states() * self.initial.len()
        } else {
            0
        }) + self.feedthrough_len()
    }

    /// Numbers of `D` that are free: those of the active inputs.
    fn feedthrough_len(&self) -> usize {
        if self.plant_free && self.feedthrough_free {
            self.outputs() * self.coordinates.active_inputs.len()
        } else {
            0
        }
    }

    /// Index of the first effect that is new physics.
    pub(crate) fn first_new(&self) -> usize {
        self.known.len() + self.adjusted
    }

    /// The effects that are new physics.
    pub(crate) fn new_effects(&self) -> &[Instance] {
        &self.effects[self.first_new()..]
    }

    /// The same without new effects, whose numbers are the last ones.
    pub(crate) fn without_new(&self) -> Self {
        let mut structure = self.clone();
        structure.effects.truncate(self.first_new());
        structure.recording = None;
        structure
    }

    /// Effects whose numbers are in the parameter vector.
    fn free_effects(&self) -> std::ops::Range<usize> {
        (if self.plant_free { 0 } else { self.known.len() })..self.effects.len()
    }

    pub(crate) fn len(&self) -> usize {
        self.effect_offset(self.effects.len())
    }

    /// Numbers that are fitted.
    pub(crate) fn free_len(&self) -> usize {
        self.held().iter().filter(|held| !**held).count()
    }

    /// Which numbers stay where they are: where a curve is looked at, and the amplitude beside its coefficients.
    pub(crate) fn held(&self) -> Vec<bool> {
        let mut held = vec![false; self.linear_len()];
        for effect in &self.effects[self.free_effects()] {
            let amplitudes = effect.amplitudes(self.states());
            held.extend(std::iter::repeat_n(
                effect.definition.is_curve(),
                amplitudes,
            ));
            held.extend(effect.definition.parameters.iter().map(|p| p.held));
            let coefficients = effect.coefficients(self.states(), self.outputs());
            held.extend(std::iter::repeat_n(false, coefficients));
        }
        held
    }

    /// Where the numbers of effect `index` begin (those of known effects have no place while they are fixed).
    pub(crate) fn effect_offset(&self, index: usize) -> usize {
        self.linear_len()
            + self.effects[self.free_effects().start.min(index)..index]
                .iter()
                .map(|e| e.len(self.states(), self.outputs()))
                .sum::<usize>()
    }

    /// Place of the time at which effect `index` begins, if it has one.
    pub(crate) fn change_time(&self, index: usize) -> Option<usize> {
        let effect = &self.effects[index];
        let at = effect.definition.change_time()?;
        Some(self.effect_offset(index) + effect.amplitudes(self.states()) + at)
    }

    /// The numbers of effect `index`.
    pub(crate) fn effect_numbers<'a>(&'a self, theta: &'a [f64], index: usize) -> &'a [f64] {
        if !self.plant_free && index < self.known.len() {
            return &self.known[index];
        }
        let from = self.effect_offset(index);
        &theta[from..from + self.effects[index].len(self.states(), self.outputs())]
    }

    /// The linear numbers, and those of the known effects, as they were given; nothing is adjusted.
    pub(crate) fn given(&self) -> Vec<f64> {
        let mut theta = self.given_linear();
        if self.plant_free {
            theta.extend(self.known.iter().flatten());
        }
        // Adjustments of nothing.
        let adjusted = &self.effects[self.known.len()..self.first_new().min(self.effects.len())];
        let numbers = adjusted
            .iter()
            .map(|e| e.len(self.states(), self.outputs()))
            .sum();
        theta.extend(std::iter::repeat_n(0.0, numbers));
        theta
    }

    /// The linear numbers of the simulation as it was given.
    fn given_linear(&self) -> Vec<f64> {
        let mut theta = Vec::with_capacity(self.linear_len());
        if self.plant_free {
            theta.extend(self.coordinates.numbers(&self.coordinates.given));
        }
        if self.initial_free {
            theta.extend(self.initial.iter().flatten());
        }
        if self.feedthrough_len() > 0 {
            let given = &self.coordinates.given;
            for &input in &self.coordinates.active_inputs {
                theta.extend((0..given.outputs).map(|o| given.d[o * given.inputs + input]));
            }
        }
        theta
    }

    /// Bounds of each number, on the scale it is held in.
    pub(crate) fn bounds(&self) -> Vec<(f64, f64)> {
        let open = (f64::NEG_INFINITY, f64::INFINITY);
        let mut bounds = vec![open; self.linear_len()];
        for effect in &self.effects[self.free_effects()] {
            let amplitude = match (effect.definition.action, effect.direction) {
                (
                    Action::Force(_, _, crate::explain::effects::Sense::Resists),
                    Direction::Matched(_),
                ) => (0.0, f64::INFINITY),
                _ => open,
            };
            bounds.extend(std::iter::repeat_n(
                amplitude,
                effect.amplitudes(self.states()),
            ));
            bounds.extend(effect.definition.parameters.iter().map(|p| {
                if p.logarithmic {
                    (p.lower.ln(), p.upper.ln())
                } else {
                    (p.lower, p.upper)
                }
            }));
            bounds.extend(std::iter::repeat_n(
                open,
                effect.coefficients(self.states(), self.outputs()),
            ));
        }
        bounds
    }

    /// The plant that these numbers stand for.
    pub(crate) fn plant(&self, theta: &[f64]) -> Plant {
        if self.plant_free {
            let mut plant = self.coordinates.plant(&theta[..self.coordinates.len()]);
            let count = self.feedthrough_len();
            if count > 0 {
                let l = plant.outputs;
                let numbers = &theta[self.linear_len() - count..];
                for (&input, column) in self
                    .coordinates
                    .active_inputs
                    .iter()
                    .zip(numbers.chunks_exact(l))
                {
                    for (o, d) in column.iter().enumerate() {
                        plant.d[o * plant.inputs + input] = *d;
                    }
                }
            }
            plant
        } else {
            self.coordinates.given.clone()
        }
    }

    /// Initial state of segment `index`.
    pub(crate) fn initial_state<'a>(&'a self, theta: &'a [f64], index: usize) -> &'a [f64] {
        let n = self.states();
        if self.initial_free {
            let from = (if self.plant_free {
                self.coordinates.len()
            } else {
                0
            }) + n * index;
            &theta[from..from + n]
        } else {
            &self.initial[index]
        }
    }

    /// Shape parameters of effect `index` in physical units.
    pub(crate) fn shape(&self, theta: &[f64], index: usize) -> Vec<f64> {
        let effect = &self.effects[index];
        let numbers = &self.effect_numbers(theta, index)[effect.amplitudes(self.states())..];
        effect
            .definition
            .parameters
            .iter()
            .zip(numbers)
            .map(|(p, v)| if p.logarithmic { v.exp() } else { *v })
            .collect()
    }

    /// Direction through which force `index` enters, amplitude included (`n`).
    pub(crate) fn direction(
        &self,
        theta: &[f64],
        plant: &Plant,
        rows: &Functionals,
        index: usize,
    ) -> Vec<f64> {
        let numbers = self.effect_numbers(theta, index);
        match self.effects[index].direction {
            Direction::Free => numbers[..self.states()].to_vec(),
            Direction::Matched(input) => {
                let sign = matched_sign(
                    plant,
                    &rows.of(plant, self.effects[index].signal).forward,
                    input,
                );
                plant
                    .b_column(input)
                    .iter()
                    .map(|b| sign * numbers[0] * b)
                    .collect()
            }
        }
    }

    /// Simulated outputs of all segments; `None` when they leave any sensible range.
    pub(crate) fn simulate(&self, theta: &[f64], data: &Data) -> Option<Series> {
        let prepared = self.prepare(theta);
        let elsewhere = self.recording.map(|_| self.without_new());
        let elsewhere =
            elsewhere.map(|structure| (structure.prepare(&theta[..structure.len()]), structure));
        let mut outputs = Vec::with_capacity(data.segments.len() * data.outputs);
        for (index, segment) in data.segments.iter().enumerate() {
            let clock = Clock {
                start: segment.start_time,
                step: data.sample_time,
                fresh: false,
            };
            let x0 = self.initial_state(theta, index);
            let (structure, prepared, theta) = match &elsewhere {
                Some((prepared, structure)) if self.recording != Some(index) => {
                    (structure, prepared, &theta[..structure.len()])
                }
                _ => (self, &prepared, theta),
            };
            outputs.extend(structure.simulate_segment(theta, prepared, segment, x0, &clock)?);
        }
        Some(outputs)
    }

    /// Outputs on a new input from the initial state `x0`.
    pub(crate) fn simulate_fresh(
        &self,
        theta: &[f64],
        segment: &Segment,
        sample_time: f64,
        x0: &[f64],
    ) -> Option<Series> {
        let clock = Clock {
            start: segment.start_time,
            step: sample_time,
            fresh: true,
        };
        self.simulate_segment(theta, &self.prepare(theta), segment, x0, &clock)
    }

    /// What all segments share.
    pub(crate) fn prepare(&self, theta: &[f64]) -> Prepared {
        let mut plant = self.plant(theta);
        let mut forces = Vec::new();
        let mut own_rows: Option<Functionals> = None;
        for (index, effect) in self.effects.iter().enumerate() {
            if !effect.definition.action.is_force() {
                continue;
            }
            // The plant as given is the same for all numbers.
            let rows = if self.plant_free {
                &*own_rows.get_or_insert_with(|| Functionals::new(&plant))
            } else {
                self.coordinates.given_rows()
            };
            let signal = rows.of(&plant, effect.signal);
            let direction = self.direction(theta, &plant, rows, index);
            match effect.definition.action {
                Action::Linear(Needs::Position) => {
                    plant.add_linear_force(&direction, &signal.position, &[]);
                }
                Action::Linear(Needs::Acceleration) => plant.add_inertia(&direction, &signal.rate),
                Action::Linear(_) => {
                    plant.add_linear_force(&direction, &signal.rate, &signal.rate_feedthrough);
                }
                Action::Force(law, ..) => forces.push(ActiveForce {
                    law,
                    parameters: self.shape(theta, index),
                    rate_gain: dot(&signal.rate, &direction),
                    position: signal.position,
                    position_feedthrough: signal.position_feedthrough,
                    rate: signal.rate,
                    rate_feedthrough: signal.rate_feedthrough,
                    direction,
                    input: match effect.direction {
                        Direction::Matched(input) => input,
                        Direction::Free => effect.channel,
                    },
                }),
                _ => {}
            }
        }
        Prepared {
            finer: (self.substeps > 1)
                .then(|| Finer::new(&plant, self.substeps))
                .flatten(),
            plant,
            forces,
        }
    }

    /// Inputs as the plant sees them, and their moments within the intervals (all first ones, then all second ones) where a law
    /// has any.
    pub(crate) fn effective_inputs<'a>(
        &self,
        theta: &[f64],
        segment: &'a Segment,
        clock: &Clock,
    ) -> (Cow<'a, Series>, Option<Series>) {
        let mut inputs = Cow::Borrowed(&segment.inputs);
        let mut moments: Option<Vec<Vec<Moments>>> = None;
        for (index, effect) in self.effects.iter().enumerate() {
            if let Action::Input(law) = effect.definition.action {
                let moments = moments.get_or_insert_with(|| {
                    let inputs = segment.inputs.iter();
                    inputs.map(|u| vec![[0.0; 2]; u.len()]).collect()
                });
                law(
                    &self.shape(theta, index),
                    &mut inputs.to_mut()[effect.channel],
                    &mut moments[effect.channel],
                    clock,
                );
            }
        }
        let any = moments.filter(|m| m.iter().flatten().any(|m| *m != [0.0; 2]));
        let series = any.map(|moments| {
            let of = |degree: usize| {
                let channels = moments.iter();
                channels.map(move |m| m.iter().map(|m| m[degree]).collect::<Vec<f64>>())
            };
            of(0).chain(of(1)).collect()
        });
        (inputs, series)
    }

    fn simulate_segment(
        &self,
        theta: &[f64],
        prepared: &Prepared,
        segment: &Segment,
        x0: &[f64],
        clock: &Clock,
    ) -> Option<Series> {
        let (mut inputs, moments) = self.effective_inputs(theta, segment, clock);
        let forces = &prepared.forces;
        let mut with_paths = Cow::Borrowed(&prepared.plant);
        for (index, effect) in self.effects.iter().enumerate() {
            if matches!(effect.definition.action, Action::MissingPath) {
                let plant = with_paths.to_mut();
                let column = &self.effect_numbers(theta, index)[..self.states()];
                for (i, b) in column.iter().enumerate() {
                    plant.b[i * plant.inputs + effect.channel] = *b;
                }
            }
        }
        if let Some(moments) = moments {
            with_paths = Cow::Owned(with_moments(&with_paths));
            inputs.to_mut().extend(moments);
        }
        let samples = segment.samples();
        let mut outputs = if let Some(finer) = &prepared.finer {
            finer.run(&with_paths, forces, x0, &inputs, samples, clock)?
        } else {
            run(
                &with_paths,
                forces,
                x0,
                &inputs,
                Grid::of_samples(samples),
                clock,
            )?
        };
        for (index, effect) in self.effects.iter().enumerate() {
            if matches!(effect.definition.action, Action::Mode) {
                let residues =
                    &self.effect_numbers(theta, index)[effect.definition.parameters.len()..];
                add_mode(
                    &self.shape(theta, index),
                    residues,
                    &inputs[effect.channel],
                    clock,
                    &mut outputs,
                );
            }
        }
        for (index, effect) in self.effects.iter().enumerate() {
            if matches!(effect.definition.action, Action::MissingPath) {
                // The simulation holds for some level of the input that it does not know.
                let levels = &self.effect_numbers(theta, index)[self.states()..];
                for (output, level) in outputs.iter_mut().zip(levels) {
                    output.iter_mut().for_each(|y| *y += level);
                }
            }
            if matches!(effect.definition.action, Action::Charge) {
                let coefficients =
                    &self.effect_numbers(theta, index)[effect.definition.parameters.len()..];
                let shape = self.shape(theta, index);
                add_charge(
                    &shape,
                    coefficients,
                    &segment.inputs[effect.channel],
                    clock,
                    &mut outputs,
                );
            }
            if matches!(effect.definition.action, Action::Sine) && !clock.fresh {
                let parts =
                    &self.effect_numbers(theta, index)[effect.definition.parameters.len()..];
                add_sine(self.shape(theta, index)[0], parts, clock, &mut outputs);
            }
            if let Action::Sensor(law) = effect.definition.action
                && (effect.definition.persists || !clock.fresh)
            {
                law(
                    &self.shape(theta, index),
                    &mut outputs[effect.channel],
                    clock,
                );
            }
        }
        Some(outputs)
    }
}

/// What all segments share at one parameter vector.
#[derive(Debug, Clone)]
pub(crate) struct Prepared {
    pub(crate) plant: Plant,
    pub(crate) forces: Vec<ActiveForce>,
    finer: Option<Finer>,
}
