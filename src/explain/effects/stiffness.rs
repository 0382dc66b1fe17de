//! Forces of position: springs that are not linear, stops, hysteresis.

use super::{Action, Definition, Mimic, Motion, Needs, Observed, Parameter, Sense, Unit, level};

pub(super) static ENTRIES: &[Definition] = &[
    Definition {
        id: "cubic_stiffness",
        variant: "",
        name: "cubic stiffness",
        equation: "F = -k3 x^3",
        parameters: &[],
        mimics: &[Mimic {
            effect: "end_stop",
            experiment: "a slow ramp over the whole travel: a stop has a corner, a cubic spring has none",
        }],
        linear: &[],
        persists: true,
        action: Action::Force(cubic, Needs::Position, Sense::Either),
        starts: no_shape,
    },
    Definition {
        id: "cubic_stiffness",
        variant: "off centre",
        name: "cubic stiffness",
        equation: "F = -k3 (x - centre)^3, x at this instant of the sample interval",
        parameters: &[
            Parameter::real("centre", Unit::Position),
            Parameter::between("instant", Unit::Ratio, 0.0, 1.0),
        ],
        mimics: &[Mimic {
            effect: "end_stop",
            experiment: "a slow ramp over the whole travel: a stop has a corner, a cubic spring has none",
        }],
        linear: &[],
        persists: true,
        action: Action::Force(cubic_off_centre, Needs::Position, Sense::Either),
        // Grows out of the one about zero.
        starts: |_| Vec::new(),
    },
    Definition {
        id: "quadratic_stiffness",
        variant: "odd",
        name: "quadratic stiffness x|x|",
        equation: "F = -k2 x |x|",
        parameters: &[],
        mimics: &[Mimic {
            effect: "cubic_stiffness",
            experiment: "the same input at twice the amplitude: the stiffness gained doubles or quadruples",
        }],
        linear: &[],
        persists: true,
        action: Action::Force(odd_quadratic, Needs::Position, Sense::Either),
        starts: no_shape,
    },
    Definition {
        id: "quadratic_stiffness",
        variant: "even",
        name: "quadratic stiffness x^2",
        equation: "F = -k2 x^2",
        parameters: &[],
        mimics: &[Mimic {
            effect: "input_asymmetry",
            experiment: "a constant load plus a small sine: an even spring changes the resonance, an asymmetric actuator does not",
        }],
        linear: &[],
        persists: true,
        action: Action::Force(even_quadratic, Needs::Position, Sense::Either),
        starts: no_shape,
    },
    Definition {
        id: "end_stop",
        variant: "upper",
        name: "end stop",
        equation: "F = -k max(0, x - stop)",
        parameters: &[Parameter::real("stop_position", Unit::Position)],
        mimics: STOP_MIMICS,
        linear: &[],
        persists: true,
        action: Action::Force(upper_stop, Needs::Position, Sense::Resists),
        starts: upper_stops,
    },
    Definition {
        id: "end_stop",
        variant: "lower",
        name: "end stop",
        equation: "F = k max(0, stop - x)",
        parameters: &[Parameter::real("stop_position", Unit::Position)],
        mimics: STOP_MIMICS,
        linear: &[],
        persists: true,
        action: Action::Force(lower_stop, Needs::Position, Sense::Resists),
        starts: lower_stops,
    },
    Definition {
        id: "end_stop",
        variant: "both",
        name: "end stops on both sides",
        equation: "F = -k (x - clamp(x, -stop, stop))",
        parameters: &[Parameter::positive("stop_position", Unit::Position)],
        mimics: STOP_MIMICS,
        linear: &[],
        persists: true,
        action: Action::Force(both_stops, Needs::Position, Sense::Resists),
        starts: both_starts,
    },
    Definition {
        id: "end_stop",
        variant: "upper damped",
        name: "end stop that dissipates",
        equation: "F = -k max(0, x - stop + t v) for x > stop",
        parameters: &[
            Parameter::real("stop_position", Unit::Position),
            CONTACT_TIME,
        ],
        mimics: STOP_MIMICS,
        linear: &[],
        persists: true,
        action: Action::Force(upper_contact, Needs::Position, Sense::Resists),
        starts: |_| Vec::new(),
    },
    Definition {
        id: "end_stop",
        variant: "lower damped",
        name: "end stop that dissipates",
        equation: "F = k max(0, stop - x - t v) for x < stop",
        parameters: &[
            Parameter::real("stop_position", Unit::Position),
            CONTACT_TIME,
        ],
        mimics: STOP_MIMICS,
        linear: &[],
        persists: true,
        action: Action::Force(lower_contact, Needs::Position, Sense::Resists),
        starts: |_| Vec::new(),
    },
    Definition {
        id: "end_stop",
        variant: "both damped",
        name: "end stop that dissipates",
        equation: "F = -k (d + t v), d = x - clamp(x, -stop, stop), where that pushes back",
        parameters: &[
            Parameter::positive("stop_position", Unit::Position),
            CONTACT_TIME,
        ],
        mimics: STOP_MIMICS,
        linear: &[],
        persists: true,
        action: Action::Force(both_contacts, Needs::Position, Sense::Resists),
        starts: |_| Vec::new(),
    },
    Definition {
        id: "hysteresis",
        variant: "",
        name: "hysteresis (Bouc-Wen)",
        equation: "F = -Fh z, dz/dt = v/xy (1 - |z| (s sign(v z) + 1 - s))",
        parameters: &[
            Parameter::positive("yield_distance", Unit::Position),
            Parameter::between("loop_shape", Unit::Ratio, 0.0, 1.0),
        ],
        mimics: &[
            Mimic {
                effect: "coulomb_friction",
                experiment: "a slow triangle at several amplitudes: hysteresis yields over a distance, dry friction at once",
            },
            Mimic {
                effect: "input_backlash",
                experiment: "a slow triangle at several amplitudes: play keeps its width, hysteresis does not",
            },
        ],
        linear: &[],
        persists: true,
        action: Action::Force(bouc_wen, Needs::Position, Sense::Either),
        starts: yield_distances,
    },
    Definition {
        id: "cogging",
        variant: "",
        name: "force that repeats with the position (cogging)",
        equation: "F = -Fa sin(2 pi x/pitch + phase)",
        parameters: &[
            Parameter::positive("pitch", Unit::Position),
            Parameter::real("phase", Unit::Radian),
        ],
        mimics: &[Mimic {
            effect: "periodic_disturbance",
            experiment: "the same travel at twice the speed: cogging keeps its places, a disturbance keeps its times",
        }],
        linear: &[],
        persists: true,
        action: Action::Force(cogging, Needs::Position, Sense::Either),
        // Many periods in a travel: of other pitches than parts of a turn only the averaged equation of motion finds one.
        starts: parts_of_a_turn,
    },
    Definition {
        id: "gravity_torque",
        variant: "deg",
        name: "torque of gravity, which grows with the sine of the angle,",
        equation: "F = -k (sin(x) - x), x in degrees",
        parameters: &[],
        mimics: SINE_MIMICS,
        linear: &[],
        persists: true,
        action: Action::Force(gravity_degrees, Needs::Position, Sense::Either),
        starts: |seen| turns(seen, 360.0),
    },
    Definition {
        id: "gravity_torque",
        variant: "rad",
        name: "torque of gravity, which grows with the sine of the angle,",
        equation: "F = -k (sin(x) - x), x in radians",
        parameters: &[],
        mimics: SINE_MIMICS,
        linear: &[],
        persists: true,
        action: Action::Force(gravity_radians, Needs::Position, Sense::Either),
        starts: |seen| turns(seen, std::f64::consts::TAU),
    },
    Definition {
        id: "gravity_torque",
        variant: "deg from level",
        name: "torque of gravity, which is largest where the angle is zero,",
        equation: "F = -k (cos(x) - 1), x in degrees",
        parameters: &[],
        mimics: SINE_MIMICS,
        linear: &[],
        persists: true,
        action: Action::Force(level_degrees, Needs::Position, Sense::Either),
        starts: |seen| turns(seen, 360.0),
    },
    Definition {
        id: "gravity_torque",
        variant: "rad from level",
        name: "torque of gravity, which is largest where the angle is zero,",
        equation: "F = -k (cos(x) - 1), x in radians",
        parameters: &[],
        mimics: SINE_MIMICS,
        linear: &[],
        persists: true,
        action: Action::Force(level_radians, Needs::Position, Sense::Either),
        starts: |seen| turns(seen, std::f64::consts::TAU),
    },
    Definition {
        id: "law",
        variant: "",
        name: "force or flow that depends on the output along a curve",
        equation: "F = c2 P2(s) + c3 P3(s) + c4 P4(s) + c5 P5(s), s = (x - centre)/half_range, P Legendre polynomials",
        parameters: &super::law::curve_parameters(Unit::Position, Unit::Input),
        mimics: &[Mimic {
            effect: "input_curve",
            experiment: "steps of one size of the input at several levels of the output",
        }],
        linear: super::law::CURVE_COEFFICIENTS,
        persists: true,
        action: Action::Force(curve, Needs::Position, Sense::Either),
        starts: |seen| super::law::curves(&seen.channel, 1.0),
    },
    Definition {
        id: "position_dependent_gain",
        variant: "",
        name: "gain that depends on position",
        equation: "F = g x u",
        parameters: &[],
        mimics: &[Mimic {
            effect: "quadratic_stiffness",
            experiment: "small input steps at several positions: the response to them scales with the position",
        }],
        linear: &[],
        persists: true,
        action: Action::Force(input_times_position, Needs::Position, Sense::Either),
        starts: no_shape,
    },
];

