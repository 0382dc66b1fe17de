//! Physics that contradicts itself, and effects that only make up for wrong parameters.

#[cfg(test)]
mod tests;

use std::sync::Arc;

use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::null_models::Boring;
use super::penalties::{NEEDED, penalty};
use super::single_effects::Ranked;
use crate::explain::effects::{self, Action, Sense, Unit};
use crate::explain::linear::fit::{Effort, Fit, Problem};
use crate::explain::linear::identification::step_response_test::Uncertainty;
use crate::explain::linear::model::functionals::{Functionals, Signal, dot};
use crate::explain::linear::model::structure::Direction;

/// Probability of a larger difference when the plant is as it was given.
const SAME_PLANT: f64 = 1e-3;

/// Probability of a larger shortfall against free parameters when the effect is the truth.
const SHORT_OF_FULL: f64 = 0.05;

/// A knee of friction that is narrower than this part of the typical speed is a corner: the plain law has the same free run, and
/// the slope within the knee is that of rounding.
const CORNER: f64 = 1e-3;

/// Share of the samples that a threshold must leave on either side of it.
const VISITED: f64 = 0.002;

/// A breakaway force that exceeds sliding friction by less is what every dry contact does, and no Stribeck curve.
const BREAKAWAY: f64 = 0.1;

/// Magnitudes that differ by less are one.
const ONE_MAGNITUDE: f64 = 0.01;

/// A loop that closes within a smaller share of the travel is dry friction with elastic contacts and no hysteresis of the
/// material (presliding is micrometres of a travel of millimetres: Armstrong-Helouvry, Dupont and Canudas de Wit 1994, sec. 3).
const RESOLVED_LOOP: f64 = 0.01;

/// A motion that is in contact for longer than this share of the time has no stop but another plant.
const MOSTLY_FREE: f64 = 0.5;

/// A mode with more damping has no peak (the response of second order has one below 1/sqrt(2)): it is no resonance.
const RESONANT: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Fewer periods in a recording are a trend and no periodic disturbance, and fewer in a travel are a curve and no cogging.
pub(crate) const FEWEST_PERIODS: f64 = 2.0;

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

/// An effect fitted beside the given plant stands only while a free plant does not do significantly better with the
/// same effect: else the effect makes up for wrong parameters (math/explain.md, choice 5).
///
/// A simulation that was identified is uncertain itself: a free plant that differs from it by no more than both are uncertain
/// by is the same plant.
pub(crate) fn plant_may_stay(
    problem: &Problem,
    ranked: &Ranked,
    all: &[Ranked],
    uncertainty: Option<&Uncertainty>,
) -> bool {
    if ranked.fit.structure.plant_free {
        return true;
    }
    let effect = &ranked.fit.structure.new_effects()[0];
    all.iter()
        .filter(|other| {
            other.fit.structure.plant_free && other.fit.structure.new_effects()[0].is_same(effect)
        })
        .all(|other| {
            if let Some(p) = uncertainty.and_then(|known| known.p_value(problem, &other.fit)) {
                return p > SAME_PLANT;
            }
            let more = other.fit.free.saturating_sub(ranked.fit.free).max(1);
            let gained = ranked.fit.deviance - other.fit.deviance;
            ChiSquared::new(more as f64).map_or(true, |d| d.sf(gained.max(0.0)) > SAME_PLANT)
        })
}

/// Whether an effect beside the plant as given explains as much as other parameters do: it wins by fewer numbers, and
/// where those explain significantly more it stands for them (math/explain.md, choice 5). The parameters of a simulation that was
/// identified have errors of their own: an effect must explain more than other parameters do.
pub(crate) fn reaches(fit: &Fit, full: &Fit, identified: bool) -> bool {
    if fit.structure.plant_free {
        return true;
    }
    let short = fit.deviance - full.deviance;
    if identified {
        return short < -NEEDED;
    }
    let more = full.free.saturating_sub(fit.free).max(1);
    ChiSquared::new(more as f64).map_or(true, |d| d.sf(short.max(0.0)) > SHORT_OF_FULL)
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
                && Arc::ptr_eq(
                    &r.fit.structure.coordinates,
                    &boring.full.structure.coordinates,
                )
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
            Some(Ranked::new(problem, fit))
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
            let pushes = dot(&signal.forward, &direction);
            if sense == Sense::Resists && pushes <= 0.0 {
                return false;
            }
            let input = match effect.direction {
                Direction::Matched(input) => input,
                Direction::Free => effect.channel,
            };
            let driven = || dot(&signal.forward, &plant.b_column(input));
            if sense == Sense::Drives && pushes * driven() <= 0.0 {
                return false;
            }
        }
        if effect.definition.id == "input_asymmetry" && two_levels(problem, effect.channel) {
            return false;
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
                ("limit" | "width", unit) => share_beyond(problem, fit, index, unit, *v)
                    .is_none_or(|beyond| (VISITED..=1.0 - VISITED).contains(&beyond)),
                // An input that is never between the ends of its dead zone has an offset.
                ("upper_end", _) => {
                    let ends = shape[0]..=shape[1];
                    let inside = share_of_input(problem, effect.channel, |u| ends.contains(&u));
                    (VISITED..=1.0 - VISITED).contains(&inside)
                }
                ("stop_position", unit) => share_beyond(problem, fit, index, unit, *v)
                    .is_none_or(|beyond| (VISITED..=MOSTLY_FREE).contains(&beyond)),
                ("frequency", _) if effect.definition.id == "periodic_disturbance" => {
                    v * length > FEWEST_PERIODS
                }
                ("pitch", _) => range(problem, fit, index) > FEWEST_PERIODS * v,
                ("damping", _) if effect.definition.id == "extra_mode" => *v < RESONANT,
                ("presliding_distance", _) => *v < 0.5 * travel(problem, fit, index),
                ("yield_distance", _) => *v > RESOLVED_LOOP * travel(problem, fit, index),
                ("breakaway_excess", _) => *v > BREAKAWAY,
                ("knee_width", _) => *v > CORNER * speed_scale(problem, fit, index),
                ("stribeck_velocity", _) => *v < 1.5 * speed_scale(problem, fit, index),
                _ => true,
            })
    })
}

