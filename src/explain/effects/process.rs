//! Process plants: tanks that empty through a hole and overflow at a rim.
//!
//! These effects are not added to a linear plant, they *are* the plant: [`crate::explain`] runs the class `cascade`
//! in its place. Its numbers are those of the recording's units a second:
//!
//! ```text
//! dx1/dt = max(b u + w, 0) - a sqrt(x1) - over        x1 <= h1
//! dx2/dt = a sqrt(x1) + g over + q - d sqrt(x2)       x2 <= h2        y = x2
//! ```
//!
//! The upper level is scaled such that what leaves the upper tank enters the lower one with gain 1: a recording of
//! the lower level alone does not tell the ratio of the areas. Of one tank, `max(b u + w, 0)` enters the lower equation.

use super::{Action, Definition, Mimic, Parameter, Unit};

const PUMP_GAIN: Parameter = Parameter::positive("pump_gain", Unit::RatePerInput);
const UPPER_OUTFLOW: Parameter = Parameter::positive("upper_outflow", Unit::RootRate);
const LOWER_OUTFLOW: Parameter = Parameter::positive("lower_outflow", Unit::RootRate);
const OUTFLOW: Parameter = Parameter::positive("outflow", Unit::RootRate);
const CONSTANT_INFLOW: Parameter = Parameter::real("constant_inflow", Unit::Rate);
const PUMP_BIAS: Parameter = Parameter::real("pump_bias", Unit::Rate);
const UPPER_RIM: Parameter = Parameter::positive("upper_rim", Unit::Position);
const LOWER_RIM: Parameter = Parameter::positive("lower_rim", Unit::Position);
const CAUGHT: Parameter = Parameter::between("caught_share", Unit::Ratio, 0.0, 1.0);

const TWO: &str = "free outflow of two tanks";
const ONE: &str = "free outflow of a tank";
const TWO_EQUATION: &str =
    "dx1/dt = max(b u + w, 0) - a sqrt(x1), dx2/dt = a sqrt(x1) + q - d sqrt(x2), y = x2";
const ONE_EQUATION: &str = "dx/dt = max(b u + w, 0) + q - d sqrt(x), y = x";

pub(super) static ENTRIES: &[Definition] = &[
    outflow(
        "two tanks",
        TWO,
        TWO_EQUATION,
        &[PUMP_GAIN, UPPER_OUTFLOW, LOWER_OUTFLOW],
    ),
    outflow(
        "two tanks, inflow",
        TWO,
        TWO_EQUATION,
        &[PUMP_GAIN, UPPER_OUTFLOW, LOWER_OUTFLOW, CONSTANT_INFLOW],
    ),
    outflow(
        "two tanks, bias",
        TWO,
        TWO_EQUATION,
        &[PUMP_GAIN, UPPER_OUTFLOW, LOWER_OUTFLOW, PUMP_BIAS],
    ),
    outflow(
        "two tanks, inflow, bias",
        TWO,
        TWO_EQUATION,
        &[
            PUMP_GAIN,
            UPPER_OUTFLOW,
            LOWER_OUTFLOW,
            CONSTANT_INFLOW,
            PUMP_BIAS,
        ],
    ),
    outflow("one tank", ONE, ONE_EQUATION, &[PUMP_GAIN, OUTFLOW]),
    outflow(
        "one tank, inflow",
        ONE,
        ONE_EQUATION,
        &[PUMP_GAIN, OUTFLOW, CONSTANT_INFLOW],
    ),
    outflow(
        "one tank, bias",
        ONE,
        ONE_EQUATION,
        &[PUMP_GAIN, OUTFLOW, PUMP_BIAS],
    ),
    outflow(
        "one tank, inflow, bias",
        ONE,
        ONE_EQUATION,
        &[PUMP_GAIN, OUTFLOW, CONSTANT_INFLOW, PUMP_BIAS],
    ),
    overflow(
        "both",
        "overflow of both tanks",
        "x1 <= h1, a share g of what does not fit falls into the lower tank; x2 <= h2",
        &[UPPER_RIM, CAUGHT, LOWER_RIM],
    ),
    overflow(
        "upper",
        "overflow of the upper tank",
        "x1 <= h1, a share g of what does not fit falls into the lower tank",
        &[UPPER_RIM, CAUGHT],
    ),
    overflow(
        "lower",
        "overflow of the tank whose level is recorded",
        "x2 <= h2, what does not fit is lost",
        &[LOWER_RIM],
    ),
];

const fn outflow(
    variant: &'static str,
    name: &'static str,
    equation: &'static str,
    parameters: &'static [Parameter],
) -> Definition {
    Definition {
        id: "tank_outflow",
        variant,
        name,
        equation,
        parameters,
        mimics: OUTFLOW_MIMICS,
        linear: &[],
        persists: true,
        action: Action::Process,
        starts: |_| Vec::new(),
    }
}

const fn overflow(
    variant: &'static str,
    name: &'static str,
    equation: &'static str,
    parameters: &'static [Parameter],
) -> Definition {
    Definition {
        id: "overflow",
        variant,
        name,
        equation,
        parameters,
        mimics: OVERFLOW_MIMICS,
        linear: &[],
        persists: true,
        action: Action::Process,
        starts: |_| Vec::new(),
    }
}

const OUTFLOW_MIMICS: &[Mimic] = &[Mimic {
    effect: "sensor_saturation",
    experiment: "stop the pump and let the tanks run empty: a free outflow ends at a time of its own, along a parabola",
}];

const OVERFLOW_MIMICS: &[Mimic] = &[
    Mimic {
        effect: "sensor_saturation",
        experiment: "stop the pump at the limit: a tank at its rim falls at once, a saturated sensor stays until the level is back",
    },
    Mimic {
        effect: "input_saturation",
        experiment: "a short burst of the pump from a low level: it passes a saturated input no more than a long one, and an empty tank entirely",
    },
];
