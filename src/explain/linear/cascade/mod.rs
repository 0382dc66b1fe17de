//! Two tanks in cascade: a pump fills the upper one, which empties into the lower one, whose level is recorded.
//!
//! Levels `x1`, `x2` are in units of the output, flows in units of the output a sample. Both are scaled such that
//! what leaves the upper tank enters the lower one with gain 1, so no area appears:
//!
//! ```text
//! dx1/dt = max(b u + w, 0) - a sqrt(x1) - over        x1 <= h1, over = what does not fit
//! dx2/dt = a sqrt(x1) + g over + q - d sqrt(x2)       0 <= x2 <= h2, what does not fit is lost
//! y      = x2
//! ```
//!
//! `sqrt` is Torricelli's law of a free outflow. Each rim (`h1` with the share `0 <= g <= 1` of the overflow that
//! falls into the lower tank; `h2`) and the constant inflow `q` can be absent. The bias `w` of the pump is present
//! only when the input takes negative values, and says where the pump stops.
//!
//! **Two steps a sample.** An outflow is solved exactly (`sqrt(x)` falls linearly in time) for half a step, then the
//! inflow of the step is added, then comes the other half (Strang's splitting: second order, and at any step size the
//! levels stay positive and grow with what flows in; a tank faster than a step passes its inflow on). What left a tank
//! is found from its balance. A step that ends above the upper rim is cut where its chord crosses the rim; from there
//! on the tank is full, and what the pump brings beyond `a sqrt(h1)` is `over`. Rims limit the *state*, not the gauge.
//!
//! **Why a constant is needed.** `sqrt` has a physical zero, and no recording has exactly that one: a gauge reads
//! from somewhere above the hole, the hole is below the floor, the pump delivers nothing up to some voltage. To
//! first order all of these shift one balance, so one number serves, and `q` (of either sign) makes the easiest
//! search. That it is needed does not say which of them it is:
//!
//! | mimics | what tells it apart |
//! |---|---|
//! | a pump dead up to a voltage, an offset of the gauge, another exponent of the outflow | all act like `q`: stop the pump and watch how a tank empties to the end |
//! | a sensor that saturates (for the lower rim) | the sensor stays at its limit until the level is back; a tank at its rim falls at once |
//! | an input that saturates (for the upper rim) | the rim acts only once the upper tank is full, so a short burst passes; part of it arrives without the lag |
//! | a linear outflow | has one time constant; here they grow as the square root of the level |
//! | the same tanks in the other order | the same to first order, for small flows; large ones tell |
//! | a plant of higher order | does not depend on the level |

mod applies;
mod fit_cascade;
mod jet;
mod select_parts;
mod starting_values;
#[cfg(test)]
mod tests;

use std::ops::{Add, Mul, Sub};

#[cfg(test)]
pub(crate) use select_parts::Losses;
pub(crate) use select_parts::{CascadeFit, fit};

/// The numbers of a cascade, by what they are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Number {
    /// `b`: flow a unit of input.
    Pump,
    /// `a`: outflow of the upper tank at level 1.
    UpperOutflow,
    /// `d`: outflow of the lower tank at level 1.
    LowerOutflow,
    /// `h1`: level at which the upper tank overflows.
    UpperRim,
    /// `g`: share of that overflow which falls into the lower tank.
    Share,
    /// `h2`: level at which the lower tank overflows.
    LowerRim,
    /// `q`: constant inflow of the lower tank.
    Inflow,
    /// `w`: flow of the pump at input 0.
    Bias,
}

/// Steps a sample. With one, tanks of less than a sample ask for an overflow they do not have (test `one_fast_tank`).
const SUBSTEPS: usize = 2;
/// How many numbers there are.
const NUMBERS: usize = 8;

impl Number {
    pub(crate) const ALL: [Self; NUMBERS] = [
        Self::Pump,
        Self::UpperOutflow,
        Self::LowerOutflow,
        Self::UpperRim,
        Self::Share,
        Self::LowerRim,
        Self::Inflow,
        Self::Bias,
    ];

    /// Positive, and searched as a logarithm: its size is unknown by decades.
    fn positive(self) -> bool {
        !matches!(self, Self::Share | Self::Inflow | Self::Bias)
    }

    /// The powers of the units of (input, output) in this number.
    fn powers(self, law: Law) -> (f64, f64) {
        match self {
            Self::Pump => (-1.0, 1.0),
            Self::UpperOutflow | Self::LowerOutflow => match law {
                Law::Root => (0.0, 0.5),
                Law::Linear => (0.0, 0.0),
            },
            Self::Share => (0.0, 0.0),
            Self::UpperRim | Self::LowerRim | Self::Inflow | Self::Bias => (0.0, 1.0),
        }
    }
}

/// How outflow depends on the level.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Law {
    /// Torricelli.
    Root,
    /// Proportional to the level: what the root is measured against.
    Linear,
}

/// Which parts are present.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Parts {
    pub(crate) law: Law,
    pub(crate) upper_overflow: bool,
    pub(crate) lower_overflow: bool,
    pub(crate) constant_inflow: bool,
    pub(crate) pump_bias: bool,
}

impl Parts {
    /// Whether a number belongs to what is present.
    pub(crate) fn has(self, number: Number) -> bool {
        match number {
            Number::Pump | Number::UpperOutflow | Number::LowerOutflow => true,
            Number::UpperRim | Number::Share => self.upper_overflow,
            Number::LowerRim => self.lower_overflow,
            Number::Inflow => self.constant_inflow,
            Number::Bias => self.pump_bias,
        }
    }

    /// Whether everything here is also in `other`.
    fn within(self, other: Self) -> bool {
        self.law == other.law && Number::ALL.iter().all(|n| !self.has(*n) || other.has(*n))
    }
}

