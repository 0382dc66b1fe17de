//! A plant linearised at a point.

use nalgebra::DMatrix;
use num_complex::Complex64;

use super::dual::Dual;
use super::field::LANES;
use super::plant::Plant;
use super::run::Point;
use super::tape::{Frame, Tape};

/// `dx/dt = A dx + B du`, `dy = C dx + D du` about a point, in continuous time.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearPlant {
    /// States by states.
    pub a: DMatrix<f64>,
    /// States by inputs.
    pub b: DMatrix<f64>,
    /// Outputs by states.
    pub c: DMatrix<f64>,
    /// Outputs by inputs.
    pub d: DMatrix<f64>,
    /// Derivatives of the states at the point: 0 at an equilibrium.
    pub derivative: Vec<f64>,
    /// Outputs at the point.
    pub output: Vec<f64>,
}

impl LinearPlant {
    /// `C (s I - A)^-1 B + D`, outputs by inputs; not a number at a pole.
    pub fn response(&self, s: Complex64) -> DMatrix<Complex64> {
        let complex = |m: &DMatrix<f64>| m.map(|v| Complex64::new(v, 0.0));
        let n = self.a.nrows();
        if n == 0 {
            return complex(&self.d);
        }
        let resolvent = DMatrix::from_diagonal_element(n, n, s) - complex(&self.a);
        match resolvent.lu().solve(&complex(&self.b)) {
            Some(states) => complex(&self.c) * states + complex(&self.d),
            None => complex(&self.d).map(|_| Complex64::new(f64::NAN, f64::NAN)),
        }
    }

    /// The same of the system sampled every `sample_time` with its inputs held, at `w` rad/s.
    pub(crate) fn sampled_response(&self, w: f64, sample_time: f64) -> DMatrix<Complex64> {
        let (a, b) = self.discrete(sample_time);
        let sampled = Self {
            a,
            b,
            ..self.clone()
        };
        sampled.response(Complex64::from_polar(1.0, w * sample_time))
    }

    /// `A` and `B` of the system sampled every `sample_time` with its inputs held.
    pub(crate) fn discrete(&self, sample_time: f64) -> (DMatrix<f64>, DMatrix<f64>) {
        let (n, m) = (self.a.nrows(), self.b.ncols());
        let mut both = DMatrix::zeros(n + m, n + m);
        both.view_mut((0, 0), (n, n))
            .copy_from(&(&self.a * sample_time));
        both.view_mut((0, n), (n, m))
            .copy_from(&(&self.b * sample_time));
        let e = both.exp();
        (
            e.view((0, 0), (n, n)).into_owned(),
            e.view((0, n), (n, m)).into_owned(),
        )
    }
}

/// Linearises a plant at many points.
pub(crate) struct Lineariser {
    tape: Tape,
    frame: Frame<LANES>,
    /// Values of the memories at the last point.
    memories: Vec<f64>,
}

impl Lineariser {
    /// About a state, inputs and a time; what is delayed has the value that it has now, and the sample before is the last
    /// point.
    pub(crate) fn at(&mut self, state: &[f64], inputs: &[f64], time: f64) -> LinearPlant {
        let Self {
            tape,
            frame,
            memories,
        } = self;
        for (memory, &value) in tape.memories.iter().zip(&*memories) {
            frame.slot[memory.previous] = Dual::constant(value);
        }
        let (n, m, l) = (tape.states.len(), tape.inputs.len(), tape.outputs.len());
        let mut whole = DMatrix::zeros(n + l, n + m);
        frame.slot[tape.time] = Dual::constant(time);
        let sources: Vec<(usize, f64)> = tape
            .states
            .iter()
            .zip(state)
            .chain(tape.inputs.iter().zip(inputs))
            .map(|(&slot, &value)| (slot, value))
            .collect();
        for first in (0..(n + m).max(1)).step_by(LANES) {
            for (i, &(slot, value)) in sources.iter().enumerate() {
                frame.slot[slot] = Dual::constant(value);
                if (first..first + LANES).contains(&i) {
                    frame.slot[slot].slope[i - first] = 1.0;
                }
            }
            tape.run_inputs(frame);
            // A delayed value is found by the sweep itself; as many sweeps as there are delays settle a chain of them.
            for _ in 0..=tape.delays.len() {
                tape.run_states(frame);
                for delay in &tape.delays {
                    frame.slot[delay.result] = frame.slot[delay.value];
                }
            }
            tape.run_outputs(frame);
            for (row, &slot) in tape.derivatives.iter().chain(&tape.outputs).enumerate() {
                for column in first..(first + LANES).min(n + m) {
                    whole[(row, column)] = frame.slot[slot].slope[column - first];
                }
            }
        }
        for (memory, value) in tape.memories.iter().zip(memories) {
            *value = frame.slot[memory.value].value;
        }
        LinearPlant {
            a: whole.view((0, 0), (n, n)).into_owned(),
            b: whole.view((0, n), (n, m)).into_owned(),
            c: whole.view((n, 0), (l, n)).into_owned(),
            d: whole.view((n, n), (l, m)).into_owned(),
            derivative: tape
                .derivatives
                .iter()
                .map(|&s| frame.slot[s].value)
                .collect(),
            output: tape.outputs.iter().map(|&s| frame.slot[s].value).collect(),
        }
    }
}