/// Damping of a contact over its stiffness.
const CONTACT_TIME: Parameter = Parameter::positive("contact_damping_time", Unit::Second);

const STOP_MIMICS: &[Mimic] = &[
    Mimic {
        effect: "sensor_saturation",
        experiment: "a step that reaches the limit: a stop changes the motion before the limit is reached again, a sensor does not",
    },
    Mimic {
        effect: "cubic_stiffness",
        experiment: "a slow ramp over the whole travel: a stop has a corner, a cubic spring has none",
    },
];

const SINE_MIMICS: &[Mimic] = &[Mimic {
    effect: "cubic_stiffness",
    experiment: "angles beyond a right angle: gravity turns back there, a spring does not",
}];

/// What gravity takes off a linear torque: a simulation that is linear about the lower position has the rest.
fn gravity(angle: f64) -> f64 {
    angle - angle.sin()
}

fn gravity_degrees(_: &[f64], motion: &Motion, _: &mut [f64; 3]) -> f64 {
    motion.at_middle(|x| gravity(x.to_radians()).to_degrees())
}

fn gravity_radians(_: &[f64], motion: &Motion, _: &mut [f64; 3]) -> f64 {
    motion.at_middle(gravity)
}

/// The same of an angle that is zero where the arm is level.
fn level_degrees(_: &[f64], motion: &Motion, _: &mut [f64; 3]) -> f64 {
    motion.at_middle(|x| (1.0 - x.to_radians().cos()).to_degrees())
}