/// A cascade of two tanks. Numbers whose part is absent are ignored (those of a fit are 0).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cascade {
    pub(crate) parts: Parts,
    pub(crate) numbers: [f64; NUMBERS],
}

impl Cascade {
    pub(crate) fn number(&self, number: Number) -> f64 {
        self.numbers[number as usize]
    }

    fn set(&mut self, number: Number, value: f64) {
        self.numbers[number as usize] = value;
    }

    /// Output at each sample of the input, from the levels `initial` at the first.
    pub(crate) fn simulate(&self, input: &[f64], initial: [f64; 2]) -> Vec<f64> {
        let mut output = Vec::with_capacity(input.len());
        self.walk(&self.numbers, input, initial, |[_, x2]| output.push(x2));
        output
    }

    /// Both levels at each sample.
    pub(crate) fn levels(&self, input: &[f64], initial: [f64; 2]) -> Vec<[f64; 2]> {
        let mut levels = Vec::with_capacity(input.len());
        self.walk(&self.numbers, input, initial, |x| levels.push(x));
        levels
    }

    /// Shows `visit` the levels at each sample; `numbers` stand in for those of `self`, to carry derivatives.
    fn walk<Q: Quantity>(
        &self,
        numbers: &[Q; NUMBERS],
        input: &[f64],
        initial: [Q; 2],
        mut visit: impl FnMut([Q; 2]),
    ) {
        let of = |n: Number| numbers[n as usize];
        let upper = Drain::new(self.parts.law, of(Number::UpperOutflow));
        let lower = Drain::new(self.parts.law, of(Number::LowerOutflow));
        let (upper_rim, lower_rim) = (of(Number::UpperRim), of(Number::LowerRim));
        let full = upper.rate(upper_rim);
        let step = 1.0 / SUBSTEPS as f64;
        let [mut x1, mut x2] = initial;
        if self.parts.upper_overflow && x1.value() > upper_rim.value() {
            x1 = upper_rim;
        }
        for u in input {
            visit([x1, x2]);
            let mut flow = of(Number::Pump).times(*u);
            if self.parts.pump_bias {
                flow = flow + of(Number::Bias);
            }
            let flow = flow.at_least_zero().times(step);
            for _ in 0..SUBSTEPS {
                let mut raised = upper.half(upper.half(x1) + flow);
                let mut over = None;
                if self.parts.upper_overflow && raised.value() > upper_rim.value() {
                    let after = (raised - upper_rim) * (raised - x1).inverse();
                    over = Some((after * (flow - full.times(step))).at_least_zero());
                    raised = upper_rim;
                }
                let mut arriving = x1 + flow - raised;
                if let Some(over) = over {
                    arriving = arriving - over + of(Number::Share) * over;
                }
                x1 = raised;
                if self.parts.constant_inflow {
                    arriving = arriving + of(Number::Inflow).times(step);
                }
                x2 = lower.half((lower.half(x2) + arriving).at_least_zero());
                if self.parts.lower_overflow && x2.value() > lower_rim.value() {
                    x2 = lower_rim;
                }
            }
        }
    }

    /// The same cascade after inputs and outputs were divided by these units: with them restored.
    fn rescaled(&self, input: f64, output: f64) -> Self {
        let mut scaled = *self;
        for number in Number::ALL {
            let (u, y) = number.powers(self.parts.law);
            scaled.numbers[number as usize] *= input.powf(u) * output.powf(y);
        }
        scaled
    }
}

/// What a step is computed with: a number, or a number with its derivatives.
trait Quantity: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {
    fn value(self) -> f64;
    fn times(self, factor: f64) -> Self;
    /// `f(self)`, where `f` and its derivative have these values.
    fn through(self, value: f64, derivative: f64) -> Self;

    fn inverse(self) -> Self {
        let inverse = 1.0 / self.value();
        self.through(inverse, -inverse * inverse)
    }

    fn at_least_zero(self) -> Self {
        if self.value() > 0.0 {
            self
        } else {
            self.through(0.0, 0.0)
        }
    }
}

impl Quantity for f64 {
    fn value(self) -> f64 {
        self
    }

    fn times(self, factor: f64) -> Self {
        self * factor
    }

    fn through(self, value: f64, _: f64) -> Self {
        value
    }
}

/// Outflow of a tank.
struct Drain<Q> {
    law: Law,
    coefficient: Q,
    /// Over half a step: what `sqrt(x)` falls by, or what a level is multiplied by.
    half: Q,
}

impl<Q: Quantity> Drain<Q> {
    fn new(law: Law, coefficient: Q) -> Self {
        let step = 1.0 / SUBSTEPS as f64;
        let half = match law {
            Law::Root => coefficient.times(0.25 * step),
            Law::Linear => {
                let left = (-0.5 * step * coefficient.value()).exp();
                coefficient.through(left, -0.5 * step * left)
            }
        };
        Self {
            law,
            coefficient,
            half,
        }
    }

    /// Outflow a sample at this level.
    fn rate(&self, level: Q) -> Q {
        match self.law {
            Law::Root => {
                let root = level.value().max(f64::MIN_POSITIVE).sqrt();
                self.coefficient * level.through(root, 0.5 / root)
            }
            Law::Linear => self.coefficient * level,
        }
    }

    /// The level after half a step without inflow.
    fn half(&self, level: Q) -> Q {
        match self.law {
            Law::Root => {
                let root = level.value().max(0.0).sqrt();
                if root <= self.half.value() {
                    return level.through(0.0, 0.0);
                }
                let left = level.through(root, 0.5 / root) - self.half;
                left * left
            }
            Law::Linear => level * self.half,
        }
    }
}