impl Plant {
    /// Made ready to be linearised with the parameters of `point`.
    pub(crate) fn lineariser(&self, point: &Point) -> Lineariser {
        let tape = Tape::with_active_inputs(&self.spec);
        let mut frame: Frame<LANES> = tape.frame();
        for (&slot, &value) in tape.parameters.iter().zip(&point.parameters) {
            frame.slot[slot] = Dual::constant(value);
        }
        tape.run_parameters(&mut frame);
        let start = tape.memories.iter().map(|m| frame.slot[m.start].value);
        let memories = start.collect();
        Lineariser {
            tape,
            frame,
            memories,
        }
    }

    /// Linearises at a state, inputs and a time.
    pub fn linearise(
        &self,
        point: &Point,
        state: &[f64],
        inputs: &[f64],
        time: f64,
    ) -> LinearPlant {
        self.lineariser(point).at(state, inputs, time)
    }

    /// A state at which nothing moves with these inputs, found by Newton's method from `state`; none when there is none nearby.
    pub fn equilibrium(&self, point: &Point, state: &[f64], inputs: &[f64]) -> Option<Vec<f64>> {
        const STEPS: usize = 50;
        // The decomposition needs squares of the elements, and has no answer where one is not a number.
        const LARGEST: f64 = 1e150;
        const ITERATIONS: usize = 1000;
        let mut x = state.to_vec();
        for _ in 0..STEPS {
            let linear = self.linearise(point, &x, inputs, 0.0);
            // Neither a slope of infinity (a root at 0) nor a derivative without value leads anywhere.
            if !linear
                .a
                .iter()
                .chain(&linear.derivative)
                .all(|v| v.is_finite())
            {
                return None;
            }
            let right = nalgebra::DVector::from_vec(linear.derivative.clone());
            let sound = |v: &f64| v.abs() < LARGEST;
            if !linear.a.iter().all(sound) || !right.iter().all(sound) {
                return None;
            }
            let parts = linear.a.try_svd(true, true, f64::EPSILON, ITERATIONS)?;
            let step = parts.solve(&right, 1e-12).ok()?;
            if !step.iter().all(|s| s.is_finite()) {
                return None;
            }
            x.iter_mut().zip(step.iter()).for_each(|(x, s)| *x -= s);
            // Each state on its own scale: beside a pressure in Pa no temperature would ever move.
            let size: Vec<f64> = x
                .iter()
                .zip(state)
                .map(|(x, s)| x.abs().max(s.abs()).max(1.0))
                .collect();
            if step
                .iter()
                .zip(&size)
                .all(|(s, size)| s.abs() <= 1e-10 * size)
            {
                let end = self.linearise(point, &x, inputs, 0.0);
                let at_rest = |(i, d): (usize, &f64)| {
                    let row = end.a.row(i);
                    let scale: f64 = row
                        .iter()
                        .zip(&size)
                        .map(|(a, size)| (a * size).abs())
                        .sum();
                    d.abs() <= 1e-8 * scale
                };
                return end.derivative.iter().enumerate().all(at_rest).then_some(x);
            }
        }
        None
    }
}
