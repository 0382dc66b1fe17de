//! What happens between the command that was recorded and the plant.

use super::{
    Action, Clock, Definition, InputLaw, Mimic, Moments, Observed, Parameter, Unit, level,
};

/// What tells a delay from a lag.
const A_STEP: &str = "faster sampling and a step: after a delay nothing moves at first, after a lag it moves at once";

const DELAY: &[Parameter] = &[Parameter::between("delay", Unit::Second, 0.0, 1e12)];
const TIME_CONSTANT: &[Parameter] = &[Parameter::positive("time_constant", Unit::Second)];

/// What happens to a command that is held over each interval: another reading of the law that acts between samples.
const fn of_command(
    (id, variant): (&'static str, &'static str),
    name: &'static str,
    equation: &'static str,
    parameters: &'static [Parameter],
    law: InputLaw,
) -> Definition {
    Definition {
        id,
        variant,
        name,
        equation,
        parameters,
        mimics: &[],
        linear: &[],
        persists: true,
        action: Action::Input(law),
        starts: |_| Vec::new(),
    }
}

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
        id: "input_rate_limit",
        variant: "",
        name: "rate limit of the actuator",
        equation: "|du_eff/dt| <= rate",
        parameters: &[Parameter::positive("rate", Unit::InputRate)],
        mimics: &[Mimic {
            effect: "actuator_lag",
            experiment: "steps of two sizes: a rate limit takes twice the time for twice the step, a lag the same time",
        }],
        linear: &[],
        persists: true,
        action: Action::Input(rate_limit),
        starts: rates,
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
        starts: |_| vec![vec![0.05]],
    },
    Definition {
        id: "input_delay",
        variant: "",
        name: "delay of the input",
        equation: "u_eff(t) = u(t - delay)",
        parameters: DELAY,
        mimics: &[Mimic {
            effect: "actuator_lag",
            experiment: A_STEP,
        }],
        linear: &[],
        persists: true,
        action: Action::Input(delay),
        starts: |seen| {
            [0.3, 1.0, 2.0, 4.0]
                .map(|samples| vec![samples * seen.step])
                .to_vec()
        },
    },
    Definition {
        id: "input_delay",
        variant: "from rest",
        name: "delay of the input",
        equation: "u_eff(t) = u(t - delay), zero before the recording",
        parameters: DELAY,
        mimics: &[Mimic {
            effect: "actuator_lag",
            experiment: A_STEP,
        }],
        linear: &[],
        persists: true,
        action: Action::Input(delay_from_rest),
        starts: |seen| {
            [0.3, 1.0, 2.0, 4.0]
                .map(|samples| vec![samples * seen.step])
                .to_vec()
        },
    },
    Definition {
        id: "actuator_lag",
        variant: "from rest",
        name: "lag of the actuator or of the sensor, which a linear plant does not tell apart,",
        equation: "tau du_eff/dt + u_eff = u, zero before the recording",
        parameters: TIME_CONSTANT,
        mimics: &[Mimic {
            effect: "input_delay",
            experiment: A_STEP,
        }],
        linear: &[],
        persists: true,
        action: Action::Input(lag_from_rest),
        starts: |seen| {
            [0.3, 1.0, 3.0, 10.0]
                .map(|samples| vec![samples * seen.step])
                .to_vec()
        },
    },
    Definition {
        id: "actuator_lag",
        variant: "",
        name: "lag of the actuator or of the sensor, which a linear plant does not tell apart,",
        equation: "tau du_eff/dt + u_eff = u",
        parameters: TIME_CONSTANT,
        mimics: &[Mimic {
            effect: "input_delay",
            experiment: A_STEP,
        }],
        linear: &[],
        persists: true,
        action: Action::Input(lag),
        starts: |seen| {
            [0.3, 1.0, 3.0, 10.0]
                .map(|samples| vec![samples * seen.step])
                .to_vec()
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
    of_command(
        ("input_rate_limit", "held"),
        "rate limit of the command, held between samples",
        "|u_eff[k] - u_eff[k-1]| <= rate h",
        &[Parameter::positive("rate", Unit::InputRate)],
        rate_limit_held,
    ),
    of_command(
        ("input_delay", "interpolated"),
        "delay of the command, interpolated and held between samples",
        "u_eff[k] = (1 - f) u[k-d] + f u[k-d-1]",
        DELAY,
        |p, u, _, clock| delay(p, u, &mut vec![[0.0; 2]; u.len()], clock),
    ),
    of_command(
        ("input_delay", "interpolated from rest"),
        "delay of the command, interpolated and held between samples",
        "u_eff[k] = (1 - f) u[k-d] + f u[k-d-1], zero before the recording",
        DELAY,
        |p, u, _, clock| delay_from_rest(p, u, &mut vec![[0.0; 2]; u.len()], clock),
    ),
    of_command(
        ("actuator_lag", "held"),
        "lag of the command, held between samples",
        "u_eff[k+1] = u_eff[k] + (1 - exp(-h/tau)) (u[k+1] - u_eff[k])",
        TIME_CONSTANT,
        |p, u, _, clock| lag_held(u.first().copied().unwrap_or(0.0), p, u, clock),
    ),
    of_command(
        ("actuator_lag", "held from rest"),
        "lag of the command, held between samples",
        "u_eff[k+1] = u_eff[k] + (1 - exp(-h/tau)) (u[k+1] - u_eff[k]), zero before the recording",
        TIME_CONSTANT,
        |p, u, _, clock| lag_held(0.0, p, u, clock),
    ),
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

fn rate_limit_held(p: &[f64], u: &mut [f64], _: &mut [Moments], clock: &Clock) {
    let most = p[0] * clock.step;
    let mut at = 0.0;
    for u in u {
        at += (*u - at).clamp(-most, most);
        *u = at;
    }
}

/// `at` is where the actuator was when the recording began.
fn lag_held(mut at: f64, p: &[f64], u: &mut [f64], clock: &Clock) {
    let share = -(-clock.step / p[0]).exp_m1();
    for u in u {
        at += share * (*u - at);
        *u = at;
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
    let mut held = 0.0;
    if let Some(first) = u.first() {
        held = *first - first.clamp(-p[0], p[0]);
    }
    for u in u {
        held = f64::clamp(held, *u - p[0], *u + p[0]);
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

/// A ramp over the share `ramp` of the interval, then constant.
fn rate_limit(p: &[f64], u: &mut [f64], moments: &mut [Moments], clock: &Clock) {
    let most = p[0] * clock.step;
    let mut at = u.first().copied().unwrap_or(0.0);
    for (u, moments) in u.iter_mut().zip(moments) {
        let wanted = *u - at;
        let moved = wanted.clamp(-most, most);
        let ramp = (moved.abs() / most).min(1.0);
        *u = at + moved * (1.0 - 0.5 * ramp);
        moments[0] += moved * ramp * (0.25 - ramp / 6.0);
        moments[1] -= moved * ramp * (1.0 - ramp).powi(2) / 12.0;
        at += moved;
    }
}

fn asymmetry(p: &[f64], u: &mut [f64], _: &mut [Moments], _: &Clock) {
    for u in u {
        *u += p[0] * u.abs();
    }
}

/// Between two samples the held command changes at the share of the interval that is delayed.
fn delay(p: &[f64], u: &mut [f64], moments: &mut [Moments], clock: &Clock) {
    let first = u.first().copied().unwrap_or(0.0);
    delay_after(first, p, u, moments, clock);
}

fn delay_from_rest(p: &[f64], u: &mut [f64], moments: &mut [Moments], clock: &Clock) {
    delay_after(0.0, p, u, moments, clock);
}

/// `start` is what the input was before the recording.
fn delay_after(start: f64, p: &[f64], u: &mut [f64], moments: &mut [Moments], clock: &Clock) {
    let samples = (p[0] / clock.step).clamp(0.0, u.len() as f64);
    let whole = samples.floor() as usize;
    let share = samples - samples.floor();
    let before = u.to_vec();
    let at = |k: usize, back: usize| if k < back { start } else { before[k - back] };
    for (k, (u, moments)) in u.iter_mut().zip(moments).enumerate() {
        let (new, old) = (at(k, whole), at(k, whole + 1));
        *u = new + share * (old - new);
        moments[0] += 0.5 * (new - old) * share * (1.0 - share);
        moments[1] -= (new - old) * share * (1.0 - share) * (1.0 - 2.0 * share) / 6.0;
    }
}

/// An exponential within each interval.
fn lag(p: &[f64], u: &mut [f64], moments: &mut [Moments], clock: &Clock) {
    let first = u.first().copied().unwrap_or(0.0);
    lag_after(first, p, u, moments, clock);
}

fn lag_from_rest(p: &[f64], u: &mut [f64], moments: &mut [Moments], clock: &Clock) {
    lag_after(0.0, p, u, moments, clock);
}

/// Share of an interval over a time constant below which series serve.
const LITTLE_DECAY: f64 = 0.03;

/// `start` is where the actuator was when the recording began.
fn lag_after(start: f64, p: &[f64], u: &mut [f64], moments: &mut [Moments], clock: &Clock) {
    let a = clock.step / p[0];
    let decay = (-a).exp();
    let mean_of_decay = -(-a).exp_m1() / a;
    // `int_0^1 (x - 1/2) exp(-a x) dx` and the same with `x^2 - x + 1/6`; the closed forms cancel where little decays.
    let moments_of_decay = if a < LITTLE_DECAY {
        [
            a * (-1.0 / 12.0 + a * (1.0 / 24.0 + a * (-1.0 / 80.0 + a / 360.0))),
            a * a * (1.0 / 360.0 + a * (-1.0 / 720.0 + a / 2520.0)),
        ]
    } else {
        let first = (mean_of_decay - decay) / a;
        let second = (2.0 * first - decay) / a;
        [
            first - 0.5 * mean_of_decay,
            second - first + mean_of_decay / 6.0,
        ]
    };
    let mut at = start;
    for (u, moments) in u.iter_mut().zip(moments) {
        let gap = at - *u;
        at = *u + gap * decay;
        *u += gap * mean_of_decay;
        moments[0] += gap * moments_of_decay[0];
        moments[1] += gap * moments_of_decay[1];
    }
}

fn reached(seen: &Observed) -> Vec<Vec<f64>> {
    [0.4, 0.6, 0.75, 0.85, 0.93, 0.97, 0.99]
        .map(|q| vec![below_the_top(&seen.channel, q).max(1e-12)])
        .to_vec()
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

fn rates(seen: &Observed) -> Vec<Vec<f64>> {
    let changes: Vec<f64> = seen
        .channel
        .windows(2)
        .map(|pair| (pair[1] - pair[0]).abs() / seen.step)
        .filter(|rate| *rate > 0.0)
        .collect();
    if changes.is_empty() {
        return Vec::new();
    }
    let top = level(&changes, 1.0, f64::abs);
    let mut starts: Vec<Vec<f64>> = [0.3, 0.6, 0.85, 0.95]
        .map(|q| vec![level(&changes, q, f64::abs)])
        .to_vec();
    // Commands that jump leave no levels between: shares of the largest jump, which then takes several samples.
    starts.extend([0.7, 0.4, 0.2, 0.1].map(|share| vec![share * top]));
    starts
}

#[cfg(test)]
mod tests;
