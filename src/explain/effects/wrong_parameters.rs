//! Not physics that was left out, but physics with another number: what a simulation may have slightly wrong.
//!
//! A wrong gain, stiffness, damping or mass is one number each. Without them among the boring explanations, an effect that
//! degenerates to one of them (a stop at the origin is a spring, a mass that changes at the beginning is another mass)
//! would win by having fewer numbers than a whole new plant.

use super::{Action, Clock, Definition, Moments, Needs, Parameter, Unit};

pub(super) static ENTRIES: &[Definition] = &[
    Definition {
        id: "input_gain",
        variant: "",
        name: "gain of the input",
        equation: "u_eff = (1 + g) u",
        parameters: &[Parameter::between("gain_change", Unit::Ratio, -3.0, 10.0)],
        mimics: &[],
        linear: &[0],
        persists: true,
        action: Action::Input(gain),
        starts: |_| Vec::new(),
    },
    Definition {
        id: "linear_stiffness",
        variant: "",
        name: "stiffness",
        equation: "F = -dk x",
        parameters: &[],
        mimics: &[],
        linear: &[],
        persists: true,
        action: Action::Linear(Needs::Position),
        starts: |_| Vec::new(),
    },
    Definition {
        id: "linear_damping",
        variant: "",
        name: "damping",
        equation: "F = -dd v",
        parameters: &[],
        mimics: &[],
        linear: &[],
        persists: true,
        action: Action::Linear(Needs::Rate),
        starts: |_| Vec::new(),
    },
    Definition {
        id: "linear_inertia",
        variant: "",
        name: "mass",
        equation: "F = -dm a",
        parameters: &[],
        mimics: &[],
        linear: &[],
        persists: true,
        action: Action::Linear(Needs::Acceleration),
        starts: |_| Vec::new(),
    },
];

fn gain(p: &[f64], u: &mut [f64], _: &mut [Moments], _: &Clock) {
    for u in u {
        *u *= 1.0 + p[0];
    }
}
