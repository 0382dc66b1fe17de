//! Flows and heat.

use super::{ANY_EQUATION, PARAMETERS, PlantEffect, effect, like};

pub(super) const HEAT_AND_FLOW: &[PlantEffect] = &[
    effect(
        "overflow",
        "flow above a level",
        "A*der(h) = ... + c*sqrt(max(h - h0, 0)), or c*max(h - h0, 0)",
        ANY_EQUATION,
        "the variable whose equation it enters",
        &[like(
            "leak",
            "Stay below and above the level: a leak acts at every level.",
        )],
    ),
    effect(
        "tank_outflow",
        "free outflow with the square root of a level, where a linear model has one in proportion to it",
        "A*der(h) = q - c*sqrt(h)",
        "the equations of levels, of two tanks that ship with the program and are offered beside a linear model",
        "the levels",
        &[like(
            "sensor_saturation",
            "Stop the inflow and let the tank run empty: a free outflow ends at a time of its own, along a parabola.",
        )],
    ),
    effect(
        "leak",
        "outflow with the square root of a level",
        "A*der(h) = ... + c*sqrt(h)",
        ANY_EQUATION,
        "the variable whose equation it enters, which is never below zero",
        &[
            like(
                PARAMETERS,
                "Let it empty from full with all inputs off: an outlet of the text scales with its own coefficient.",
            ),
            like(
                "overflow",
                "Stay at a low level for long: a leak acts there too.",
            ),
        ],
    ),
    effect(
        "radiation",
        "heat radiation",
        "C*der(T) = ... + c*(((T + 273.15)/100)^4 - ((Ta + 273.15)/100)^4)",
        ANY_EQUATION,
        "two temperatures in K or degC, or one of them and a room of 20 degC",
        &[like(
            "natural_convection",
            "Heat up to at least twice the usual difference to the surroundings, and record the cooling.",
        )],
    ),
    effect(
        "natural_convection",
        "convection that grows with the temperature difference",
        "C*der(T) = ... + c*(T - Ta)*abs(T - Ta)^0.25; through an opening ^0.5",
        ANY_EQUATION,
        "the difference of two temperatures",
        &[
            like(
                "radiation",
                "Cool from at least twice the usual difference to the surroundings.",
            ),
            like(
                PARAMETERS,
                "Cool from a small and from a large difference: a constant coefficient gives one time constant.",
            ),
        ],
    ),
];
