//! Simulation of a plant with sensitivities.
//!
//! A run without slopes chooses the steps within each sample. Slopes ([`Plant::sensitivities`]) are those of the same steps, so
//! that they are the derivatives of what [`Plant::simulate`] computes.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use nalgebra::DMatrix;

use super::dual::Dual;
use super::field::Field;
use super::integrator::{IMPLICIT, Integrator};
use super::linear::{Linearity, Propagator};
use super::step::Stages;
use super::step_control::{IMPLICIT_COST, STEP_ACCURACY, StepControl};
use super::tape::Tape;
use crate::physics::expression::{ExpressionId, Node};
use crate::physics::spec::ModelSpec;

/// How inputs behave between samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Hold {
    /// Constant until the next sample.
    #[default]
    Zero,
    /// On a straight line to the next sample.
    Linear,
}

/// Inputs of a run.
#[derive(Debug, Clone, Copy)]
pub struct Excitation<'a> {
    /// A column for each input, in the order of declaration.
    pub inputs: &'a [&'a [f64]],
    /// Number of samples: that of each column, and needed where a plant has no input.
    pub length: usize,
    /// Seconds from sample to sample.
    pub sample_time: f64,
    /// Time of the first sample.
    pub start_time: f64,
    /// Between samples.
    pub hold: Hold,
}

impl Excitation<'_> {
    pub(super) fn samples(&self) -> usize {
        self.length
    }

    pub(super) fn time(&self, sample: usize) -> f64 {
        self.start_time + sample as f64 * self.sample_time
    }

    /// Where in a sample an instant lies, from 0 to 1.
    pub(super) fn fraction(&self, sample: usize, time: f64) -> f64 {
        ((time - self.time(sample)) / self.sample_time).clamp(0.0, 1.0)
    }

    /// Value of a series at `at`, which lies in `sample`.
    pub(super) fn between<const M: usize>(
        &self,
        series: &[Dual<M>],
        sample: usize,
        at: &Dual<M>,
    ) -> Dual<M> {
        let last = series.len() - 1;
        let (a, b) = (series[sample.min(last)], series[(sample + 1).min(last)]);
        if self.hold == Hold::Zero || at.value <= self.start_time {
            return a;
        }
        let part = self.fraction(sample, at.value);
        let mut value = Dual::constant(0.0).plus(1.0 - part, &a).plus(part, &b);
        for (s, t) in value.slope.iter_mut().zip(&at.slope) {
            *s += (b.value - a.value) / self.sample_time * t;
        }
        value
    }
}

/// Values of what may be estimated.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// One for each parameter, in the order of [`ModelSpec::parameters`].
    pub parameters: Vec<f64>,
    /// One for each state; `None` takes the start value of the text.
    pub start: Vec<Option<f64>>,
}

/// What outputs are differentiated by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// A parameter, by its place in [`ModelSpec::parameters`].
    Parameter(usize),
    /// The initial value of a state, by its place in [`ModelSpec::states`].
    Start(usize),
    /// An element of the observer's gain: state and output.
    Gain(usize, usize),
}

/// An observer: after each sample the states are corrected by `gain` times the difference of recording and output.
#[derive(Debug, Clone, Copy)]
pub struct Observer<'a> {
    /// Rows of states, columns of outputs.
    pub gain: &'a DMatrix<f64>,
    /// A column for each output.
    pub recorded: &'a [&'a [f64]],
}

/// The steps of a run, and the ramps of its switches.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Plan {
    pub(super) steps: Vec<u8>,
    pub(super) widths: Vec<f64>,
}

impl Plan {
    /// Number of steps.
    pub fn steps(&self) -> usize {
        self.steps.len()
    }

    /// What the steps cost, in explicit ones.
    pub(crate) fn cost(&self) -> usize {
        self.steps() + (IMPLICIT_COST - 1) * self.implicit_steps()
    }

    /// Number of implicit steps.
    pub fn implicit_steps(&self) -> usize {
        self.steps.iter().filter(|&&s| s & IMPLICIT != 0).count()
    }
}

/// The answer of a plant.
#[derive(Debug, Clone)]
pub struct Trajectory {
    /// A column for each output.
    pub outputs: Vec<Vec<f64>>,
    /// A column for each state.
    pub states: Vec<Vec<f64>>,
    /// The steps it was computed in.
    pub plan: Plan,
}

