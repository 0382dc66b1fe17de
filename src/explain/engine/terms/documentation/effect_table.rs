//! The effects of plants in equations, by families.

use super::{Imitation, PARAMETERS, PlantEffect};

const fn like(effect: &'static str, experiment: &'static str) -> Imitation {
    Imitation { effect, experiment }
}

const fn effect(
    id: &'static str,
    title: &'static str,
    equation: &'static str,
    enters: &'static str,
    depends: &'static str,
    imitations: &'static [Imitation],
) -> PlantEffect {
    PlantEffect {
        id,
        title,
        equation,
        enters,
        depends,
        imitations,
    }
}

const ANY_EQUATION: &str = "the equation of a derivative or of an algebraic variable";
const AN_INPUT: &str = "an input, on its way into every equation that uses it";
const A_SENSOR: &str = "an output that copies a variable";
const A_PARAMETER: &str = "a parameter, in every equation that uses it";
const A_VELOCITY: &str = "a velocity: a variable in m/s or rad/s, or the derivative of another";
const A_POSITION: &str = "a position: a variable in m, mm, rad or deg of a plant that moves";
const ITSELF: &str = "the input itself";
const SHOWN: &str = "what the sensor shows";
const TIME: &str = "time";

/// All effects of plants in equations, by families.
pub const PLANT_EFFECTS: &[PlantEffect] = &[
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
        "J*der(w) = ... + c*sin(phi), or c*sin(phi + p) for a mounting that is not upright",
        ANY_EQUATION,
        "an angle in rad that covers half a turn or more",
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
    effect(
        "load_step",
        "load that begins, stays, or grows",
        "m*der(v) = ... + c, or c*time, or c from the time t0 on",
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
        "C*der(x) = ... + c*z",
        ANY_EQUATION,
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
        "parameter that changes at a time, or slowly",
        "p becomes p + c from the time t0 on, or p + c*time",
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
    effect(
        "sensor_offset",
        "constant error of a sensor",
        "y = ... + c",
        A_SENSOR,
        TIME,
        &[like(
            "load_step",
            "Record at rest with all inputs off: what the sensor shows then is its offset.",
        )],
    ),
    effect(
        "sensor_drift",
        "error of a sensor that grows with time",
        "y = ... + c*time",
        A_SENSOR,
        TIME,
        &[like(
            "load_step",
            "Come back to the first operating point at the end: a drift is still there.",
        )],
    ),
    effect(
        "sensor_scale",
        "sensor of another gain",
        "y = ... + c*y",
        A_SENSOR,
        SHOWN,
        &[like(
            "parameters",
            "Calibrate the sensor at two known values; a gain of the plant cannot be told from it by inputs and outputs alone.",
        )],
    ),
    effect(
        "sensor_lag",
        "sensor that follows with a time constant",
        "y = m where T*der(m) = ... - m",
        A_SENSOR,
        SHOWN,
        &[like(
            "actuator_lag",
            "Start from another initial state without an input: only a sensor lags then.",
        )],
    ),
    effect(
        "sensor_rectification",
        "sensor that loses the sign",
        "y = abs(...)",
        A_SENSOR,
        SHOWN,
        &[like(
            "input_saturation",
            "Drive the output slowly through zero: a rectified signal has a corner there.",
        )],
    ),
    effect(
        "sensor_saturation",
        "limits of a sensor",
        "y = min(max(..., lower), upper)",
        A_SENSOR,
        SHOWN,
        &[like(
            "end_stop",
            "Record another variable as well: behind a saturated sensor the plant moves on.",
        )],
    ),
];