/// Whether an input has one magnitude only: another gain for each sign then is an offset.
fn two_levels(problem: &Problem, input: usize) -> bool {
    let sizes = problem.data.segments.iter().flat_map(|s| &s.inputs[input]);
    let most = sizes.fold(0.0_f64, |most, u| most.max(u.abs()));
    let least = (1.0 - ONE_MAGNITUDE) * most;
    share_of_input(problem, input, |u| u.abs() < least) <= VISITED
}

/// Share of the samples of an input for which something is so.
fn share_of_input(problem: &Problem, input: usize, is_so: impl Fn(f64) -> bool) -> f64 {
    let all = || {
        let segments = problem.data.segments.iter();
        segments.flat_map(move |s| s.inputs[input].iter())
    };
    all().filter(|u| is_so(**u)).count() as f64 / all().count().max(1) as f64
}

/// Share of the samples that are beyond the threshold `v`, on the side where the effect acts.
/// `None` where the position is not measured.
fn share_beyond(problem: &Problem, fit: &Fit, index: usize, unit: Unit, v: f64) -> Option<f64> {
    let effect = &fit.structure.effects[index];
    let two_sided = effect.definition.parameters[0].logarithmic;
    let below = effect.definition.variant.starts_with("lower");
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
        (_, Signal::Integral(_)) => return None,
    };
    let above = values.iter().filter(|x| **x > v).count();
    let under = |limit: f64| values.iter().filter(|x| **x < limit).count();
    let beyond = match (two_sided, below) {
        // Limits and stops of which one is never reached are one, which has a form of its own.
        (true, _) if effect.definition.variant.starts_with("both") => {
            let (above, under) = (above, under(-v));
            if above.min(under) == 0 {
                0
            } else {
                above + under
            }
        }
        (true, _) => above + under(-v),
        (false, true) => under(v),
        (false, false) => above,
    };
    Some(beyond as f64 / values.len().max(1) as f64)
}

/// Output `o` of every segment.
fn simulated<'a>(problem: &Problem, fit: &'a Fit, o: usize) -> impl Iterator<Item = &'a Vec<f64>> {
    fit.simulated.iter().skip(o).step_by(problem.data.outputs)
}

/// Output `o` summed over time: the position that belongs to a speed.
fn integrated(problem: &Problem, fit: &Fit, o: usize) -> Vec<f64> {
    simulated(problem, fit, o)
        .flat_map(|y| {
            y.iter().scan(0.0, |at, v| {
                *at += v * problem.data.sample_time;
                Some(*at)
            })
        })
        .collect()
}

/// The position that effect `index` looks at, as far as outputs tell.
fn position(problem: &Problem, fit: &Fit, index: usize) -> Vec<f64> {
    let all = |o: usize| simulated(problem, fit, o).flatten().copied();
    match fit.structure.effects[index].signal {
        Signal::Output(o) => all(o).collect(),
        Signal::Difference(i, j) => all(i).zip(all(j)).map(|(a, b)| a - b).collect(),
        Signal::Integral(o) => integrated(problem, fit, o),
    }
}

/// Half its range.
pub(crate) fn travel(problem: &Problem, fit: &Fit, index: usize) -> f64 {
    effects::level(&position(problem, fit, index), 0.95, f64::abs)
}

/// From its least to its largest value, wherever these are.
fn range(problem: &Problem, fit: &Fit, index: usize) -> f64 {
    let position = position(problem, fit, index);
    let end = |of: fn(f64, f64) -> f64| position.iter().copied().reduce(of).unwrap_or(0.0);
    end(f64::max) - end(f64::min)
}
