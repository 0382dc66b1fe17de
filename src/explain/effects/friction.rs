//! Forces that dissipate: dry friction with and without a breakaway force, drag.

use super::{Action, Definition, Mimic, Motion, Needs, Observed, Parameter, Sense, Unit, level};

pub(super) static ENTRIES: &[Definition] = &[
    Definition {
        id: "coulomb_friction",
        variant: "",
        name: "Coulomb friction",
        equation: "F = -Fc sign(v), sticking at v = 0",
        parameters: &[],
        mimics: &[
            Mimic {
                effect: "stribeck_friction",
                experiment: "slow constant velocities from standstill upwards: only Stribeck friction falls as the speed rises",
            },
            Mimic {
                effect: "hysteresis",
                experiment: "a slow triangle at several amplitudes: dry friction makes the same loop height at all of them",
            },
            Mimic {
                effect: "input_dead_zone",
                experiment: "a constant input plus a small sine: friction still acts, a dead zone does not",
            },
        ],
        linear: &[],
        persists: true,
        action: Action::Force(coulomb, Needs::Rate, Sense::Resists),
        starts: no_shape,
    },
    Definition {
        id: "coulomb_friction",
        variant: "presliding",
        name: "Coulomb friction with elastic pre-sliding",
        equation: "F = -Fc z, dz/dt = v/zs (1 - z sign(v))",
        parameters: &[Parameter::positive("presliding_distance", Unit::Position)],
        mimics: &[Mimic {
            effect: "hysteresis",
            experiment: "a slow triangle at several amplitudes: the elastic part of dry friction is short",
        }],
        linear: &[],
        persists: true,
        action: Action::Force(bristle, Needs::Position, Sense::Resists),
        starts: short_distances,
    },
    Definition {
        id: "stribeck_friction",
        variant: "",
        name: "friction with breakaway (Stribeck)",
        equation: "F = -Fc (1 + b exp(-(v/vs)^2)) sign(v), sticking at v = 0",
        parameters: &[
            Parameter {
                lower: 0.02,
                upper: 20.0,
                ..Parameter::positive("breakaway_excess", Unit::Ratio)
            },
            Parameter::positive("stribeck_velocity", Unit::Rate),
        ],
        mimics: &[Mimic {
            effect: "coulomb_friction",
            experiment: "slow constant velocities from standstill upwards: only Stribeck friction falls as the speed rises",
        }],
        linear: &[],
        persists: true,
        action: Action::Force(stribeck, Needs::Rate, Sense::Resists),
        starts: stribeck_velocities,
    },
    Definition {
        id: "stribeck_friction",
        variant: "presliding",
        name: "friction with breakaway (Stribeck) and elastic pre-sliding",
        equation: "F = -Fc (1 + b exp(-(v/vs)^2)) z, dz/dt = v/zs (1 - z sign(v))",
        parameters: &[
            Parameter::positive("presliding_distance", Unit::Position),
            Parameter {
                lower: 0.02,
                upper: 20.0,
                ..Parameter::positive("breakaway_excess", Unit::Ratio)
            },
            Parameter::positive("stribeck_velocity", Unit::Rate),
        ],
        mimics: &[Mimic {
            effect: "coulomb_friction",
            experiment: "slow constant velocities from standstill upwards: only Stribeck friction falls as the speed rises",
        }],
        linear: &[],
        persists: true,
        action: Action::Force(breakaway_bristle, Needs::Position, Sense::Resists),
        starts: |_| Vec::new(),
    },
    Definition {
        id: "quadratic_drag",
        variant: "",
        name: "quadratic drag",
        equation: "F = -k v |v|",
        parameters: &[],
        mimics: &[Mimic {
            effect: "coulomb_friction",
            experiment: "the same input at half and at twice the amplitude: drag grows with it, dry friction shrinks against it",
        }],
        linear: &[],
        persists: true,
        action: Action::Force(drag, Needs::Rate, Sense::Resists),
        starts: no_shape,
    },
];

fn no_shape(_: &Observed) -> Vec<Vec<f64>> {
    vec![vec![]]
}

fn coulomb(_: &[f64], motion: &Motion, _: &mut [f64; 2]) -> f64 {
    motion.stopping_force(1.0)
}

/// Dahl's law, exact for the distance moved, at the position in the middle of the interval that it brings about
/// itself (one secant step: stiff bristles would be unstable otherwise). Memory: deflection of the bristles in units
/// of their largest, and the position it was last updated at.
fn bristle(p: &[f64], motion: &Motion, memory: &mut [f64; 2]) -> f64 {
    bristle_of_strength(1.0, p, motion, memory)
}

fn bristle_of_strength(strength: f64, p: &[f64], motion: &Motion, memory: &mut [f64; 2]) -> f64 {
    if motion.sample == 0 {
        memory[1] = motion.position;
    }
    let free = motion.middle();
    let deflected = |at: f64| {
        let moved = at - memory[1];
        let side = moved.signum();
        side - (side - memory[0]) * (-moved.abs() / p[0]).exp()
    };
    // z -> deflection at the position that -z brings about; its fixed point is sought.
    let half_gain = 0.5 * motion.position_gain * strength;
    let z0 = deflected(free);
    let z1 = deflected(free - half_gain * z0);
    let slope = z0 - z1;
    // With f(0) = z0 and f(z0) = z1 the secant's fixed point is z0^2/(z0 + z0 - z1).
    let denominator = z0 + slope;
    let z = if denominator.abs() > 1e-12 && (z0 * z0 / denominator).abs() <= 1.0 {
        z0 * z0 / denominator
    } else {
        z1
    };
    let at = free - half_gain * z;
    memory[0] = deflected(at).clamp(-1.0, 1.0);
    memory[1] = at;
    -strength * z.clamp(-1.0, 1.0)
}

/// [`bristle`] whose strength falls with the speed: LuGre friction without its micro-damping.
fn breakaway_bristle(p: &[f64], motion: &Motion, memory: &mut [f64; 2]) -> f64 {
    let slow = motion.middle_rate() / p[2];
    bristle_of_strength(1.0 + p[1] * (-slow * slow).exp(), p, motion, memory)
}

fn stribeck(p: &[f64], motion: &Motion, _: &mut [f64; 2]) -> f64 {
    let slow = motion.middle_rate() / p[1];
    motion.stopping_force(1.0 + p[0] * (-slow * slow).exp())
}

fn drag(_: &[f64], motion: &Motion, _: &mut [f64; 2]) -> f64 {
    let v = motion.middle_rate();
    -v * v.abs()
}

/// Pre-sliding is short against the motion: percents of it.
fn short_distances(seen: &Observed) -> Vec<Vec<f64>> {
    let size = level(&seen.channel, 0.9, f64::abs);
    [0.003, 0.01, 0.03].map(|share| vec![share * size]).to_vec()
}

fn stribeck_velocities(seen: &Observed) -> Vec<Vec<f64>> {
    let size = level(&seen.rate, 0.7, f64::abs);
    [0.03, 0.1, 0.3]
        .map(|share| vec![0.5, share * size])
        .to_vec()
}
