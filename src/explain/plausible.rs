//! Physics that contradicts itself, and effects that only make up for wrong parameters.

use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::effects::{self, Action, Sense, Unit};
use super::fit::{Effort, Fit, Problem};
use super::inquiry::{NEEDED, penalty};
use super::search::{Boring, Ranked};
use super::structure::{Functionals, Signal, dot};

/// Probability of a larger difference when the plant is as it was given.
const SAME_PLANT: f64 = 1e-3;

/// Share of the samples that a threshold must leave on either side of it.
const VISITED: f64 = 0.002;

/// A typical speed of the signal that effect `index` looks at.
pub(crate) fn speed_scale(problem: &Problem, fit: &Fit, index: usize) -> f64 {
    let h = problem.data.sample_time;
    let size = |series: usize| -> Vec<f64> {
        match fit.structure.effects[index].signal {
            Signal::Integral(_) => fit.simulated[series].clone(),
            _ => fit.simulated[series]
                .windows(2)
                .map(|p| (p[1] - p[0]) / h)
                .collect(),
        }
    };
    let output = match fit.structure.effects[index].signal {
        Signal::Output(o) | Signal::Integral(o) | Signal::Difference(o, _) => o,
    };
    effects::level(&size(output), 0.8, f64::abs).max(1e-12)
}

/// Whether force `index` acts against its usual sense.
pub(crate) fn pulls(fit: &Fit, index: usize) -> bool {
    let plant = fit.structure.plant(&fit.theta);
    let rows = Functionals::new(&plant);
    let signal = rows.of(&plant, fit.structure.effects[index].signal);
    let direction = fit.structure.direction(&fit.theta, &plant, &rows, index);
    dot(&signal.rate, &direction) < 0.0
}

/// An effect fitted beside the given plant stands only while a free plant does not do significantly better with the
/// same effect: else the effect makes up for wrong parameters (math/explain.md, choice 5).
pub(crate) fn plant_may_stay(ranked: &Ranked, all: &[Ranked]) -> bool {
    if ranked.fit.structure.plant_free {
        return true;
    }
    let effect = &ranked.fit.structure.new_effects()[0];
    all.iter()
        .filter(|other| {
            other.fit.structure.plant_free && other.fit.structure.new_effects()[0].is_same(effect)
        })
        .all(|other| {
            let more = other.fit.free.saturating_sub(ranked.fit.free).max(1);
            let gained = ranked.fit.deviance - other.fit.deviance;
            ChiSquared::new(more as f64).map_or(true, |d| d.sf(gained.max(0.0)) > SAME_PLANT)
        })
}

/// Fits with the plant free for the best that stand beside the given plant only, so that they can be compared.
pub(crate) fn add_free_twins(
    problem: &Problem,
    boring: &Boring,
    ranked: &mut Vec<Ranked>,
    base: f64,
) {
    let count = problem.count();
    let lonely: Vec<Ranked> = ranked
        .iter()
        .filter(|r| {
            let e = &r.fit.structure.new_effects()[0];
            !r.fit.structure.plant_free
                && base - r.criterion > NEEDED
                && !ranked.iter().any(|o| {
                    o.fit.structure.plant_free && o.fit.structure.new_effects()[0].is_same(e)
                })
        })
        .cloned()
        .collect();
    let twins: Vec<Ranked> = lonely
        .into_par_iter()
        .filter_map(|r| {
            let full = &boring.full.structure;
            let mut structure = full.clone();
            structure
                .effects
                .extend_from_slice(r.fit.structure.new_effects());
            let linear = r.fit.structure.effect_offset(r.fit.structure.first_new());
            let mut theta = full.given();
            if r.fit.structure.initial_free {
                let from = full.coordinates.len();
                let states = full.states() * full.initial.len();
                theta[from..from + states].copy_from_slice(&r.fit.theta[..states]);
            }
            theta.extend_from_slice(&r.fit.theta[linear..]);
            let fit = Fit::run(problem, structure, theta, Some(&r.fit.noise), Effort::RANK)?;
            Some(Ranked {
                criterion: fit.criterion(count),
                fit,
            })
        })
        .collect();
    for mut twin in twins {
        if sane(problem, &twin.fit) {
            twin.criterion += penalty(&twin, base, count);
            ranked.push(twin);
        }
    }
}

