//! Equations compiled to a flat tape: one sweep gives values and forward derivatives.
//!
//! Each instruction writes the slot behind it, so that the tape is in single-assignment form. Instructions are sorted by what
//! they depend on: parameters only (once a run), inputs (once a sample while inputs are held), states and time (each
//! evaluation); what only outputs use comes last (once a sample). A sweep carries `M` derivatives beside each value; what depends on no state and no parameter carries none.
//!
//! Discontinuous switches (`sign`, comparisons) are ramps of a width that the caller sets. A ramp that the integrator resolves
//! makes the derivative of the time of a switch part of the ordinary forward derivative, and sticking an ordinary stiff
//! equation.

mod compile;
mod execute;
mod straight_pieces;

use pulp::Arch;

use self::execute::execute;
use super::dual::Dual;
use crate::physics::expression::{Binary, ExpressionId, Function};

/// What an instruction does with its operands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Operation {
    Negate,
    Not,
    Call(Function),
    Binary(Binary),
    /// Integer power.
    PowerInteger(i32),
    /// `sign(a)` as a ramp; index of the switch.
    Sign(u32),
    /// Comparison as a ramp; index of the switch.
    Switch {
        index: u32,
        /// `a < b` instead of `a > b`.
        less: bool,
        /// Whether equal operands satisfy it.
        equal: bool,
    },
    /// `if a then b else c`
    If,
    /// A curve of straight pieces at `a`; its index.
    Curve(u32),
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Instruction {
    pub(super) operation: Operation,
    pub(super) a: u32,
    pub(super) b: u32,
    pub(super) c: u32,
    /// Whether each operand, and so the result, can have a derivative.
    pub(super) active: [bool; 3],
}

/// A curve of straight pieces.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CurveSlots {
    knots: Vec<f64>,
    /// Slots of the values at the knots.
    values: Vec<u32>,
}

/// What a slot depends on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Level {
    Parameters,
    Inputs,
    States,
    /// States too, and no derivative uses it.
    Outputs,
}

/// An argument of `delay`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct DelaySlots {
    /// What is delayed.
    pub(super) value: usize,
    /// By how long.
    pub(super) time: usize,
    /// Where the delayed value is put.
    pub(super) result: usize,
    /// True when what is delayed depends on inputs and parameters only.
    pub(super) of_inputs: bool,
}

/// A variable whose value at the sample before is used.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct MemorySlots {
    /// Its value.
    pub(super) value: usize,
    /// Where that of the sample before is put.
    pub(super) previous: usize,
    /// Its value before the first sample.
    pub(super) start: usize,
}

/// Equations as a flat program.
#[derive(Debug, Clone)]
pub(super) struct Tape {
    instructions: Vec<Instruction>,
    curves: Vec<CurveSlots>,
    /// Instructions of the processor for several numbers at once.
    pub(super) arch: Arch,
    /// Expression each slot computes, for messages.
    sources: Vec<Option<ExpressionId>>,
    /// First instruction of each level but `Parameters`.
    bounds: [usize; 3],
    leaves: usize,
    literals: Vec<(u32, f64)>,
    pub(super) time: usize,
    pub(super) states: Vec<usize>,
    pub(super) inputs: Vec<usize>,
    pub(super) parameters: Vec<usize>,
    /// Slots of derivatives, outputs and start values, in the order of the states, outputs and states.
    pub(super) derivatives: Vec<usize>,
    pub(super) outputs: Vec<usize>,
    pub(super) starts: Vec<usize>,
    /// Slots of the values that the text gives to the parameters.
    pub(super) nominal: Vec<usize>,
    pub(super) delays: Vec<DelaySlots>,
    pub(super) memories: Vec<MemorySlots>,
    /// Slot of every variable.
    pub(super) variables: Vec<usize>,
    /// Operand slots of each switch whose argument depends on states or time, and whether it depends on states.
    pub(super) switches: Vec<SwitchSlots>,
}

