//! The right-hand side of a plant at an instant: inputs as they are held, delays, one sweep of the tape.

use super::dual::Dual;
use super::run::{Excitation, Hold};
use super::tape::{Frame, Tape};

/// Columns of a Jacobian that are computed in one sweep.
pub(super) const LANES: usize = 8;

/// What a delayed expression was, for one `delay`.
#[derive(Debug, Clone)]
enum Past<const M: usize> {
    /// Its value at every sample: it depends on inputs only.
    Series(Vec<Dual<M>>),
    /// Its value at every step so far.
    History(Vec<(f64, Dual<M>)>),
}

/// Right-hand side with its inputs.
pub(super) struct Field<'a, const M: usize> {
    pub(super) tape: &'a Tape,
    pub(super) frame: Frame<M>,
    jacobian: Frame<LANES>,
    excitation: &'a Excitation<'a>,
    sample: usize,
    /// False until the frame of the Jacobian has the inputs of now.
    inputs_in_jacobian: bool,
    past: Vec<Past<M>>,
    /// For each memory its value at the sample before each.
    previous: Vec<Vec<Dual<M>>>,
    /// When each delayed input jumps within a sample, and in which order they do.
    jumps: Vec<Jump<M>>,
    /// Sample whose held value a delayed input has now, for each delay.
    source: Vec<usize>,
}

/// A delay of an input, in samples: the delayed value jumps at `phase`, to that of `whole` samples ago.
#[derive(Debug, Clone)]
struct Jump<const M: usize> {
    whole: usize,
    phase: Dual<M>,
    /// Number of jumps up to it.
    rank: usize,
}

/// A delay this close to whole samples is one but for rounding.
const WHOLE: f64 = 1e-9;

impl<'a, const M: usize> Field<'a, M> {
    /// `frame` has parameters with their slopes.
    pub(crate) fn new(tape: &'a Tape, mut frame: Frame<M>, excitation: &'a Excitation<'a>) -> Self {
        tape.run_parameters(&mut frame);
        let mut jacobian = tape.frame::<LANES>();
        jacobian.width.clone_from(&frame.width);
        for &p in &tape.parameters {
            jacobian.slot[p].value = frame.slot[p].value;
        }
        tape.run_parameters(&mut jacobian);
        let mut field = Self {
            tape,
            frame,
            jacobian,
            excitation,
            sample: 0,
            inputs_in_jacobian: false,
            past: Vec::new(),
            previous: Vec::new(),
            jumps: Vec::new(),
            source: Vec::new(),
        };
        field.jumps = field.jumps();
        field.source = vec![0; tape.delays.len()];
        field.previous = field.memories();
        field.past = field.pasts();
        field
    }

    /// Values of the memories, one sample after the other: they depend on inputs and on their past only.
    fn memories(&mut self) -> Vec<Vec<Dual<M>>> {
        let tape = self.tape;
        let mut all = vec![Vec::with_capacity(self.excitation.samples()); tape.memories.len()];
        if tape.memories.is_empty() {
            return all;
        }
        for k in 0..self.excitation.samples() {
            for (all, memory) in all.iter_mut().zip(&tape.memories) {
                let last = if k == 0 { memory.start } else { memory.value };
                all.push(self.frame.slot[last]);
            }
            for (all, memory) in all.iter().zip(&tape.memories) {
                self.frame.slot[memory.previous] = all[k];
            }
            self.begin(k);
        }
        all
    }

    /// Values of the arguments of delays that depend on inputs only.
    fn pasts(&mut self) -> Vec<Past<M>> {
        let tape = self.tape;
        let mut past: Vec<_> = tape
            .delays
            .iter()
            .map(|d| {
                if d.of_inputs {
                    Past::Series(Vec::new())
                } else {
                    Past::History(Vec::new())
                }
            })
            .collect();
        if tape.delays.iter().any(|d| d.of_inputs) {
            for k in 0..self.excitation.samples() {
                self.begin(k);
                for (past, delay) in past.iter_mut().zip(&tape.delays) {
                    if let Past::Series(values) = past {
                        values.push(self.frame.slot[delay.value]);
                    }
                }
            }
        }
        past
    }

    /// Takes the inputs of a sample.
    pub(crate) fn begin(&mut self, sample: usize) {
        self.sample = sample;
        self.inputs(0.0);
    }

    /// Inputs at a fraction of the sample.
    fn inputs(&mut self, fraction: f64) {
        let next = (self.sample + 1).min(self.excitation.samples() - 1);
        for (&slot, column) in self.tape.inputs.iter().zip(self.excitation.inputs) {
            let value = column[self.sample] + fraction * (column[next] - column[self.sample]);
            self.frame.slot[slot].value = value;
        }
        for (all, memory) in self.previous.iter().zip(&self.tape.memories) {
            self.frame.slot[memory.previous] = all[self.sample];
        }
        self.tape.run_inputs(&mut self.frame);
        self.inputs_in_jacobian = false;
    }