/// Why a plant cannot be simulated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SimulationError {
    /// An expression has no value.
    #[error(
        "at t = {time:.6} s `{expression}` (line {line}) is not a number{}",
        said(values)
    )]
    NotANumber {
        /// When.
        time: f64,
        /// As written.
        expression: String,
        /// Line of the text.
        line: usize,
        /// Names and values of the variables in it.
        values: Vec<(String, f64)>,
    },
    /// A state leaves every bound.
    #[error(
        "at t = {time:.6} s the state `{state}` reaches {value:e}: the plant is unstable from this start with these parameters"
    )]
    Diverged {
        /// When.
        time: f64,
        /// Name.
        state: String,
        /// Its value.
        value: f64,
    },
    /// The plant needs far more steps than samples.
    #[error(
        "at t = {time:.6} s the simulation has taken {steps} steps for {samples} samples: with these values the equations are far faster than the sampling"
    )]
    TooFast {
        /// When.
        time: f64,
        /// Steps so far.
        steps: usize,
        /// Samples so far.
        samples: usize,
    },
    /// The excitation is not that of the plant.
    #[error(
        "the plant has {expected} inputs of {length} samples each; {found} columns were given, or columns of another length"
    )]
    Inputs {
        /// Number of inputs of the plant.
        expected: usize,
        /// Number of samples.
        length: usize,
        /// Number of columns.
        found: usize,
    },
}

fn said(values: &[(String, f64)]) -> String {
    if values.is_empty() {
        return String::new();
    }
    let list: Vec<String> = values
        .iter()
        .map(|(n, v)| format!("{n} = {v:.6e}"))
        .collect();
    format!("; there {}", list.join(", "))
}

/// A state that grows to as many times its start (at least 1) has diverged. A pressure in Pa or an energy in J comes nowhere near.
const DIVERGED: f64 = 1e15;

/// A simulation may take so many steps a sample on average, and always this many: some seconds of computing.
const MOST_STEPS_A_SAMPLE: usize = 1000;
const MOST_STEPS: usize = 2_000_000;
/// One that is repeated with other values may take so many steps a sample, and so many times those of the first.
const MOST_REPEATED_A_SAMPLE: usize = 100;
const MOST_REPEATED: usize = 10;

/// A plant that can be simulated.
#[derive(Debug, Clone)]
pub struct Plant {
    /// Its equations.
    pub spec: ModelSpec,
    pub(super) tape: Tape,
    pub(super) linearity: Linearity,
    /// Values of the parameters, where they are not those of the text.
    nominal: Option<Vec<f64>>,
    /// Error of a step as a part of how far a state has moved.
    pub(in crate::physics) accuracy: f64,
    /// Steps a sample that a run may take on average, where fewer are allowed than is usual.
    pub(super) most_steps: Option<usize>,
    /// What all runs of this plant and of those that [count together](Self::counting_with) have cost.
    work: Arc<AtomicU64>,
}

impl Plant {
    /// Compiles the equations.
    pub fn new(spec: ModelSpec) -> Self {
        let tape = Tape::new(&spec);
        let smooth = tape.delays.is_empty() && tape.switches.iter().all(|s| !s.moves);
        let linearity = if smooth {
            Linearity::of(&spec)
        } else {
            Linearity::No
        };
        Self {
            spec,
            tape,
            linearity,
            nominal: None,
            accuracy: STEP_ACCURACY,
            most_steps: None,
            work: Arc::default(),
        }
    }

    /// Values of the text, or those it was given in their place: those of parameters, and no start value of its own.
    pub fn nominal(&self) -> Point {
        let mut frame = self.tape.frame::<0>();
        self.tape.run_parameters(&mut frame);
        let of_text = || {
            self.tape
                .nominal
                .iter()
                .map(|&p| frame.slot[p].value)
                .collect()
        };
        Point {
            parameters: self.nominal.clone().unwrap_or_else(of_text),
            start: vec![None; self.tape.states.len()],
        }
    }

    /// The plant with these values of its parameters in the text.
    pub fn with_values(&self, parameters: &[f64]) -> Self {
        let mut changed = self.clone();
        changed.nominal = Some(parameters.to_vec());
        changed
    }

