//! Loads, couplings, unlisted functions and parameters.

use super::{A_PARAMETER, A_POSITION, ANY_EQUATION, PARAMETERS, PlantEffect, TIME, effect, like};

pub(super) const LOADS_AND_PARAMETERS: &[PlantEffect] = &[
    effect(
        "load_step",
        "load that begins, stays, ends, or grows",
        "m*der(v) = ... + c, or c*time, or c from the time t0 on, for good or for T",
        ANY_EQUATION,
        TIME,
        &[
            like(
                "sensor_offset",
                "Record another variable as well: a load moves the plant, an offset only what is shown.",
            ),
            like(
                "parameter_change",
                "Repeat at another operating point: a load is the same there.",
            ),
        ],
    ),
    effect(
        "missing_input",
        "measured quantity that no equation uses",
        "m*der(v) = ... + c*d",
        ANY_EQUATION,
        "a variable of the text that is in none of its equations",
        &[like(
            "cross_coupling",
            "Move the measured quantity while everything else rests.",
        )],
    ),
    effect(
        "cross_coupling",
        "linear term that the equation lacks",
        "C*der(x) = ... + c*z, or y = x + c*z",
        "an equation, or an output that copies a variable",
        "one variable of the plant",
        &[like(
            "parameters",
            "Excite each input alone: then other variables do not move together.",
        )],
    ),
    effect(
        "law",
        "function without a name of its own",
        "C*der(x) = ... + c*f(z)",
        "any equation or parameter",
        "one variable of the plant, or a product of two",
        &[like(
            PARAMETERS,
            "Visit the whole range of the variable: the shape of the law shows at its ends.",
        )],
    ),
    effect(
        "parameter_change",
        "parameter that changes at a time, for a while, or slowly",
        "p becomes p + c from the time t0 on, for good or for T, or p + c*time",
        A_PARAMETER,
        TIME,
        &[
            like(
                "load_step",
                "Repeat at another operating point: a load is the same there, the effect of a parameter is not.",
            ),
            like(
                "temperature_dependent_resistance",
                "Wait until all is cold and repeat: what heat changes comes back.",
            ),
        ],
    ),
    effect(
        "temperature_dependent_resistance",
        "resistance, or another factor, that changes with heat",
        "R becomes R + c*T, or R + c*m where T*der(m) = z^2 - m",
        "a parameter in Ohm, or an equation through a product with a temperature",
        "a temperature, or the square of a variable that heats",
        &[like(
            "parameter_change",
            "Wait until all is cold and repeat: what heat changes comes back.",
        )],
    ),
    effect(
        "position_dependent_gain",
        "parameter that depends on the position",
        "p becomes p + c*x, or p + c*x^2",
        A_PARAMETER,
        A_POSITION,
        &[like(
            "cubic_stiffness",
            "Apply the same input at several positions.",
        )],
    ),
];
