//! Inputs and actuators.

use super::{AN_INPUT, ITSELF, PlantEffect, effect, like};

pub(super) const INPUTS: &[PlantEffect] = &[
    effect(
        "input_saturation",
        "limit of an input",
        "u becomes min(max(u, -L), L), or one side of it",
        AN_INPUT,
        ITSELF,
        &[like(
            "input_curve",
            "Apply steps of growing size: beyond a limit the answer does not grow at all.",
        )],
    ),
    effect(
        "input_dead_zone",
        "input that acts only beyond a threshold",
        "u becomes u - min(max(u, -d), d)",
        AN_INPUT,
        ITSELF,
        &[
            like(
                "coulomb_friction",
                "Move at constant speed and vary the input: a dead zone does not depend on the sign of the speed.",
            ),
            like(
                "input_backlash",
                "Apply small inputs around several levels: a dead zone lies at zero only.",
            ),
        ],
    ),
    effect(
        "input_asymmetry",
        "input of different gain for its two signs",
        "u becomes u + c*max(u, 0)",
        AN_INPUT,
        ITSELF,
        &[like(
            "asymmetric_damping",
            "Let the plant coast freely in both directions without an input.",
        )],
    ),
    effect(
        "input_curve",
        "curved characteristic of an input",
        "u becomes u + c*u^2, or u + c*u^3",
        AN_INPUT,
        ITSELF,
        &[like(
            "input_saturation",
            "Apply steps of growing size: a curve bends everywhere, a limit at one value.",
        )],
    ),
    effect(
        "input_delay",
        "input that acts later",
        "u becomes delay(u, T)",
        AN_INPUT,
        ITSELF,
        &[like(
            "actuator_lag",
            "Apply a step and sample fast: after a delay nothing moves at first, behind a lag it does at once.",
        )],
    ),
    effect(
        "actuator_lag",
        "actuator that follows with a time constant",
        "u becomes m where T*der(m) = u - m",
        AN_INPUT,
        ITSELF,
        &[
            like(
                "input_delay",
                "Apply a step and sample fast: behind a lag the answer begins at once.",
            ),
            like(
                "sensor_lag",
                "Start from another initial state without an input: only a sensor lags then.",
            ),
            like(
                "input_rate_limit",
                "Apply steps of several sizes: a time constant does not depend on the size.",
            ),
        ],
    ),
    effect(
        "input_backlash",
        "play of an actuator",
        "u becomes m = min(max(pre(m), u - g), u + g), perhaps with a lag T",
        AN_INPUT,
        ITSELF,
        &[like(
            "input_dead_zone",
            "Apply small inputs around several levels: play acts at every level where the direction changes.",
        )],
    ),
    effect(
        "valve_stiction",
        "valve that sticks and slips",
        "u becomes m = if abs(u - pre(m)) > S then u - o*sign(u - pre(m)) else pre(m), perhaps with a lag T",
        AN_INPUT,
        ITSELF,
        &[like(
            "input_backlash",
            "Move the input slowly one way: play follows at a distance, a valve that sticks moves in jumps.",
        )],
    ),
    effect(
        "input_rate_limit",
        "limit of the rate of an input",
        "u becomes m, which follows u at most by R per second",
        AN_INPUT,
        ITSELF,
        &[like(
            "actuator_lag",
            "Apply steps of several sizes: the time to follow grows with the size.",
        )],
    ),
];
