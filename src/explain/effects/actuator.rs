//! What happens between the command that was recorded and the plant.

use super::{Action, Clock, Definition, Mimic, Moments, Observed, Parameter, Unit, level};

/// What tells a delay from a lag.
pub(super) static ENTRIES: &[Definition] = &[
    Definition {
        id: "input_saturation",
        variant: "",
        name: "saturation of the input",
        equation: "u_eff = clamp(u, -limit, limit)",
        parameters: &[Parameter::positive("limit", Unit::Input)],
        mimics: &[Mimic {
            effect: "sensor_saturation",
            experiment: "a large slow input: a saturated actuator lowers the motion, a saturated sensor only what is shown of it",
        }],
        linear: &[],
        persists: true,
        action: Action::Input(saturate),
        starts: reached,
    },
    Definition {
        id: "input_saturation",
        variant: "upper",
        name: "saturation of the input on the upper side",
        equation: "u_eff = min(u, limit)",
        parameters: &[Parameter::real("limit", Unit::Input)],
        mimics: &[],
        linear: &[],
        persists: true,
        action: Action::Input(saturate_upper),
        starts: reached_upper,
    },
    Definition {
        id: "input_saturation",
        variant: "lower",
        name: "saturation of the input on the lower side",
        equation: "u_eff = max(u, limit)",
        parameters: &[Parameter::real("limit", Unit::Input)],
        mimics: &[],
        linear: &[],
        persists: true,
        action: Action::Input(saturate_lower),
        starts: reached_lower,
    },
    Definition {
        id: "input_saturation",
        variant: "range",
        name: "saturation of the input on both sides, each with a limit of its own",
        equation: "u_eff = clamp(u, lower_limit, upper_limit)",
        parameters: &[
            Parameter::real("lower_limit", Unit::Input),
            Parameter::real("upper_limit", Unit::Input),
        ],
        mimics: &[],
        linear: &[],
        persists: true,
        action: Action::Input(saturate_range),
        starts: reached_range,
    },
    Definition {
        id: "input_dead_zone",
        variant: "range",
        name: "dead zone of the input with an end of its own on each side",
        equation: "u_eff = u - clamp(u, lower_end, upper_end)",
        parameters: &[
            // Zero lies within: elsewhere it would be an offset of the input.
            Parameter::between("lower_end", Unit::Input, -1e12, 0.0),
            Parameter::between("upper_end", Unit::Input, 0.0, 1e12),
        ],
        mimics: &[],
        linear: &[],
        persists: true,
        action: Action::Input(dead_range),
        starts: dead_ranges,
    },
    Definition {
        id: "input_curve",
        variant: "",
        name: "characteristic of the input that is not a straight line",
        equation: "u_eff = u + c2 P2(s) + c3 P3(s) + c4 P4(s) + c5 P5(s), s = (u - centre)/half_range, P Legendre polynomials",
        parameters: &super::law::curve_parameters(Unit::Input, Unit::Input),
        mimics: &[Mimic {
            effect: "law",
            experiment: "steps of one size from several levels of the input at one level of the output",
        }],
        linear: super::law::CURVE_COEFFICIENTS,
        persists: true,
        action: Action::Input(curve),
        starts: |seen| super::law::curves(&seen.channel, 0.05),
    },
    Definition {
        id: "input_dead_zone",
        variant: "",
        name: "dead zone of the input",
        equation: "u_eff = u - clamp(u, -width, width)",
        parameters: &[Parameter::positive("width", Unit::Input)],
        mimics: &[Mimic {
            effect: "coulomb_friction",
            experiment: "a constant input plus a small sine: friction still acts, a dead zone does not",
        }],
        linear: &[],
        persists: true,
        action: Action::Input(dead_zone),
        starts: widths,
    },
    Definition {
        id: "input_backlash",
        variant: "",
        name: "backlash (play) at the input",
        equation: "u_eff follows u when u has moved by the gap",
        parameters: &[Parameter::positive("half_gap", Unit::Input)],
        mimics: &[
            Mimic {
                effect: "hysteresis",
                experiment: "a slow triangle at several amplitudes: play keeps its width, hysteresis does not",
            },
            Mimic {
                effect: "coulomb_friction",
                experiment: "reversals of the input while the plant moves on: play follows the command, friction the motion",
            },
        ],
        linear: &[],
        persists: true,
        action: Action::Input(play),
        starts: widths,
    },
    Definition {
        id: "input_backlash",
        variant: "from its gap",
        name: "backlash (play) at the input",
        equation: "u_eff follows u when u has moved by the gap, and is somewhere in it when the recording begins",
        parameters: &[
            Parameter::positive("half_gap", Unit::Input),
            Parameter::between("start_in_gap", Unit::Ratio, -1.0, 1.0),
        ],
        mimics: &[],
        linear: &[],
        persists: true,
        action: Action::Input(play_from_gap),
        // Grows out of the one that begins in the middle.
        starts: |_| Vec::new(),
    },
    Definition {
        id: "valve_stiction",
        variant: "",
        name: "stiction of the actuator, which stays and then jumps,",
        equation: "u_eff stays until u has moved by stick from where it last followed, then jumps to within stick - slip of u",
        parameters: &[
            Parameter::positive("stick", Unit::Input),
            Parameter::between("slip_share", Unit::Ratio, 0.0, 1.0),
        ],
        mimics: &[Mimic {
            effect: "input_backlash",
            experiment: "a slow ramp of the command: play follows without steps, stiction in steps",
        }],
        linear: &[],
        persists: true,
        action: Action::Input(stiction),
        starts: |seen| {
            widths(seen)
                .into_iter()
                .flat_map(|w| [0.5, 0.9].map(|share| vec![w[0], share]))
                .collect()
        },
    },
    Definition {
        id: "input_asymmetry",
        variant: "",
        name: "input gain that differs with the sign",
        equation: "u_eff = (1 + a) u for u > 0, (1 - a) u else",
        parameters: &[Parameter::between("asymmetry", Unit::Ratio, -1.0, 1.0)],
        mimics: &[Mimic {
            effect: "quadratic_stiffness",
            experiment: "steps up and down from several levels: an asymmetric actuator scales with the sign of the command alone",
        }],
        linear: &[0],
        persists: true,
        action: Action::Input(asymmetry),
        starts: |seen| match both_signs(&seen.channel) {
            true => vec![vec![0.05]],
            false => vec![],
        },
    },
    Definition {
        id: "input_saturation",
        variant: "soft",
        name: "saturation of the input with a soft knee",
        equation: "u_eff = u/(1 + |u/limit|^s)^(1/s)",
        parameters: &[Parameter::positive("limit", Unit::Input), SHARPNESS],
        mimics: &[],
        linear: &[],
        persists: true,
        action: Action::Input(saturate_softly),
        starts: |_| Vec::new(),
    },
];

