//! Parameters that change at some time.

use super::{Action, Clock, Definition, Mimic, Moments, Motion, Needs, Parameter, Sense, Unit};

pub(super) static ENTRIES: &[Definition] = &[
    Definition {
        id: "gain_change",
        variant: "",
        name: "gain that changes at some time",
        equation: "u_eff = (1 + g) u for t >= t0",
        parameters: &[
            Parameter::between("change", Unit::Ratio, -3.0, 3.0),
            Parameter::real("from", Unit::Second),
        ],
        mimics: &[Mimic {
            effect: "stiffness_change",
            experiment: "a sweep before and after: a stiffness moves the resonance, a gain does not",
        }],
        linear: &[0],
        persists: true,
        action: Action::Input(gain),
        starts: |seen| seen.change_times.iter().map(|t| vec![0.02, *t]).collect(),
    },
    Definition {
        id: "stiffness_change",
        variant: "",
        name: "stiffness that changes at some time",
        equation: "F = -dk x for t >= t0",
        parameters: &[Parameter::real("from", Unit::Second)],
        mimics: &[Mimic {
            effect: "gain_change",
            experiment: "a sweep before and after: a stiffness moves the resonance, a gain does not",
        }],
        linear: &[],
        persists: true,
        action: Action::Force(stiffness, Needs::Position, Sense::Either),
        starts: |seen| seen.change_times.iter().map(|t| vec![*t]).collect(),
    },
    Definition {
        id: "mass_change",
        variant: "",
        name: "mass (inertia, capacity) that changes at some time",
        equation: "dv/dt -> dv/dt m/(m + dm) for t >= t0",
        parameters: &[Parameter::real("from", Unit::Second)],
        mimics: &[Mimic {
            effect: "gain_change",
            experiment: "a constant input before and after: a gain moves the level that is reached, a mass does not",
        }],
        linear: &[],
        persists: true,
        action: Action::Force(inertia, Needs::Rate, Sense::Either),
        starts: |seen| seen.change_times.iter().map(|t| vec![*t]).collect(),
    },
];

fn gain(p: &[f64], u: &mut [f64], _: &mut [Moments], clock: &Clock) {
    for (k, u) in u.iter_mut().enumerate() {
        *u *= 1.0 + p[0] * clock.share_after(k, p[1]);
    }
}

/// A mass is never less than this share of what it was.
const LEAST_MASS: f64 = 0.01;

/// A mass takes the force that accelerates it off the rest, which it makes slower itself: `a = a_free m/(m + dm)`.
fn inertia(p: &[f64], motion: &Motion, _: &mut [f64; 3]) -> f64 {
    let free = (motion.rate_free - motion.rate) / motion.clock.step;
    let share = motion.clock.share_after(motion.sample, p[0]);
    // What a unit of the force does to the rate over the step is `dm/m` times the step.
    let heavier = (1.0 + share * motion.rate_gain / motion.clock.step).max(LEAST_MASS);
    -share * free / heavier
}

fn stiffness(p: &[f64], motion: &Motion, _: &mut [f64; 3]) -> f64 {
    -motion.middle() * motion.clock.share_after(motion.sample, p[0])
}