    /// The plant simulated with steps whose error is this part of how far a state has moved.
    pub(crate) fn with_accuracy(mut self, accuracy: f64) -> Self {
        self.accuracy = accuracy;
        self
    }

    /// The plant whose runs are refused where they need more steps a sample than this, on average.
    pub(crate) fn with_most_steps(mut self, steps: usize) -> Self {
        self.most_steps = Some(steps);
        self
    }

    /// The plant whose runs count as work of another's.
    pub(crate) fn counting_with(mut self, other: &Plant) -> Self {
        self.work = Arc::clone(&other.work);
        self
    }

    /// The plant whose runs are counted from now on.
    pub(crate) fn counting(mut self) -> Self {
        self.work = Arc::default();
        self
    }

    /// Operations of all runs so far: the same on any machine and with any number of threads.
    pub(crate) fn work(&self) -> u64 {
        self.work.load(Ordering::Relaxed)
    }

    /// Counts steps of a run, each with so many numbers for a value.
    fn count(&self, steps: usize, numbers: usize) {
        let operations = self.tape.operations() + self.tape.states.len();
        let done = (steps * numbers * operations) as u64;
        self.work.fetch_add(done, Ordering::Relaxed);
    }

    /// Initial states at `point`.
    pub fn start(&self, point: &Point) -> Vec<f64> {
        let mut frame = self.tape.frame::<0>();
        for (&slot, &value) in self.tape.parameters.iter().zip(&point.parameters) {
            frame.slot[slot].value = value;
        }
        self.tape.run_parameters(&mut frame);
        let text = self.tape.starts.iter().map(|&s| frame.slot[s].value);
        text.zip(&point.start)
            .map(|(t, own)| own.unwrap_or(t))
            .collect()
    }

    /// The free run, or, with an observer, the one-step predictions.
    ///
    /// # Errors
    /// When an expression has no value, a state diverges, or the inputs are not those of the plant.
    pub fn simulate(
        &self,
        point: &Point,
        excitation: &Excitation,
        observer: Option<&Observer>,
    ) -> Result<Trajectory, SimulationError> {
        let most = MOST_STEPS.max(MOST_STEPS_A_SAMPLE * excitation.length);
        let moving = self.tape.switches.iter().any(|s| s.moves);
        if !moving {
            return self.run_choosing(point, excitation, observer, Some(&[]), most);
        }
        // A first run only finds how large the arguments of switches become.
        let rough = self.run_choosing(point, excitation, observer, None, most)?;
        let widths = Some(rough.plan.widths.as_slice());
        self.run_choosing(point, excitation, observer, widths, most)
    }

    /// As [`simulate`](Self::simulate) with the ramps of an earlier run: the answer is then smooth in the parameters. Values that
    /// need far more steps than that run are refused.
    ///
    /// # Errors
    /// As `simulate`.
    pub fn simulate_as(
        &self,
        point: &Point,
        excitation: &Excitation,
        observer: Option<&Observer>,
        plan: &Plan,
    ) -> Result<Trajectory, SimulationError> {
        let most = (MOST_REPEATED_A_SAMPLE * excitation.length).max(MOST_REPEATED * plan.steps());
        self.run_choosing(point, excitation, observer, Some(&plan.widths), most)
    }

    fn check(&self, excitation: &Excitation) -> Result<(), SimulationError> {
        let expected = self.tape.inputs.len();
        let sound = excitation.inputs.len() == expected
            && excitation
                .inputs
                .iter()
                .all(|c| c.len() == excitation.length)
            && excitation.length > 0;
        if sound {
            return Ok(());
        }
        Err(SimulationError::Inputs {
            expected,
            length: excitation.length,
            found: excitation.inputs.len(),
        })
    }