/// Sharpness of a knee: infinite is a corner (Rapp's model of amplifier saturation).
pub(super) const SHARPNESS: Parameter = Parameter {
    lower: 1.0,
    upper: 100.0,
    ..Parameter::positive("knee_sharpness", Unit::Ratio)
};

fn saturate_softly(p: &[f64], u: &mut [f64], _: &mut [Moments], _: &Clock) {
    for u in u {
        *u = soft(*u, p[0], p[1]);
    }
}

/// `x/(1 + |x/limit|^sharpness)^(1/sharpness)`.
pub(super) fn soft(x: f64, limit: f64, sharpness: f64) -> f64 {
    let ratio = (x / limit).abs();
    if ratio > 1.0 {
        // Written with the inverse ratio, so that no power overflows.
        x.signum() * limit / (1.0 + ratio.powf(-sharpness)).powf(1.0 / sharpness)
    } else {
        x / (1.0 + ratio.powf(sharpness)).powf(1.0 / sharpness)
    }
}

fn saturate(p: &[f64], u: &mut [f64], _: &mut [Moments], _: &Clock) {
    for u in u {
        *u = u.clamp(-p[0], p[0]);
    }
}

fn saturate_upper(p: &[f64], u: &mut [f64], _: &mut [Moments], _: &Clock) {
    for u in u {
        *u = u.min(p[0]);
    }
}

fn saturate_lower(p: &[f64], u: &mut [f64], _: &mut [Moments], _: &Clock) {
    for u in u {
        *u = u.max(p[0]);
    }
}

fn saturate_range(p: &[f64], u: &mut [f64], _: &mut [Moments], _: &Clock) {
    for u in u {
        *u = u.max(p[0]).min(p[1]);
    }
}

fn dead_range(p: &[f64], u: &mut [f64], _: &mut [Moments], _: &Clock) {
    for u in u {
        *u -= u.max(p[0]).min(p[1]);
    }
}

