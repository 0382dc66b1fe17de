//! Forces and torques.

use super::{A_POSITION, A_VELOCITY, ANY_EQUATION, PARAMETERS, PlantEffect, TIME, effect, like};

pub(super) const FORCES: &[PlantEffect] = &[
    effect(
        "coulomb_friction",
        "dry friction",
        "m*der(v) = ... + c*tanh(v/w), or c*sign(v) where the motion never turns",
        ANY_EQUATION,
        A_VELOCITY,
        &[
            like(
                "load_step",
                "Move in both directions: friction turns with the motion, a load does not.",
            ),
            like(
                "stribeck_friction",
                "Drive slowly and at several constant speeds: the force of dry friction is the same at all of them.",
            ),
            like(
                "input_dead_zone",
                "Move at constant speed and vary the input: a dead zone does not depend on the sign of the speed.",
            ),
        ],
    ),
    effect(
        "hysteresis",
        "memory of the direction",
        "m*der(v) = ... + c*z, der(z) = (v - abs(v)*z)/s; or u becomes u + c*z, where z goes to 1 the way u moves",
        "any equation or input",
        "the rate of what is remembered: a speed, a current; at an input, the input itself",
        &[
            like(
                "coulomb_friction",
                "Move to and fro by less than the friction's usual travel: hysteresis springs back.",
            ),
            like(
                "input_backlash",
                "Reverse the input by a little: play does nothing until it is taken up.",
            ),
        ],
    ),
    effect(
        "extra_mode",
        "a part that moves on its own",
        "(1 - f)*J*der(w) = ... - F, and f*J*der(w2) = F: a spring and a damper, or a resistance, between the two",
        "the equation of a derivative",
        "the state itself",
        &[
            like(
                "sensor_lag",
                "Excite at higher frequencies: behind a lag the output only gets smaller, a part on a spring has a resonance.",
            ),
            like(
                "actuator_lag",
                "Start from another initial state without an input: an actuator that lags does nothing then.",
            ),
        ],
    ),
    effect(
        "backlash",
        "play between two parts",
        "(1 - f)*J*der(w) = ... - F, and f*J*der(w2) = F, where F is zero while the parts are within g of the middle",
        "the equation of a derivative",
        "the state itself",
        &[
            like(
                "input_backlash",
                "Coast without an input and reverse the load: play of an actuator does nothing then.",
            ),
            like(
                "extra_mode",
                "Excite with several sizes: the frequency of a resonance does not depend on the size, that of play does.",
            ),
        ],
    ),
    effect(
        "stribeck_friction",
        "friction that falls with speed",
        "m*der(v) = ... + c*tanh(v/w)*(1 + r*exp(-abs(v)/vs))",
        ANY_EQUATION,
        A_VELOCITY,
        &[like(
            "coulomb_friction",
            "Drive slowly and at several constant speeds: here the force falls as the speed grows.",
        )],
    ),
    effect(
        "asymmetric_damping",
        "damping that differs between directions",
        "m*der(v) = ... + c*max(v, 0)",
        ANY_EQUATION,
        A_VELOCITY,
        &[
            like(
                "input_asymmetry",
                "Let it coast freely in both directions without an input.",
            ),
            like(
                "load_step",
                "Hold it at rest: a load still acts, a damper does not.",
            ),
        ],
    ),
    effect(
        "efficiency",
        "loss in proportion to what drives, such as in a worm gear",
        "J*der(w) = ... + c*abs(M)*sign(w)",
        ANY_EQUATION,
        "what drives a velocity, and the velocity",
        &[
            like(
                "coulomb_friction",
                "Turn it at one speed under several loads: dry friction is the same, a loss grows with the load.",
            ),
            like(
                "input_asymmetry",
                "Let the load drive it in both directions: an asymmetric input depends on its own sign only.",
            ),
        ],
    ),
    effect(
        "viscous_friction",
        "force against the speed, in proportion to it",
        "J*der(w) = ... + c*w",
        ANY_EQUATION,
        "the speed itself",
        &[like(
            "quadratic_drag",
            "Coast down from the highest speed: under quadratic drag the speed falls fast at first and slowly later.",
        )],
    ),
    effect(
        "quadratic_drag",
        "drag with the square of the speed",
        "m*der(v) = ... + c*v*abs(v)",
        ANY_EQUATION,
        A_VELOCITY,
        &[
            like(
                "cubic_drag",
                "Reach at least three times the usual speed: the exponent shows at large speeds.",
            ),
            like(
                PARAMETERS,
                "Move at small and at large amplitudes: a linear damper scales with both alike.",
            ),
        ],
    ),
    effect(
        "cubic_drag",
        "drag with the cube of the speed",
        "m*der(v) = ... + c*v^3",
        ANY_EQUATION,
        A_VELOCITY,
        &[like(
            "quadratic_drag",
            "Reach at least three times the usual speed: the exponent shows at large speeds.",
        )],
    ),
    effect(
        "cubic_stiffness",
        "stiffness that grows with the square of the deflection",
        "m*der(v) = ... + c*x^3",
        ANY_EQUATION,
        A_POSITION,
        &[
            like(
                "end_stop",
                "Increase the amplitude slowly: a stop begins at one position, a stiffening spring grows everywhere.",
            ),
            like(
                "quadratic_stiffness",
                "Deflect to both sides equally: the cube is odd.",
            ),
        ],
    ),
    effect(
        "quadratic_stiffness",
        "stiffness with the square of the deflection",
        "m*der(v) = ... + c*x^2, or c*x*abs(x)",
        ANY_EQUATION,
        A_POSITION,
        &[
            like(
                "cubic_stiffness",
                "Deflect to both sides equally, and to three times the usual amplitude.",
            ),
            like(
                "load_step",
                "Hold it at two positions: a load is the same at both.",
            ),
        ],
    ),
    effect(
        "end_stop",
        "stop at the end of the travel",
        "m*der(v) = ... + k*(max(x - c, 0) + min(x + c, 0)), or one side of it; with damping max(1 +- v/V, 0) where the recording shows it; of a drive der(x) = min(max(..., (lower - x)/T), (upper - x)/T), where T is a fifth of a sample",
        ANY_EQUATION,
        A_POSITION,
        &[
            like(
                "cubic_stiffness",
                "Increase the amplitude slowly: a stop begins at one position.",
            ),
            like(
                "sensor_saturation",
                "Record the speed as well: a stop reverses it, a saturated sensor does not.",
            ),
        ],
    ),
    effect(
        "cogging",
        "force that repeats with the angle",
        "J*der(w) = ... + c*sin(k*phi + p)",
        ANY_EQUATION,
        "an angle in rad that covers half a turn or more",
        &[like(
            "load_step",
            "Turn slowly through several turns at two speeds: cogging keeps its period in the angle.",
        )],
    ),
    effect(
        "gravity_torque",
        "torque of gravity",
        "J*der(w) = ... + c*sin(phi), c*sin(phi + p) for a mounting that is not upright, or c*(sin(phi) - phi) where the text is linearised",
        ANY_EQUATION,
        "an angle in rad: for the first two, one that covers half a turn or more",
        &[like(
            "cogging",
            "Turn slowly through several turns: gravity repeats once a turn.",
        )],
    ),
    effect(
        "periodic_disturbance",
        "force that repeats in time",
        "m*der(v) = ... + c*sin(w*time + p)",
        ANY_EQUATION,
        TIME,
        &[like(
            "cogging",
            "Record at another speed: cogging and unbalance follow it, a disturbance keeps its frequency.",
        )],
    ),
];