/// Physics that contradicts itself is no explanation.
pub(crate) fn sane(problem: &Problem, fit: &Fit) -> bool {
    let plant = fit.structure.plant(&fit.theta);
    let rows = Functionals::new(&plant);
    (fit.structure.first_new()..fit.structure.effects.len()).all(|index| {
        let effect = &fit.structure.effects[index];
        let shape = fit.structure.shape(&fit.theta, index);
        if let Action::Force(_, _, sense) = effect.definition.action {
            let signal = rows.of(&plant, effect.signal);
            let direction = fit.structure.direction(&fit.theta, &plant, &rows, index);
            if sense == Sense::Resists && dot(&signal.rate, &direction) <= 0.0 {
                return false;
            }
        }
        let length: f64 = problem.data.segments[0].samples() as f64 * problem.data.sample_time;
        let start = problem.data.segments[0].start_time;
        effect
            .definition
            .parameters
            .iter()
            .zip(&shape)
            .all(|(p, v)| match (p.name, p.unit) {
                // A change needs something before and after it.
                ("from", Unit::Second) => *v > start + 0.02 * length && *v < start + 0.98 * length,
                ("limit" | "width" | "stop_position", unit) => {
                    visited(problem, fit, index, unit, *v)
                }
                ("presliding_distance", _) => *v < 0.5 * travel(problem, fit, index),
                ("breakaway_excess", _) => *v > 0.05,
                ("stribeck_velocity", _) => *v < 1.5 * speed_scale(problem, fit, index),
                _ => true,
            })
    })
}

/// Whether the motion is on both sides of the threshold `v` often enough for it to be seen.
fn visited(problem: &Problem, fit: &Fit, index: usize, unit: Unit, v: f64) -> bool {
    let effect = &fit.structure.effects[index];
    let two_sided = effect.definition.parameters[0].logarithmic;
    let values: Vec<f64> = match (unit, effect.signal) {
        (Unit::Input, _) => problem
            .data
            .segments
            .iter()
            .flat_map(|s| s.inputs[effect.channel].clone())
            .collect(),
        (_, Signal::Output(o)) => {
            // Before the sensor: the motion itself may go beyond what is shown.
            let mut bare = fit.structure.clone();
            let mut theta = fit.theta.clone();
            if matches!(effect.definition.action, Action::Sensor(_))
                && bare.effects.len() == index + 1
            {
                theta.truncate(bare.effect_offset(index));
                bare.effects.truncate(index);
            }
            let simulated = bare
                .simulate(&theta, problem.data)
                .unwrap_or_else(|| fit.simulated.clone());
            simulated
                .iter()
                .skip(o)
                .step_by(problem.data.outputs)
                .flatten()
                .copied()
                .collect()
        }
        (_, Signal::Difference(i, j)) => fit.simulated[i]
            .iter()
            .zip(&fit.simulated[j])
            .map(|(a, b)| a - b)
            .collect(),
        (_, Signal::Integral(_)) => return true,
    };
    let beyond = values
        .iter()
        .filter(|x| if two_sided { x.abs() > v } else { **x > v })
        .count() as f64;
    let n = values.len().max(1) as f64;
    beyond > VISITED * n && beyond < (1.0 - VISITED) * n
}

/// Half the range of the position that effect `index` looks at, as far as outputs tell.
fn travel(problem: &Problem, fit: &Fit, index: usize) -> f64 {
    let h = problem.data.sample_time;
    let of = |y: &[f64]| effects::level(y, 0.95, f64::abs);
    match fit.structure.effects[index].signal {
        Signal::Output(o) => of(&fit.simulated[o]),
        Signal::Difference(i, j) => of(&fit.simulated[i]) + of(&fit.simulated[j]),
        Signal::Integral(o) => {
            let mut at = 0.0;
            let path: Vec<f64> = fit.simulated[o]
                .iter()
                .map(|v| {
                    at += v * h;
                    at
                })
                .collect();
            of(&path)
        }
    }
}
