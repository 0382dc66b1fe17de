//! Tanks in place of the linear plant: their numbers are held by the effects `tank_outflow` and `overflow`, their levels are
//! the state.

use super::Structure;
use crate::explain::effects::{Action, Clock};
use crate::explain::linear::cascade::{Cascade, Law, Number, Parts};
use crate::explain::linear::data::Series;

/// Outflow coefficient of an upper tank that is not there: it passes everything on at once.
const OPEN: f64 = 1e9;

/// Tanks with their numbers.
pub(crate) struct Tanks {
    /// A sample is its unit of time.
    pub(crate) cascade: Cascade,
    /// There is no upper tank.
    pub(crate) one: bool,
    /// The input that is the pump.
    pub(crate) pump: usize,
}

impl Tanks {
    pub(crate) fn of(structure: &Structure, theta: &[f64], step: f64) -> Self {
        let mut tanks = Self {
            cascade: Cascade {
                parts: Parts {
                    law: Law::Root,
                    upper_overflow: false,
                    lower_overflow: false,
                    constant_inflow: false,
                    pump_bias: false,
                },
                numbers: Default::default(),
            },
            one: true,
            pump: 0,
        };
        tanks.cascade.numbers[Number::UpperOutflow as usize] = OPEN;
        for (index, effect) in structure.effects.iter().enumerate() {
            if !matches!(effect.definition.action, Action::Process) {
                continue;
            }
            tanks.pump = effect.channel;
            let shape = structure.shape(theta, index);
            for (parameter, value) in effect.definition.parameters.iter().zip(shape) {
                let Some((number, rate)) = number_of(parameter.name) else {
                    continue;
                };
                tanks.cascade.numbers[number as usize] = if rate { value * step } else { value };
                let parts = &mut tanks.cascade.parts;
                match number {
                    Number::UpperOutflow => tanks.one = false,
                    Number::UpperRim => parts.upper_overflow = true,
                    Number::LowerRim => parts.lower_overflow = true,
                    Number::Inflow => parts.constant_inflow = true,
                    Number::Bias => parts.pump_bias = true,
                    _ => {}
                }
            }
        }
        tanks
    }

    /// State of the structure to levels; below the floor there is nothing.
    pub(crate) fn initial(&self, state: &[f64]) -> [f64; 2] {
        let level = |i: usize| state.get(i).map_or(0.0, |x: &f64| x.max(0.0));
        if self.one {
            [0.0, level(0)]
        } else {
            [level(0), level(1)]
        }
    }

    /// Levels as a state of the structure.
    pub(crate) fn state(&self, levels: [f64; 2]) -> Vec<f64> {
        levels[usize::from(self.one)..].to_vec()
    }

    /// State after one sample.
    pub(crate) fn next(&self, state: &[f64], input: f64) -> Vec<f64> {
        let levels = self.cascade.levels(&[input, input], self.initial(state));
        self.state(levels.last().copied().unwrap_or_default())
    }
}

/// What a parameter is in the cascade, and whether it is a rate (a second here, a sample there).
pub(crate) fn number_of(name: &str) -> Option<(Number, bool)> {
    Some(match name {
        "pump_gain" => (Number::Pump, true),
        "upper_outflow" => (Number::UpperOutflow, true),
        "lower_outflow" | "outflow" => (Number::LowerOutflow, true),
        "constant_inflow" => (Number::Inflow, true),
        "pump_bias" => (Number::Bias, true),
        "upper_rim" => (Number::UpperRim, false),
        "caught_share" => (Number::Share, false),
        "lower_rim" => (Number::LowerRim, false),
        _ => return None,
    })
}

/// Outputs of a structure that is tanks.
pub(crate) fn simulate(
    structure: &Structure,
    theta: &[f64],
    inputs: &Series,
    x0: &[f64],
    clock: &Clock,
) -> Option<Series> {
    let tanks = Tanks::of(structure, theta, clock.step);
    let output = tanks
        .cascade
        .simulate(inputs.get(tanks.pump)?, tanks.initial(x0));
    output.iter().all(|y| y.is_finite()).then(|| vec![output])
}