/// A discontinuity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SwitchSlots {
    pub(super) a: usize,
    /// None for `sign`.
    pub(super) b: Option<usize>,
    /// False when it depends on parameters, inputs or time only.
    pub(super) of_states: bool,
    /// True when it changes within a sample.
    pub(super) moves: bool,
}

/// Values of all slots with `M` derivatives each.
#[derive(Debug, Clone)]
pub(super) struct Frame<const M: usize> {
    pub(super) slot: Vec<Dual<M>>,
    /// Half width of the ramp of each switch; 0 is a jump.
    pub(super) width: Vec<f64>,
}

impl<const M: usize> Frame<M> {
    /// Argument of a switch.
    pub(crate) fn switch(&self, s: &SwitchSlots) -> f64 {
        self.slot[s.a].value - s.b.map_or(0.0, |b| self.slot[b].value)
    }
}

impl Tape {
    /// Instructions of a level, without those of the levels before.
    fn part(&self, level: Level) -> std::ops::Range<usize> {
        match level {
            Level::Parameters => 0..self.bounds[0],
            Level::Inputs => self.bounds[0]..self.bounds[1],
            Level::States => self.bounds[1]..self.bounds[2],
            Level::Outputs => self.bounds[2]..self.instructions.len(),
        }
    }

    /// How many instructions the derivatives take.
    pub(crate) fn operations(&self) -> usize {
        self.part(Level::States).len()
    }

    /// A frame with literals set and no derivative.
    pub(crate) fn frame<const M: usize>(&self) -> Frame<M> {
        let slots = self.leaves + self.instructions.len();
        let mut frame = Frame {
            slot: vec![Dual::constant(0.0); slots],
            width: vec![0.0; self.switches.len()],
        };
        for &(slot, value) in &self.literals {
            frame.slot[slot as usize].value = value;
        }
        frame
    }

    /// What depends on parameters only.
    pub(crate) fn run_parameters<const M: usize>(&self, frame: &mut Frame<M>) {
        self.run(self.part(Level::Parameters), frame);
    }

    /// What depends on inputs and parameters only.
    pub(crate) fn run_inputs<const M: usize>(&self, frame: &mut Frame<M>) {
        self.run(self.part(Level::Inputs), frame);
    }

    /// Derivatives and what they use.
    pub(crate) fn run_states<const M: usize>(&self, frame: &mut Frame<M>) {
        self.run(self.part(Level::States), frame);
    }

    /// All else.
    pub(crate) fn run_outputs<const M: usize>(&self, frame: &mut Frame<M>) {
        self.run(self.part(Level::Outputs), frame);
    }

    /// The first expression that is not finite although its operands are: where a calculation goes wrong.
    pub(crate) fn culprit<const M: usize>(&self, frame: &Frame<M>) -> Option<ExpressionId> {
        self.instructions.iter().enumerate().find_map(|(i, x)| {
            let slot = self.leaves + i;
            let operands = match x.operation {
                Operation::If => [x.a, x.b, x.c],
                Operation::Binary(_) | Operation::Switch { .. } => [x.a, x.b, x.a],
                _ => [x.a; 3],
            };
            let sound = operands
                .iter()
                .all(|&o| frame.slot[o as usize].value.is_finite());
            (sound && !frame.slot[slot].value.is_finite())
                .then_some(self.sources[slot])
                .flatten()
        })
    }

    fn run<const M: usize>(&self, range: std::ops::Range<usize>, frame: &mut Frame<M>) {
        if M < 2 {
            return self.sweep(range, frame);
        }
        self.arch.dispatch(
            #[inline(always)]
            || self.sweep(range, frame),
        );
    }

    #[inline(always)]
    fn sweep<const M: usize>(&self, range: std::ops::Range<usize>, frame: &mut Frame<M>) {
        let first = self.leaves + range.start;
        for (i, x) in self.instructions[range].iter().enumerate() {
            frame.slot[first + i] = execute(x, frame, &self.curves);
        }
    }
}
