//! What an actuator does to a command in time: limits of its rate, delays, lags.

use super::{
    Action, Clock, Definition, InputLaw, Mimic, Moments, Observed, Parameter, Unit, level,
};

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

pub(super) fn rates(seen: &Observed) -> Vec<Vec<f64>> {
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
