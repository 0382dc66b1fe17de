//! The effects as data: terms in the language of the plants, what they may enter, and what they are called there.

use super::term::{
    Memory, MemoryStart, Needs, Port, Shape, Starts, Term, curve, in_place, sampled, shape,
};
pub(super) const ABOVE: &[f64] = &[0.5, 0.7, 0.85, 0.94, 0.98];
pub(super) const BELOW: &[f64] = &[0.5, 0.3, 0.15, 0.06, 0.02];
/// When something changes.
pub(super) const STEP: Shape = shape("t0", Starts::Instants(TIMES), false);
pub(super) const TIMES: &[f64] = &[
    0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85,
    0.9, 0.95,
];
/// What begins, lasts and ends: a stretch of another road, a door that stands open.
const FOR_A_WHILE: &str = "(if time > {t0} and time < {t0} + {T} then 1.0 else 0.0)";
const WHILE: Shape = shape("T", Starts::Length(&[0.05, 0.1, 0.2, 0.4]), true);

use Needs::{
    AboutZero, AlongPath, Angle, Another, Anything, BothSigns, Difference, Directed, Driven,
    Integrated, OneWay, OwnState, Positive, Radiation, Reciprocal, Stretch, SwitchedOn, Time,
    Turning, Velocity,
};
use Port::{Equation, Input, Parameter, Sensor};

/// A function that nobody listed: its text is that of its pieces.
pub(crate) const CURVE: Term = curve("curve", Equation, Anything, "", &[]);

pub(super) const BACKLASH: Shape = shape("g", Starts::Spread(&[0.02, 0.1, 0.3]), true);
/// Where a valve lets go, and how far from its signal it stops: its friction is less while it moves
/// (Q. P. He et al., *Ind. Eng. Chem. Res.* 46, 2007).
pub(super) const STICTION: Shape = shape(
    "S",
    Starts::Releases(&[0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0]),
    true,
);
pub(super) const DEAD_ZONE: Shape = shape("d", Starts::SizeQuantiles(&[0.1, 0.3, 0.5]), true);
/// A limit on both sides, and an upper one.
pub(super) const LIMIT: Shape = shape("L", Starts::SizeQuantiles(&[0.6, 0.8, 0.9, 0.97]), true);
pub(super) const UPPER_LIMIT: Shape = shape("L", Starts::Quantiles(&[0.6, 0.8, 0.9, 0.97]), false);
pub(super) const LOWER_LIMIT: Shape = shape("L", Starts::Quantiles(&[0.4, 0.2, 0.1, 0.03]), false);
pub(super) const STOP: Shape = shape("o", Starts::Releases(&[0.03, 0.1]), true);
pub(super) const HYSTERESIS: Shape = shape("w", Starts::Spread(&[0.1, 0.3, 1.0]), true);

/// Hysteresis of an input with these memories.
pub(super) const fn hysteresis(memories: &'static [Memory], shapes: &'static [Shape]) -> Term {
    Term {
        memories,
        ..curve("input_hysteresis", Input, Anything, "{m}", shapes)
    }
}

/// Wave number and phase in an angle.
const WAVE: &[Shape] = &[
    shape("k", Starts::Waves, true),
    shape(
        "p",
        Starts::Values(&[0.0, std::f64::consts::FRAC_PI_2]),
        false,
    ),
];

/// What acts a time after an input.
const fn later(needs: Needs, form: &'static str) -> Term {
    const TIME: Shape = shape("T", Starts::Samples(&[0.5, 1.0, 2.0, 4.0, 8.0]), true);
    Term {
        form,
        needs,
        ..in_place("input_delay", &[], &[TIME])
    }
}

/// What follows an input.
const fn lagging(needs: Needs, memories: &'static [Memory]) -> Term {
    const TIME: Shape = shape("T", Starts::Samples(&[0.5, 2.0, 6.0, 20.0]), true);
    Term {
        needs,
        ..in_place("actuator_lag", memories, &[TIME])
    }
}

const fn lag(start: MemoryStart) -> Memory {
    Memory {
        rate: "({z} - {m})/{T}",
        start,
        sampled: false,
    }
}

const UPPER: Shape = shape("upper", Starts::Quantiles(&[0.98]), false);
const LOWER: Shape = shape("lower", Starts::Quantiles(&[0.02]), false);