fn level_radians(_: &[f64], motion: &Motion, _: &mut [f64; 3]) -> f64 {
    motion.at_middle(|x| 1.0 - x.cos())
}

/// One start without a shape where the position moves as an angle does: over a tenth of a turn and not over many turns.
fn turns(seen: &Observed, turn: f64) -> Vec<Vec<f64>> {
    let most = level(&seen.channel, 0.998, f64::abs);
    if (0.1 * turn..2.0 * turn).contains(&(2.0 * most)) {
        vec![vec![]]
    } else {
        Vec::new()
    }
}

/// Pitches as parts of a turn, in degrees and in radians, as far as the position covers some and not too many of them, in two
/// phases each.
fn parts_of_a_turn(seen: &Observed) -> Vec<Vec<f64>> {
    const PARTS: [f64; 14] = [
        1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 9.0, 10.0, 12.0, 15.0, 18.0, 24.0, 36.0, 48.0,
    ];
    let (low, high) = (
        level(&seen.channel, 0.002, |v| v),
        level(&seen.channel, 0.998, |v| v),
    );
    [360.0, std::f64::consts::TAU]
        .iter()
        .flat_map(|turn| PARTS.map(|parts| turn / parts))
        .filter(|pitch| (1.0..200.0).contains(&((high - low) / pitch)))
        .flat_map(|pitch| [0.0, std::f64::consts::FRAC_PI_2].map(|phase| vec![pitch, phase]))
        .collect()
}

fn curve(p: &[f64], motion: &Motion, _: &mut [f64; 3]) -> f64 {
    motion.at_middle(|x| super::law::curve(p, x))
}

fn no_shape(_: &Observed) -> Vec<Vec<f64>> {
    vec![vec![]]
}

fn cubic(_: &[f64], motion: &Motion, _: &mut [f64; 3]) -> f64 {
    motion.at_middle(|x| -x * x * x)
}