    fn jumps(&self) -> Vec<Jump<M>> {
        let jump = |slot: usize| {
            let mut phase = self.frame.slot[slot];
            let slopes = phase.slope.iter_mut();
            slopes.for_each(|s| *s /= self.excitation.sample_time);
            let samples = (phase.value / self.excitation.sample_time).max(0.0);
            let whole = (samples + WHOLE).floor();
            phase.value = (samples - whole).max(0.0);
            Jump {
                whole: whole as usize,
                phase,
                rank: 0,
            }
        };
        let mut jumps: Vec<Jump<M>> = self.tape.delays.iter().map(|d| jump(d.time)).collect();
        let mut order: Vec<usize> = (0..jumps.len())
            .filter(|&i| self.tape.delays[i].of_inputs)
            .collect();
        order.sort_by(|&a, &b| jumps[a].phase.value.total_cmp(&jumps[b].phase.value));
        for (before, i) in order.into_iter().enumerate() {
            jumps[i].rank = before + 1;
        }
        jumps
    }

    /// Parts of a sample in which every delayed input is constant: start and length, in seconds. Delays of whole samples, or
    /// equal ones, make parts of length 0, whose slopes count.
    pub(crate) fn parts(&self) -> Vec<(Dual<M>, Dual<M>)> {
        let mut jumps: Vec<&Jump<M>> = self.jumps.iter().filter(|j| j.rank > 0).collect();
        jumps.sort_by_key(|j| j.rank);
        let mut boundaries = vec![Dual::constant(0.0)];
        boundaries.extend(jumps.into_iter().map(|j| j.phase));
        boundaries.push(Dual::constant(1.0));
        let h = self.excitation.sample_time;
        let zero = Dual::constant(0.0);
        let pairs = boundaries.windows(2);
        pairs
            .map(|w| (zero.plus(h, &w[0]), zero.plus(h, &w[1]).plus(-h, &w[0])))
            .collect()
    }

    /// Chooses the sample that each delayed input comes from: for a part between two boundaries, or at the sample itself.
    pub(crate) fn part(&mut self, part: Option<usize>) {
        for (source, jump) in self.source.iter_mut().zip(&self.jumps) {
            let jumped = part.map_or(jump.phase.value == 0.0, |part| jump.rank <= part);
            *source = self
                .sample
                .saturating_sub(jump.whole + usize::from(!jumped));
        }
    }

    /// Derivatives of the states at a sample; the frame then holds all values.
    pub(crate) fn evaluate_all(
        &mut self,
        time: &Dual<M>,
        x: &[Dual<M>],
        derivative: &mut [Dual<M>],
    ) {
        self.evaluate(time, x, derivative);
        self.tape.run_outputs(&mut self.frame);
    }

    /// Derivatives of the states at an instant; the frame then holds the values that they use.
    pub(crate) fn evaluate(&mut self, time: &Dual<M>, x: &[Dual<M>], derivative: &mut [Dual<M>]) {
        self.place(time);
        for (&slot, x) in self.tape.states.iter().zip(x) {
            self.frame.slot[slot] = *x;
        }
        self.tape.run_states(&mut self.frame);
        for (&slot, d) in self.tape.derivatives.iter().zip(derivative) {
            *d = self.frame.slot[slot];
        }
    }

    /// Time, inputs and delayed values of an instant.
    fn place(&mut self, time: &Dual<M>) {
        self.frame.slot[self.tape.time] = *time;
        if self.excitation.hold == Hold::Linear {
            self.inputs(self.excitation.fraction(self.sample, time.value));
        }
        for (i, delay) in self.tape.delays.iter().enumerate() {
            let lag = self.frame.slot[delay.time];
            let at = time.plus(-1.0, &lag);
            self.frame.slot[delay.result] = match &self.past[i] {
                Past::Series(values) if values.is_empty() => Dual::constant(0.0),
                Past::Series(values) => self.excitation.between(values, self.source[i], &at),
                Past::History(steps) => interpolate(steps, &at),
            };
        }
    }

    /// Derivatives of the states and their Jacobian (by rows) at an instant, without the slopes in the `M` directions.
    pub(crate) fn linearise(
        &mut self,
        time: &Dual<M>,
        x: &[f64],
        derivative: &mut [f64],
        jacobian: &mut [f64],
    ) {
        let tape = self.tape;
        self.linearise_slots(time, x, (&tape.derivatives, false), derivative, jacobian);
    }

