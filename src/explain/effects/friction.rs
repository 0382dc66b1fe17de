//! Forces that dissipate: dry friction with and without a breakaway force, drag.

mod lambert;

use self::lambert::exponential_w;
use super::{
    Action, Definition, Mimic, Motion, Needs, Observed, Parameter, Sense, Unit, decay, level,
};

const NO_BREAKAWAY: Mimic = Mimic {
    effect: "coulomb_friction",
    experiment: "slow constant velocities from standstill upwards: only Stribeck friction falls as the speed rises",
};
const LONG_LOOP: Mimic = Mimic {
    effect: "hysteresis",
    experiment: "a slow triangle at several amplitudes: the elastic part of dry friction is short",
};
const BREAKAWAY_EXCESS: Parameter = Parameter {
    lower: 0.02,
    upper: 20.0,
    ..Parameter::positive("breakaway_excess", Unit::Ratio)
};

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
        mimics: &[LONG_LOOP],
        linear: &[],
        persists: true,
        action: Action::Force(bristle, Needs::Position, Sense::Resists),
        starts: short_distances,
    },
    Definition {
        id: "coulomb_friction",
        variant: "bristles",
        name: "Coulomb friction with bristles",
        equation: "F = -Fc (z + tz dz/dt), dz/dt = v/zs (1 - z sign(v))",
        parameters: &[
            Parameter::positive("presliding_distance", Unit::Position),
            Parameter::positive("bristle_damping_time", Unit::Second),
        ],
        mimics: &[LONG_LOOP],
        linear: &[],
        persists: true,
        action: Action::Force(damped_bristle, Needs::Position, Sense::Resists),
        starts: |_| Vec::new(),
    },
    Definition {
        id: "coulomb_friction",
        variant: "smooth",
        name: "Coulomb friction with a smooth knee",
        equation: "F = -Fc tanh(v/w)",
        parameters: &[Parameter::positive("knee_width", Unit::Rate)],
        mimics: &[Mimic {
            effect: "quadratic_drag",
            experiment: "the same input at half and at twice the amplitude: drag grows with it, dry friction shrinks against it",
        }],
        linear: &[],
        persists: true,
        action: Action::Force(smooth, Needs::Rate, Sense::Resists),
        starts: |_| Vec::new(),
    },
    Definition {
        id: "stribeck_friction",
        variant: "",
        name: "friction with breakaway (Stribeck)",
        equation: "F = -Fc (1 + b exp(-(v/vs)^2)) sign(v), sticking at v = 0",
        parameters: &[
            BREAKAWAY_EXCESS,
            Parameter::positive("stribeck_velocity", Unit::Rate),
        ],
        mimics: &[NO_BREAKAWAY],
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
            BREAKAWAY_EXCESS,
            Parameter::positive("stribeck_velocity", Unit::Rate),
        ],
        mimics: &[NO_BREAKAWAY],
        linear: &[],
        persists: true,
        action: Action::Force(breakaway_bristle, Needs::Position, Sense::Resists),
        starts: |_| Vec::new(),
    },
    Definition {
        id: "stribeck_friction",
        variant: "bristles",
        name: "friction with breakaway (Stribeck) and bristles",
        equation: "F = -Fc (1 + b exp(-(v/vs)^2)) (z + tz dz/dt), dz/dt = v/zs (1 - z sign(v))",
        parameters: &[
            Parameter::positive("presliding_distance", Unit::Position),
            Parameter::positive("bristle_damping_time", Unit::Second),
            BREAKAWAY_EXCESS,
            Parameter::positive("stribeck_velocity", Unit::Rate),
        ],
        mimics: &[NO_BREAKAWAY],
        linear: &[],
        persists: true,
        action: Action::Force(damped_breakaway_bristle, Needs::Position, Sense::Resists),
        starts: |_| Vec::new(),
    },
    Definition {
        id: "direction_dependent_friction",
        variant: "",
        name: "viscous friction that depends on the direction",
        equation: "F = -b |v|",
        parameters: &[],
        mimics: &[Mimic {
            effect: "input_asymmetry",
            experiment: "a constant velocity each way, at two loads: an asymmetric actuator scales with the load, friction does not",
        }],
        linear: &[],
        persists: true,
        action: Action::Force(one_way_drag, Needs::Rate, Sense::Either),
        // Hardly seen in free run beside a constant load: only the averaged equation of motion asks for it.
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

/// Steps of the search for the force of a smooth knee; three are typical, halving alone reaches 1e-12.
const KNEE_STEPS: usize = 40;

fn no_shape(_: &Observed) -> Vec<Vec<f64>> {
    vec![vec![]]
}

fn coulomb(_: &[f64], motion: &Motion, _: &mut [f64; 3]) -> f64 {
    motion.stopping_force(1.0)
}

/// Saturates over a width of the speed, as friction in a lubricated or an elastic contact does. The force that is held
/// over the interval is that of the speed in its middle, which it acts on itself: at no width this is Moreau's step.
fn smooth(p: &[f64], motion: &Motion, _: &mut [f64; 3]) -> f64 {
    let gain = (0.5 * motion.rate_gain).max(0.0);
    let free = motion.middle_rate();
    // `f - tanh((free - gain f)/w)` rises with f: Newton's steps within a bracket that shrinks.
    let (mut low, mut high) = if free < 0.0 { (-1.0, 0.0) } else { (0.0, 1.0) };
    let mut f = (free / (p[0] + gain)).tanh();
    for _ in 0..KNEE_STEPS {
        let t = ((free - gain * f) / p[0]).tanh();
        let excess = f - t;
        if excess > 0.0 {
            high = f;
        } else {
            low = f;
        }
        let next = f - excess / (1.0 + gain / p[0] * (1.0 - t * t));
        let next = if next >= low && next <= high {
            next
        } else {
            0.5 * (low + high)
        };
        let settled = (next - f).abs() < 1e-10;
        f = next;
        if settled {
            break;
        }
    }
    -f
}

/// Dahl's law ([`bristle_force`] without damping).
fn bristle(p: &[f64], motion: &Motion, memory: &mut [f64; 3]) -> f64 {
    bristle_force(1.0, p[0], 0.0, motion, memory)
}

/// Bristles with damping of their own: LuGre friction (Canudas de Wit et al. 1995) of constant strength.
fn damped_bristle(p: &[f64], motion: &Motion, memory: &mut [f64; 3]) -> f64 {
    bristle_force(1.0, p[0], p[1], motion, memory)
}

/// [`bristle`] whose strength falls with the speed.
fn breakaway_bristle(p: &[f64], motion: &Motion, memory: &mut [f64; 3]) -> f64 {
    let slow = motion.middle_rate() / p[2];
    bristle_force(1.0 + p[1] * decay(slow * slow), p[0], 0.0, motion, memory)
}

/// LuGre friction.
fn damped_breakaway_bristle(p: &[f64], motion: &Motion, memory: &mut [f64; 3]) -> f64 {
    let slow = motion.middle_rate() / p[3];
    bristle_force(1.0 + p[2] * decay(slow * slow), p[0], p[1], motion, memory)
}

/// Mean force over the interval of bristles that yield over `distance` and are damped over `time`.
///
/// The deflection follows the position exactly (its law integrates in closed form over a monotone move), at the
/// position in the middle of the interval that the force brings about itself: stiff bristles would be unstable
/// otherwise. With `x` the move in that time in units of `distance`, along itself, this is `x = c + a exp(-x)`, which
/// Lambert's W solves. Memory: deflection in units of the largest, and the position it was last updated at.
fn bristle_force(
    strength: f64,
    distance: f64,
    time: f64,
    motion: &Motion,
    memory: &mut [f64; 3],
) -> f64 {
    if motion.sample == 0 {
        memory[1] = motion.position;
    }
    let (before, from) = (memory[0], memory[1]);
    let free = motion.middle();
    let damping = time / motion.clock.step;
    let gain = (0.5 * motion.position_gain * strength).max(0.0);
    // It moves to the side that is left when the bristles hold on with the force they have.
    let side = (free - from - gain * before).signum();
    let (before, free_move) = (side * before, side * (free - from));
    // Share of the way to the saturated force that is left.
    let slack = 1.0 - before;
    let held = gain * (1.0 + damping) * slack / distance;
    let base = (free_move - gain * before) / distance - held;
    let (moved, left) = if held > 0.0 {
        let shrunk = exponential_w(held.ln() - base);
        (base + shrunk, shrunk / held)
    } else {
        (base, decay(base))
    };
    let z = (1.0 - slack * left).clamp(-1.0, 1.0);
    let f = z + damping * (z - before);
    *memory = [side * z, from + side * distance * moved, 0.0];
    -strength * side * f
}

fn stribeck(p: &[f64], motion: &Motion, _: &mut [f64; 3]) -> f64 {
    let slow = motion.middle_rate() / p[1];
    motion.stopping_force(1.0 + p[0] * decay(slow * slow))
}

fn one_way_drag(_: &[f64], motion: &Motion, _: &mut [f64; 3]) -> f64 {
    motion.at_middle_rate(|v| -v.abs())
}

fn drag(_: &[f64], motion: &Motion, _: &mut [f64; 3]) -> f64 {
    motion.at_middle_rate(|v| -v * v.abs())
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