/// About its own centre; and taken at a fitted instant of the sample interval, because a force that is held over the
/// interval stands for one that moves in it, which matters when an oscillation has few samples.
fn cubic_off_centre(p: &[f64], motion: &Motion, _: &mut [f64; 3]) -> f64 {
    motion.at_instant(p[1], |x| -(x - p[0]).powi(3))
}

fn odd_quadratic(_: &[f64], motion: &Motion, _: &mut [f64; 3]) -> f64 {
    motion.at_middle(|x| -x * x.abs())
}

fn even_quadratic(_: &[f64], motion: &Motion, _: &mut [f64; 3]) -> f64 {
    motion.at_middle(|x| -x * x)
}

fn cogging(p: &[f64], motion: &Motion, _: &mut [f64; 3]) -> f64 {
    motion.at_middle(|x| -(std::f64::consts::TAU * x / p[0] + p[1]).sin())
}

fn input_times_position(_: &[f64], motion: &Motion, _: &mut [f64; 3]) -> f64 {
    motion.middle() * motion.input
}

fn upper_stop(p: &[f64], motion: &Motion, _: &mut [f64; 3]) -> f64 {
    motion.at_middle(|x| -(x - p[0]).max(0.0))
}

fn lower_stop(p: &[f64], motion: &Motion, _: &mut [f64; 3]) -> f64 {
    motion.at_middle(|x| (p[0] - x).max(0.0))
}

fn both_stops(p: &[f64], motion: &Motion, _: &mut [f64; 3]) -> f64 {
    motion.at_middle(|x| x.clamp(-p[0], p[0]) - x)
}

/// Contact of stiffness 1 at penetration `depth` that grows with `speed`; it never pulls.
fn contact(depth: f64, speed: f64, time: f64) -> f64 {
    if depth > 0.0 {
        (depth + time * speed).max(0.0)
    } else {
        0.0
    }
}

fn upper_contact(p: &[f64], motion: &Motion, _: &mut [f64; 3]) -> f64 {
    -contact(motion.middle() - p[0], motion.middle_rate(), p[1])
}

fn lower_contact(p: &[f64], motion: &Motion, _: &mut [f64; 3]) -> f64 {
    contact(p[0] - motion.middle(), -motion.middle_rate(), p[1])
}

fn both_contacts(p: &[f64], motion: &Motion, _: &mut [f64; 3]) -> f64 {
    let (x, v) = (motion.middle(), motion.middle_rate());
    contact(-p[0] - x, -v, p[1]) - contact(x - p[0], v, p[1])
}

/// Sub-steps of a hysteresis between two samples.
const HYSTERESIS_STEPS: usize = 4;

/// Memory: the hysteretic variable in `[-1, 1]`, and the position it was last updated at.
fn bouc_wen(p: &[f64], motion: &Motion, memory: &mut [f64; 3]) -> f64 {
    let at = motion.middle();
    if motion.sample == 0 {
        memory[1] = motion.position;
    }
    let step = (at - memory[1]) / p[0] / HYSTERESIS_STEPS as f64;
    let mut z = memory[0];
    for _ in 0..HYSTERESIS_STEPS {
        let loading = if step * z >= 0.0 { 1.0 } else { -1.0 };
        z += step * (1.0 - z.abs() * (p[1] * loading + 1.0 - p[1]));
        z = z.clamp(-1.0, 1.0);
    }
    *memory = [z, at, 0.0];
    -z
}

const REACHED: [f64; 6] = [0.6, 0.75, 0.85, 0.92, 0.96, 0.99];

fn upper_stops(seen: &Observed) -> Vec<Vec<f64>> {
    REACHED
        .map(|q| vec![level(&seen.channel, q, |v| v)])
        .to_vec()
}

fn lower_stops(seen: &Observed) -> Vec<Vec<f64>> {
    REACHED
        .map(|q| vec![level(&seen.channel, 1.0 - q, |v| v)])
        .to_vec()
}

fn both_starts(seen: &Observed) -> Vec<Vec<f64>> {
    REACHED
        .map(|q| vec![level(&seen.channel, q, f64::abs).max(1e-12)])
        .to_vec()
}

fn yield_distances(seen: &Observed) -> Vec<Vec<f64>> {
    let size = level(&seen.channel, 0.8, f64::abs).max(1e-12);
    [0.02, 0.06, 0.2, 0.6]
        .map(|share| vec![share * size, 0.6])
        .to_vec()
}
