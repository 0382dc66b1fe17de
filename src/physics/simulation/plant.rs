//! Simulation of a plant with sensitivities.
//!
//! A run without slopes chooses the steps within each sample. Slopes ([`Plant::sensitivities`]) are those of the same steps, so
//! that they are the derivatives of what [`Plant::simulate`] computes.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use super::dual::Dual;
use super::field::Field;
use super::integrator::Integrator;
use super::linear::{Linearity, Propagator};
use super::run::{Direction, Excitation, Observer, Plan, Point, Trajectory};
use super::step::Stages;
use super::step_control::{STEP_ACCURACY, StepControl};
use super::tape::Tape;
use crate::physics::expression::{ExpressionId, Node};
use crate::physics::spec::ModelSpec;

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
