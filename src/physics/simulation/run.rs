//! What a run takes and gives: inputs, values of parameters and states, an observer; steps, outputs and states.

use nalgebra::DMatrix;

use super::dual::Dual;
use super::integrator::IMPLICIT;
use super::step_control::IMPLICIT_COST;

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
    /// One for each parameter, in the order of [`ModelSpec::parameters`](crate::physics::ModelSpec::parameters).
    pub parameters: Vec<f64>,
    /// One for each state; `None` takes the start value of the text.
    pub start: Vec<Option<f64>>,
}

/// What outputs are differentiated by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// A parameter, by its place in [`ModelSpec::parameters`](crate::physics::ModelSpec::parameters).
    Parameter(usize),
    /// The initial value of a state, by its place in [`ModelSpec::states`](crate::physics::ModelSpec::states).
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