/// What cannot leave a range, whatever drives it: at an end its rate is no larger than what brings it there within a part of a sample.
const fn limit(form: &'static str, shapes: &'static [Shape]) -> Term {
    Term {
        free_strength: false,
        symbol: "",
        ..curve("limit", Equation, Integrated, form, shapes)
    }
}

/// The library.
pub(crate) const TERMS: &[Term] = &[
    curve("linear", Equation, Anything, "{z}", &[]),
    curve("square", Equation, Anything, "{z}^2", &[]),
    curve("signed_square", Equation, Directed, "{z}*abs({z})", &[]),
    curve("cube", Equation, Anything, "{z}^3", &[]),
    // A gauge need not read zero where a spring is at rest.
    curve(
        "cube",
        Equation,
        AlongPath,
        "({z} - {o})^3",
        &[shape(
            "o",
            Starts::Quantiles(&[0.1, 0.3, 0.5, 0.7, 0.9]),
            false,
        )],
    ),
    curve("root", Equation, Positive, "sqrt(max({z}, 0))", &[]),
    // Michaelis and Menten's, Monod's and Langmuir's.
    curve(
        "saturation",
        Equation,
        Positive,
        "{z}/({z} + {K})",
        &[shape("K", Starts::Quantiles(&[0.2, 0.6]), true)],
    ),
    curve(
        "friction",
        Equation,
        Turning,
        "tanh({z}/{w})",
        &[shape("w", Starts::Spread(&[0.02, 0.1]), true)],
    ),
    // Where the motion never turns, the speed at which friction comes up does not show.
    curve("one_way_friction", Equation, OneWay, "sign({z})", &[]),
    curve(
        "stribeck",
        Equation,
        Velocity,
        "tanh({z}/{w})*(1 + {r}*exp(-abs({z})/{vs}))",
        &[
            shape("w", Starts::Spread(&[0.02]), true),
            shape("r", Starts::Values(&[0.7]), true),
            shape("vs", Starts::Spread(&[0.1, 0.3, 0.8]), true),
        ],
    ),
    // Bristles that yield: P. R. Dahl, A Solid Friction Model, Aerospace Corporation TOR-158, 1968.
    Term {
        id: "bristles",
        port: Equation,
        needs: Turning,
        form: "{m}",
        memories: &[Memory {
            rate: "({z} - abs({z})*{m})/{s}",
            start: MemoryStart::Zero,
            sampled: false,
        }],
        shapes: &[shape("s", Starts::Travel(&[0.003, 0.02, 0.1, 0.4]), true)],
        free_strength: true,
        symbol: "c",
        units: &[],
    },
    // ... and that hold more at rest than they do moving: C. Canudas de Wit et al., IEEE Trans. Automatic Control 40, 1995.
    Term {
        id: "stribeck_bristles",
        port: Equation,
        needs: Velocity,
        form: "{m}",
        memories: &[Memory {
            rate: "({z} - abs({z})*{m}/(1 + {r}*exp(-abs({z})/{vs})))/{s}",
            start: MemoryStart::Zero,
            sampled: false,
        }],
        shapes: &[
            shape("s", Starts::Travel(&[0.003]), true),
            shape("r", Starts::Values(&[0.7]), true),
            shape("vs", Starts::Spread(&[0.1, 0.4]), true),
        ],
        free_strength: true,
        symbol: "c",
        units: &[],
    },
    // A part `f` of what the equation's coefficient holds (inertia, heat capacity) is coupled to the rest by a spring and a
    // damper: J*der(z) = v becomes (1 - f)*J*der(z) = v - force, where {a} is J and {p} the speed of that part.
    Term {
        id: "extra_mode",
        port: Equation,
        needs: OwnState,
        form: "{f}/(1 - {f})*({v} - {a}*({m}/{T}^2 + {D}*({z} - {p})/{T}))",
        memories: &[
            Memory {
                rate: "{z} - {p}",
                start: MemoryStart::Zero,
                sampled: false,
            },
            Memory {
                rate: "{m}/{T}^2 + {D}*({z} - {p})/{T}",
                start: MemoryStart::Argument,
                sampled: false,
            },
        ],
        shapes: &[
            shape("f", Starts::Share(&[0.3]), true),
            shape("T", Starts::Samples(&[1.0, 3.0, 10.0, 30.0]), true),
            shape("D", Starts::Values(&[0.1]), true),
        ],
        free_strength: false,
        symbol: "",
        units: &[],
    },
    // ... by a resistance alone.
    Term {
        id: "extra_mode",
        port: Equation,
        needs: OwnState,
        form: "{f}/(1 - {f})*({v} - {a}*({z} - {m})/{T})",
        memories: &[Memory {
            rate: "({z} - {m})/{T}",
            start: MemoryStart::Argument,
            sampled: false,
        }],
        shapes: &[
            shape("f", Starts::Share(&[0.3]), true),
            shape("T", Starts::Samples(&[3.0, 10.0, 30.0, 100.0, 300.0]), true),
        ],
        free_strength: false,
        symbol: "",
        units: &[],
    },
    // ... by a stiff spring with play `g`.
    Term {
        id: "backlash",
        port: Equation,
        needs: OwnState,
        form: "{f}/(1 - {f})*({v} - {a}*((max({m} - {g}, 0) + min({m} + {g}, 0))/{T}^2 + {D}*({z} - {p})/{T}))",
        memories: &[
            Memory {
                rate: "{z} - {p}",
                start: MemoryStart::Zero,
                sampled: false,
            },
            Memory {
                rate: "(max({m} - {g}, 0) + min({m} + {g}, 0))/{T}^2 + {D}*({z} - {p})/{T}",
                start: MemoryStart::Argument,
                sampled: false,
            },
        ],
        shapes: &[
            shape("f", Starts::Share(&[0.3]), true),
            shape("T", Starts::Samples(&[1.0]), true),
            shape("D", Starts::Values(&[0.1]), true),
            shape("g", Starts::Moved(&[0.3, 1.0, 3.0, 10.0]), true),
        ],
        free_strength: false,
        symbol: "",
        units: &[],
    },
    curve("one_sided", Equation, BothSigns, "max({z}, 0)", &[]),
    curve(
        "above",
        Equation,
        Anything,
        "max({z} - {from}, 0)",
        &[shape("from", Starts::Quantiles(ABOVE), false)],
    ),
    curve(
        "below",
        Equation,
        Anything,
        "min({z} - {from}, 0)",
        &[shape("from", Starts::Quantiles(BELOW), false)],
    ),
    curve(
        "both_sides",
        Equation,
        BothSigns,
        "max({z} - {from}, 0) + min({z} + {from}, 0)",
        &[shape("from", Starts::SizeQuantiles(ABOVE), true)],
    ),
    limit(
        "min(max({v}, {a}*({lower} - {z})/{instant}), {a}*({upper} - {z})/{instant}) - {v}",
        &[UPPER, LOWER],
    ),
    limit("min({v}, {a}*({upper} - {z})/{instant}) - {v}", &[UPPER]),
    limit("max({v}, {a}*({lower} - {z})/{instant}) - {v}", &[LOWER]),
    // Play in a spring that the equations have: it takes its force away, up to the gap `g`.
    curve(
        "gap",
        Equation,
        Stretch,
        "min(max({z}, -{g}), {g})",
        &[shape("g", Starts::SizeQuantiles(&[0.3, 0.6, 0.9]), true)],
    ),
    curve(
        "root_above",
        Equation,
        Anything,
        "sqrt(max({z} - {from}, 0))",
        &[shape(
            "from",
            Starts::Quantiles(&[0.3, 0.5, 0.7, 0.85, 0.95]),
            false,
        )],
    ),
    curve("sine", Equation, AlongPath, "sin({k}*{z} + {p})", WAVE),
    curve("gravity", Equation, Angle, "sin({z})", &[]),
    // A plant that was linearised about its rest has the angle in the place of its sine.
    curve("gravity", Equation, Angle, "sin({z}) - {z}", &[]),
    curve(
        "gravity",
        Equation,
        Angle,
        "sin({z} + {p})",
        &[shape(
            "p",
            Starts::Values(&[std::f64::consts::FRAC_PI_2]),
            false,
        )],
    ),
    curve("radiation", Equation, Radiation, "{z}", &[]),
    curve(
        "natural_convection",
        Equation,
        Difference,
        "{z}*abs({z})^0.25",
        &[],
    ),
    // ... through an opening.
    curve(
        "natural_convection",
        Equation,
        Difference,
        "{z}*abs({z})^0.5",
        &[],
    ),
    curve("efficiency", Equation, Driven, "{z}", &[]),
    curve("load_constant", Equation, Time, "1.0", &[]),
    curve("load_ramp", Equation, Time, "time", &[]),
    curve(
        "load_step",
        Equation,
        Time,
        "(if time > {t0} then 1.0 else 0.0)",
        &[STEP],
    ),
    curve("load_step", Equation, Time, FOR_A_WHILE, &[STEP, WHILE]),
    curve(
        "periodic",
        Equation,
        Time,
        "sin({w}*time + {p})",
        &[
            shape("w", Starts::Peaks, true),
            shape(
                "p",
                Starts::Values(&[0.0, std::f64::consts::FRAC_PI_2]),
                false,
            ),
        ],
    ),
    // About a usual value: the parameter itself stays what it is there, and within its bounds.
    curve("parameter_curve", Parameter, Anything, "({z}{-usual})", &[]),
    curve(
        "parameter_square",
        Parameter,
        Anything,
        "({z}^2{-usual^2})",
        &[],
    ),
    // Rates of reactions and conductivities with temperature, viscosities.
    curve(
        "parameter_exponential",
        Parameter,
        Anything,
        "exp(({z}{-usual})/{s}) - 1",
        &[shape("s", Starts::Spread(&[-2.0, -0.6, 0.6, 2.0]), false)],
    ),
    // ... of reactions more exactly, with an activation temperature (Arrhenius).
    curve(
        "parameter_exponential",
        Parameter,
        Reciprocal,
        "exp(-{E}*({z}{-usual})) - 1",
        &[shape(
            "E",
            Starts::PerSpread(&[-1.5, -0.5, 0.5, 1.5]),
            false,
        )],
    ),
    // A gain of an angle that stands for its sine, also beside another factor.
    curve(
        "parameter_of_sine",
        Parameter,
        Angle,
        "(if abs({z}) > 1e-6 then sin({z})/{z} else 1.0) - 1",
        &[],
    ),
    // Gains that go round with an angle: eccentric magnets, gears, cranks.
    curve(
        "parameter_sine",
        Parameter,
        Angle,
        "sin({k}*{z} + {p})",
        WAVE,
    ),
    curve(
        "parameter_step",
        Parameter,
        Time,
        "(if time > {t0} then 1.0 else 0.0)",
        &[STEP],
    ),
    curve(
        "parameter_step",
        Parameter,
        Time,
        FOR_A_WHILE,
        &[STEP, WHILE],
    ),
    curve("parameter_ramp", Parameter, Time, "time", &[]),
    Term {
        id: "parameter_heating",
        port: Parameter,
        needs: Anything,
        form: "{m}",
        memories: &[Memory {
            rate: "({z}^2 - {m})/{T}",
            start: MemoryStart::Square,
            sampled: false,
        }],
        shapes: &[shape("T", Starts::Length(&[0.02, 0.1, 0.4]), true)],
        free_strength: true,
        symbol: "c",
        units: &["Ohm"],
    },
    Term {
        id: "input_saturation",
        port: Input,
        needs: BothSigns,
        form: "min(max({z}, -{L}), {L}) - {z}",
        memories: &[],
        shapes: &[LIMIT],
        free_strength: false,
        symbol: "",
        units: &[],
    },
    Term {
        id: "input_saturation",
        port: Input,
        needs: Anything,
        form: "min({z}, {L}) - {z}",
        memories: &[],
        shapes: &[UPPER_LIMIT],
        free_strength: false,
        symbol: "",
        units: &[],
    },
    Term {
        id: "input_saturation",
        port: Input,
        needs: Anything,
        form: "max({z}, {L}) - {z}",
        memories: &[],
        shapes: &[LOWER_LIMIT],
        free_strength: false,
        symbol: "",
        units: &[],
    },
    Term {
        id: "input_dead_zone",
        port: Input,
        needs: AboutZero,
        form: "max({z} - {d}, 0) + min({z} + {d}, 0) - {z}",
        memories: &[],
        shapes: &[DEAD_ZONE],
        free_strength: false,
        symbol: "",
        units: &[],
    },
    curve("input_asymmetry", Input, Directed, "max({z}, 0)", &[]),
    curve("input_asymmetry", Input, Directed, "min({z}, 0)", &[]),
    curve("input_square", Input, Anything, "{z}^2", &[]),
    curve("input_cube", Input, Anything, "{z}^3", &[]),
    later(Anything, "delay({z}, {T}) - {z}"),
    later(
        SwitchedOn,
        "(if time > {begin} + {T} then delay({z}, {T}) else 0.0) - {z}",
    ),
    lagging(Anything, &[lag(MemoryStart::Argument)]),
    lagging(SwitchedOn, &[lag(MemoryStart::Zero)]),
    in_place(
        "input_backlash",
        &[sampled("min(max({m}, {z} - {g}), {z} + {g})")],
        &[BACKLASH],
    ),
    // Magnetic or piezoelectric: goes to 1 the way the input moves (Dahl's curve), and holds where it stands.
    hysteresis(
        &[
            Memory {
                rate: "sign({z} - {p}) + ({m} - sign({z} - {p}))*exp(-abs({z} - {p})/{w})",
                start: MemoryStart::Zero,
                sampled: true,
            },
            sampled("{z}"),
        ],
        &[HYSTERESIS],
    ),
    // A valve that sticks until its signal is `S` away, and then slips to it, or until it is `o` away.
    in_place(
        "valve_stiction",
        &[sampled("if abs({z} - {m}) > {S} then {z} else {m}")],
        &[STICTION],
    ),
    in_place(
        "valve_stiction",
        &[sampled(
            "if abs({z} - {m}) > {S} then {z} - {o}*sign({z} - {m}) else {m}",
        )],
        &[STICTION, STOP],
    ),
    Term {
        id: "input_rate_limit",
        port: Input,
        needs: Anything,
        form: "{m} - {z}",
        memories: &[Memory {
            rate: "min(max(({z} - {m})*{fast}, -{R}), {R})",
            start: MemoryStart::Argument,
            sampled: false,
        }],
        shapes: &[shape(
            "R",
            Starts::Rate(&[0.001, 0.003, 0.01, 0.03, 0.1, 0.3]),
            true,
        )],
        free_strength: false,
        symbol: "",
        units: &[],
    },
    curve("sensor_offset", Sensor, Time, "1.0", &[]),
    curve("sensor_drift", Sensor, Time, "time", &[]),
    curve("sensor_scale", Sensor, Anything, "{z}", &[]),
    // With a zero that is wrong too.
    curve(
        "sensor_scale",
        Sensor,
        Anything,
        "{z} - {from}",
        &[shape("from", Starts::Quantiles(&[0.1, 0.5, 0.9]), false)],
    ),
    // A thermometer in the sun, an accelerometer that leans.
    curve("cross_coupling", Sensor, Another, "{z}", &[]),
    Term {
        id: "sensor_lag",
        port: Sensor,
        needs: Anything,
        form: "{m} - {z}",
        memories: &[Memory {
            rate: "({z} - {m})/{T}",
            start: MemoryStart::Argument,
            sampled: false,
        }],
        shapes: &[shape("T", Starts::Samples(&[0.5, 2.0, 6.0, 20.0]), true)],
        free_strength: false,
        symbol: "",
        units: &[],
    },
    Term {
        id: "sensor_rectification",
        port: Sensor,
        needs: Anything,
        form: "abs({z}) - {z}",
        memories: &[],
        shapes: &[],
        free_strength: false,
        symbol: "",
        units: &[],
    },
    Term {
        id: "sensor_saturation",
        port: Sensor,
        needs: Anything,
        form: "min(max({z}, {lower}), {upper}) - {z}",
        memories: &[],
        shapes: &[
            shape("lower", Starts::Quantiles(&[0.03, 0.1, 0.0]), false),
            shape("upper", Starts::Quantiles(&[0.97, 0.9, 1.0]), false),
        ],
        free_strength: false,
        symbol: "",
        units: &[],
    },
];

/// Ids of the effects of sensors.
pub(crate) fn sensor_effects() -> impl Iterator<Item = &'static str> {
    TERMS.iter().filter(|t| t.port == Sensor).map(|t| t.id)
}