    /// Outputs and their Jacobian by the states, likewise.
    pub(crate) fn linearise_outputs(
        &mut self,
        time: &Dual<M>,
        x: &[f64],
        value: &mut [f64],
        jacobian: &mut [f64],
    ) {
        let tape = self.tape;
        self.linearise_slots(time, x, (&tape.outputs, true), value, jacobian);
    }

    fn linearise_slots(
        &mut self,
        time: &Dual<M>,
        x: &[f64],
        (slots, shown): (&[usize], bool),
        value: &mut [f64],
        jacobian: &mut [f64],
    ) {
        self.place(time);
        let n = x.len();
        let (tape, frame) = (self.tape, &mut self.jacobian);
        frame.slot[tape.time].value = time.value;
        if !self.inputs_in_jacobian {
            for &slot in &tape.inputs {
                frame.slot[slot].value = self.frame.slot[slot].value;
            }
            for memory in &tape.memories {
                frame.slot[memory.previous].value = self.frame.slot[memory.previous].value;
            }
            tape.run_inputs(frame);
            self.inputs_in_jacobian = true;
        }
        for delay in &tape.delays {
            frame.slot[delay.result] = Dual::constant(self.frame.slot[delay.result].value);
        }
        for first in (0..n).step_by(LANES) {
            for (i, (&slot, &x)) in tape.states.iter().zip(x).enumerate() {
                let mut dual = Dual::constant(x);
                if (first..first + LANES).contains(&i) {
                    dual.slope[i - first] = 1.0;
                }
                frame.slot[slot] = dual;
            }
            tape.run_states(frame);
            if shown {
                tape.run_outputs(frame);
            }
            for (row, &slot) in slots.iter().enumerate() {
                value[row] = frame.slot[slot].value;
                for column in first..(first + LANES).min(n) {
                    jacobian[row * n + column] = frame.slot[slot].slope[column - first];
                }
            }
        }
    }

    /// Keeps the delayed expressions of states at the end of a step.
    pub(crate) fn remember(&mut self, time: f64) {
        for (past, delay) in self.past.iter_mut().zip(&self.tape.delays) {
            if let Past::History(steps) = past {
                steps.push((time, self.frame.slot[delay.value]));
            }
        }
    }

    /// True when a delayed expression of states must be kept at every step.
    pub(crate) fn remembers(&self) -> bool {
        self.tape.delays.iter().any(|d| !d.of_inputs)
    }

    /// The shortest delay of an expression of states: no step may be longer.
    pub(crate) fn shortest_delay(&self) -> f64 {
        let of_states = self.tape.delays.iter().filter(|d| !d.of_inputs);
        of_states
            .map(|d| self.frame.slot[d.time].value)
            .fold(f64::INFINITY, f64::min)
    }

    /// Argument of each switch now.
    pub(crate) fn switches(&self, into: &mut Vec<f64>) {
        into.clear();
        into.extend(self.tape.switches.iter().map(|s| self.frame.switch(s)));
    }
}

/// Value at `at` between the steps so far, by the cubic through the four nearest; before the first step its value.
fn interpolate<const M: usize>(steps: &[(f64, Dual<M>)], at: &Dual<M>) -> Dual<M> {
    let (Some(first), Some(last)) = (steps.first(), steps.last()) else {
        return Dual::constant(0.0);
    };
    if at.value <= first.0 {
        return first.1;
    }
    if at.value >= last.0 {
        return last.1;
    }
    let after = steps.partition_point(|s| s.0 <= at.value);
    let from = after.saturating_sub(2).min(steps.len().saturating_sub(4));
    let near = &steps[from..(from + 4).min(steps.len())];
    let mut sum = Dual::constant(0.0);
    let mut rate = 0.0;
    for (i, a) in near.iter().enumerate() {
        let others = || {
            near.iter()
                .enumerate()
                .filter(move |&(j, b)| j != i && b.0 != a.0)
                .map(|(_, b)| b.0)
        };
        let weight: f64 = others().map(|b| (at.value - b) / (a.0 - b)).product();
        let below: f64 = others().map(|b| a.0 - b).product();
        let slope: f64 = others()
            .enumerate()
            .map(|(skip, _)| {
                others()
                    .enumerate()
                    .filter(|&(j, _)| j != skip)
                    .map(|(_, b)| at.value - b)
                    .product::<f64>()
            })
            .sum();
        sum = sum.plus(weight, &a.1);
        rate += slope / below * a.1.value;
    }
    for (s, a) in sum.slope.iter_mut().zip(&at.slope) {
        *s += rate * a;
    }
    sum
}