    pub(super) fn integrator<'a, const M: usize>(
        &'a self,
        point: &Point,
        excitation: &'a Excitation<'a>,
        widths: &[f64],
        directions: &[Direction],
    ) -> Integrator<'a, M> {
        let mut frame = self.tape.frame::<M>();
        for (width, &known) in frame.width.iter_mut().zip(widths) {
            *width = known;
        }
        for (i, (&slot, &value)) in self
            .tape
            .parameters
            .iter()
            .zip(&point.parameters)
            .enumerate()
        {
            frame.slot[slot] = Dual::constant(value);
            if let Some(lane) = directions
                .iter()
                .position(|&d| d == Direction::Parameter(i))
            {
                frame.slot[slot].slope[lane] = 1.0;
            }
        }
        let field = Field::new(&self.tape, frame, excitation);
        let x: Vec<Dual<M>> = (0..self.tape.states.len())
            .map(|i| {
                let text = field.frame.slot[self.tape.starts[i]];
                let mut x = point.start[i].map_or(text, Dual::constant);
                if let Some(lane) = directions.iter().position(|&d| d == Direction::Start(i)) {
                    x = Dual::constant(x.value);
                    x.slope[lane] = 1.0;
                }
                x
            })
            .collect();
        let room = vec![Dual::constant(0.0); x.len()];
        let mut field = field;
        let propagator = self
            .linearity
            .holds(excitation.hold)
            .then(|| Propagator::new(&mut field, x.len(), excitation.sample_time, excitation.hold));
        Integrator {
            propagator,
            parts: field.parts(),
            field,
            stages: Stages::new(x.len()),
            first: room.clone(),
            next: room,
            x,
        }
    }

    fn run_choosing(
        &self,
        point: &Point,
        excitation: &Excitation,
        observer: Option<&Observer>,
        widths: Option<&[f64]>,
        most_steps: usize,
    ) -> Result<Trajectory, SimulationError> {
        self.check(excitation)?;
        let mut integrator = self.integrator::<0>(point, excitation, widths.unwrap_or(&[]), &[]);
        let mut control = StepControl::new(self, &integrator, widths.is_none(), most_steps);
        let [mut outputs, mut states] = [&self.tape.outputs, &self.tape.states]
            .map(|of| vec![Vec::with_capacity(excitation.length); of.len()]);
        let columns = [&mut outputs, &mut states];
        let run = self.run_with(
            &mut integrator,
            &mut control,
            (excitation, observer),
            columns,
        );
        self.count(control.attempts() + excitation.length, 1);
        run?;
        Ok(Trajectory {
            outputs,
            states,
            plan: control.plan(&self.tape, &integrator.field.frame.width),
        })
    }

    /// Appends outputs and states at every sample.
    fn run_with(
        &self,
        integrator: &mut Integrator<0>,
        control: &mut StepControl,
        (excitation, observer): (&Excitation, Option<&Observer>),
        [outputs, states]: [&mut Vec<Vec<f64>>; 2],
    ) -> Result<(), SimulationError> {
        let limits: Vec<f64> = (integrator.x.iter())
            .map(|x| DIVERGED * x.value.abs().max(1.0))
            .collect();
        for k in 0..excitation.length {
            integrator.sample(k, excitation);
            for (column, x) in states.iter_mut().zip(&integrator.x) {
                column.push(x.value);
            }
            for (column, &slot) in outputs.iter_mut().zip(&self.tape.outputs) {
                column.push(integrator.field.frame.slot[slot].value);
            }
            if let Some(at) = outputs.iter().position(|o| !o[k].is_finite()) {
                return Err(self
                    .not_a_number(integrator, excitation.time(k))
                    .unwrap_or_else(|| self.diverged(integrator, excitation.time(k), at)));
            }
            integrator.correct(k, excitation, observer, &self.tape.outputs, &[]);
            if k + 1 < excitation.length {
                if !integrator.propagate(k, excitation) {
                    control.advance(integrator, k, excitation)?;
                }
                self.bounded(integrator, &limits, excitation.time(k + 1))?;
            }
        }
        Ok(())
    }

    /// Whether no state has diverged.
    fn bounded(
        &self,
        integrator: &Integrator<0>,
        limits: &[f64],
        time: f64,
    ) -> Result<(), SimulationError> {
        let mut states = integrator.x.iter().zip(limits);
        match states.position(|(x, &limit)| x.value.is_nan() || x.value.abs() >= limit) {
            Some(i) => Err(self.diverged(integrator, time, i)),
            None => Ok(()),
        }
    }

    pub(super) fn diverged<const M: usize>(
        &self,
        integrator: &Integrator<M>,
        time: f64,
        state: usize,
    ) -> SimulationError {
        let states = self.spec.states();
        let name = states
            .get(state)
            .map_or("output", |&v| &self.spec.variable(v).name);
        SimulationError::Diverged {
            time,
            state: name.to_owned(),
            value: integrator.x.get(state).map_or(f64::NAN, |x| x.value),
        }
    }

    /// What in the frame has no value although its operands have one.
    pub(super) fn not_a_number<const M: usize>(
        &self,
        integrator: &Integrator<M>,
        time: f64,
    ) -> Option<SimulationError> {
        let at = self.tape.culprit(&integrator.field.frame)?;
        let mut values = Vec::new();
        let mut stack: Vec<ExpressionId> = vec![at];
        while let Some(id) = stack.pop() {
            let node = self.spec.expressions.node(id);
            if let Node::Variable(v) = node {
                let name = &self.spec.variable(v).name;
                if values.len() < 6 && !values.iter().any(|(n, _)| n == name) {
                    values.push((
                        name.clone(),
                        integrator.field.frame.slot[self.tape.variables[v.index()]].value,
                    ));
                }
            }
            if stack.len() < 1000 {
                stack.extend(node.operands());
            }
        }
        let span = self.spec.expressions.span(at);
        let text = &self.spec.text;
        Some(SimulationError::NotANumber {
            time,
            expression: text
                .get(span.start..span.end)
                .unwrap_or("an expression")
                .to_owned(),
            line: 1 + text
                .get(..span.start)
                .map_or(0, |t| t.matches('\n').count()),
            values,
        })
    }

    /// Derivatives of the outputs along a run: for each output a column for each direction.
    pub fn sensitivities(
        &self,
        point: &Point,
        excitation: &Excitation,
        observer: Option<&Observer>,
        plan: &Plan,
        directions: &[Direction],
    ) -> Vec<Vec<Vec<f64>>> {
        let mut columns: Vec<Vec<Vec<f64>>> = vec![Vec::new(); self.tape.outputs.len()];
        let mut rest = directions;
        while !rest.is_empty() {
            let (now, later) = rest.split_at(rest.len().min(16));
            let part = match now.len() {
                1 => self.replay::<1>(point, excitation, observer, plan, now),
                2 => self.replay::<2>(point, excitation, observer, plan, now),
                3 | 4 => self.replay::<4>(point, excitation, observer, plan, now),
                5 | 6 => self.replay::<6>(point, excitation, observer, plan, now),
                7 | 8 => self.replay::<8>(point, excitation, observer, plan, now),
                9 | 10 => self.replay::<10>(point, excitation, observer, plan, now),
                11 | 12 => self.replay::<12>(point, excitation, observer, plan, now),
                _ => self.replay::<16>(point, excitation, observer, plan, now),
            };
            for (all, part) in columns.iter_mut().zip(part) {
                all.extend(part);
            }
            rest = later;
        }
        columns
    }

    fn replay<const M: usize>(
        &self,
        point: &Point,
        excitation: &Excitation,
        observer: Option<&Observer>,
        plan: &Plan,
        directions: &[Direction],
    ) -> Vec<Vec<Vec<f64>>> {
        let mut integrator = self.integrator::<M>(point, excitation, &plan.widths, directions);
        self.count(plan.steps.len() + excitation.length, 1 + M);
        let mut columns = vec![
            vec![Vec::with_capacity(excitation.length); directions.len()];
            self.tape.outputs.len()
        ];
        let mut steps = plan.steps.iter().copied();
        let mut scale: Vec<f64> = integrator.x.iter().map(|x| x.value.abs() * 1e-9).collect();
        for k in 0..excitation.length {
            integrator.sample(k, excitation);
            for (of_output, &slot) in columns.iter_mut().zip(&self.tape.outputs) {
                let slope = &integrator.field.frame.slot[slot].slope;
                of_output
                    .iter_mut()
                    .zip(slope)
                    .for_each(|(column, &s)| column.push(s));
            }
            integrator.correct(k, excitation, observer, &self.tape.outputs, directions);
            if k + 1 < excitation.length && !integrator.propagate(k, excitation) {
                for (s, x) in scale.iter_mut().zip(&integrator.x) {
                    *s = s.max(x.value.abs() * STEP_ACCURACY).max(f64::MIN_POSITIVE);
                }
                integrator.replay(k, excitation, &mut steps, &scale);
            }
        }
        columns
    }
}