fn curve(p: &[f64], u: &mut [f64], _: &mut [Moments], _: &Clock) {
    for u in u {
        *u += super::law::curve(p, *u);
    }
}

fn dead_zone(p: &[f64], u: &mut [f64], _: &mut [Moments], _: &Clock) {
    for u in u {
        *u -= u.clamp(-p[0], p[0]);
    }
}

fn play(p: &[f64], u: &mut [f64], _: &mut [Moments], _: &Clock) {
    // At rest in the middle of the gap when the recording begins.
    let first = u.first().copied().unwrap_or(0.0);
    carry(p[0], first - first.clamp(-p[0], p[0]), u);
}

fn play_from_gap(p: &[f64], u: &mut [f64], _: &mut [Moments], _: &Clock) {
    let first = u.first().copied().unwrap_or(0.0);
    carry(p[0], first + p[1] * p[0], u);
}

/// What is carried along at the ends of a gap, from where it is at the beginning.
fn carry(half_gap: f64, mut held: f64, u: &mut [f64]) {
    for u in u {
        held = f64::clamp(held, *u - half_gap, *u + half_gap);
        *u = held;
    }
}

/// Static and kinetic friction of a valve on a command (He, Wang, Pottmann and Qin 2007): what the command has moved adds up
/// until it exceeds static friction; the valve then moves until kinetic friction holds it.
fn stiction(p: &[f64], u: &mut [f64], _: &mut [Moments], _: &Clock) {
    let (stick, rest) = (p[0], p[0] * (1.0 - p[1]));
    let mut held = u.first().copied().unwrap_or(0.0);
    for u in u {
        let away = *u - held;
        if away.abs() > stick {
            held = *u - away.signum() * rest;
        }
        *u = held;
    }
}

fn asymmetry(p: &[f64], u: &mut [f64], _: &mut [Moments], _: &Clock) {
    for u in u {
        *u += p[0] * u.abs();
    }
}

fn reached(seen: &Observed) -> Vec<Vec<f64>> {
    [0.4, 0.6, 0.75, 0.85, 0.93, 0.97, 0.99]
        .map(|q| vec![below_the_top(&seen.channel, q).max(1e-12)])
        .to_vec()
}

/// Whether both signs occur: of an input of one sign a gain that depends on the sign is a gain.
fn both_signs(values: &[f64]) -> bool {
    values.iter().any(|v| *v < 0.0) && values.iter().any(|v| *v > 0.0)
}

/// A level that some of the samples exceed: the quantile, or, where the top is a plateau, a share of it.
fn below_the_top(values: &[f64], q: f64) -> f64 {
    let top = level(values, 1.0, f64::abs);
    level(values, q, f64::abs).min((0.4 + 0.58 * q) * top)
}

fn reached_upper(seen: &Observed) -> Vec<Vec<f64>> {
    [0.6, 0.85, 0.95]
        .map(|q| vec![level(&seen.channel, q, |v| v)])
        .to_vec()
}

fn reached_lower(seen: &Observed) -> Vec<Vec<f64>> {
    [0.4, 0.15, 0.05]
        .map(|q| vec![level(&seen.channel, q, |v| v)])
        .to_vec()
}

fn reached_range(seen: &Observed) -> Vec<Vec<f64>> {
    [
        (0.05, 0.95),
        (0.15, 0.85),
        (0.3, 0.7),
        (0.03, 0.8),
        (0.2, 0.97),
    ]
    .map(|(low, high)| {
        vec![
            level(&seen.channel, low, |v| v),
            level(&seen.channel, high, |v| v),
        ]
    })
    .to_vec()
}

fn dead_ranges(seen: &Observed) -> Vec<Vec<f64>> {
    let size = level(&seen.channel, 0.7, f64::abs).max(1e-12);
    [
        (0.0, 0.05),
        (0.0, 0.2),
        (-0.05, 0.0),
        (-0.2, 0.0),
        (-0.05, 0.2),
        (-0.2, 0.05),
    ]
    .map(|(low, high)| vec![low * size, high * size])
    .to_vec()
}

fn widths(seen: &Observed) -> Vec<Vec<f64>> {
    let size = level(&seen.channel, 0.7, f64::abs).max(1e-12);
    [0.02, 0.06, 0.15, 0.3, 0.6]
        .map(|share| vec![share * size])
        .to_vec()
}

#[cfg(test)]
mod tests;
