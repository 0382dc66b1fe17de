//! What comes after the best single effect: confirmation on held-out blocks, a second effect, a feedthrough.

use rayon::prelude::*;

use super::penalties::penalty;
use super::plausibility::sane;
use super::richer_laws::{REFINEMENTS, derived};
use super::single_effects::{Ranked, second_effects};
use crate::explain::effects::Definition;
use crate::explain::linear::fit::{Effort, Fit, Problem};
use crate::noise::inputs_foretold;

/// A second effect must bring this share of what the first brought: misfit of the first breeds false seconds
/// (math/explain.md, choice 9).
const SECOND_SHARE: f64 = 0.1;

/// ... and at least this much.
pub(crate) const SECOND_GAIN: f64 = 30.0;

/// ... and it must remove this share of the squared error that the first has removed, unweighted: a textbook law is
/// rarely closer to the real one than some percents (seven percents are half a percent of its square), and with little
/// noise what is left of it is evidence for whatever comes near.
const SECOND_VARIANCE: f64 = 0.005;

/// What a second effect must bring beside a first that brought `single`.
pub(crate) fn required(single: f64) -> f64 {
    SECOND_GAIN.max(SECOND_SHARE * single)
}

/// Forms of a first effect (its variants, the plant free and as given) beside which a second is looked for.
const FORMS: usize = 4;

fn same_form(a: &Ranked, b: &Ranked) -> bool {
    let definition = |r: &Ranked| r.fit.structure.new_effects()[0].definition;
    std::ptr::eq(definition(a), definition(b))
        && a.fit.structure.plant_free == b.fit.structure.plant_free
}

/// A second effect beside one of the two best singles, where the best single leaves something; `before` is the best
/// explanation without any.
pub(crate) fn pair(
    problem: &Problem,
    ranked: &[Ranked],
    before: &Fit,
    allowed: &(dyn Fn(&Definition) -> bool + Sync),
) -> Option<Fit> {
    let count = problem.count();
    let base = before.criterion(count);
    let mut ranked = ranked.to_vec();
    ranked.sort_by(|a, b| a.criterion.total_cmp(&b.criterion));
    let best = ranked.first()?;
    let id = |r: &Ranked| r.fit.structure.new_effects()[0].definition.id;
    // A resonance imitates any linear misfit and a curve any law, so they are no first effects beside others.
    let imitates = |r: &Ranked| matches!(id(r), "extra_mode" | "law" | "input_curve");
    let best = ranked.iter().find(|r| !imitates(r)).unwrap_or(best);
    let other = ranked.iter().find(|r| id(r) != id(best) && !imitates(r));
    let single_gain = base - ranked[0].criterion;
    // The two best effects, each in its best forms: a free plant may hide the second effect, and the side of a limit
    // may only look right without it. One after
    // the other, since the best pair of one would keep those of the other from being pursued.
    let first = |r: &Ranked| r.fit.structure.new_effects()[0].definition.id;
    let mut found: Vec<Ranked> = [Some(best), other]
        .into_par_iter()
        .flatten()
        .flat_map_iter(|named| {
            let mut forms: Vec<&Ranked> = Vec::new();
            for r in ranked.iter().filter(|r| id(r) == id(named)) {
                if forms.len() < FORMS && !forms.iter().any(|f| same_form(f, r)) {
                    forms.push(r);
                }
            }
            let pairs = second_effects(problem, &forms, allowed);
            let mut refined = derived(problem, REFINEMENTS, &pairs, base, allowed);
            refined.extend(pairs);
            refined
        })
        .collect();
    for r in &mut found {
        r.criterion += penalty(r, base, count);
    }
    found.retain(|r| {
        let effects = r.fit.structure.new_effects();
        !look_alikes(effects[0].definition.id, effects[1].definition.id) && sane(problem, &r.fit)
    });
    found.sort_by(|a, b| a.criterion.total_cmp(&b.criterion));
    // The best pairs are close to one another, and not fitted to the end: the best of each first effect is.
    let mut finalists: Vec<Ranked> = Vec::new();
    for r in found {
        if finalists.iter().all(|f| first(f) != first(&r)) {
            finalists.push(r);
        }
    }
    let found = finalists
        .into_par_iter()
        .map(|r| {
            let mut better = Ranked {
                fit: polished(problem, &r.fit),
                criterion: 0.0,
            };
            better.criterion = better.fit.criterion(count);
            better.criterion += penalty(&better, base, count);
            better
        })
        .min_by(|a, b| a.criterion.total_cmp(&b.criterion))?;
    let gain = best.criterion - found.criterion;
    let enough = gain > required(single_gain);
    let size = |fit: &Fit| problem.mean_square(&fit.residual);
    let (without, single, both) = (size(before), size(&best.fit), size(&found.fit));
    // Beside a plant that is free otherwise the first may have removed nothing of it.
    let shows = single - both >= SECOND_VARIANCE * (without - single).max(0.0);
    // Blocks that were not fitted make up a share of the recording: a real gain shows there in proportion.
    let seen_again = || {
        validated_gain(problem, &best.fit, &found.fit)
            .is_some_and(|held| held.gain > 0.5 * held.share * gain)
    };
    (enough && shows && seen_again()).then_some(found.fit)
}

/// What a feedthrough must gain to be believed (strong evidence, Kass and Raftery 1995).
const FEEDTHROUGH_GAIN: f64 = 10.0;

/// `fit` with the direct feedthrough free, where that gains much and nothing speaks for feedback: under feedback an
/// input that holds the present noise imitates a feedthrough.
pub(crate) fn with_feedthrough(problem: &Problem, fit: &Fit) -> Option<Fit> {
    // A simulation that was given without feedthrough has none; an identified baseline never asked.
    if !problem.data.constant
        || !fit.structure.plant_free
        || fit.structure.feedthrough_free
        || feedback(problem, fit)
    {
        return None;
    }
    let mut structure = fit.structure.clone();
    structure.feedthrough_free = true;
    let at = fit.structure.linear_len();
    let given = &structure.coordinates.given;
    let d: Vec<f64> = structure
        .coordinates
        .active_inputs
        .iter()
        .flat_map(|&j| (0..given.outputs).map(move |o| (o, j)))
        .map(|(o, j)| given.d[o * given.inputs + j])
        .collect();
    let mut theta = fit.theta.clone();
    theta.splice(at..at, d);
    let direct = Fit::run(problem, structure, theta, Some(&fit.noise), Effort::FINAL)?;
    let count = problem.count();
    // A controller that acts within the sample leaves no other sign: what its output tells of the noise of now makes innovations
    // smaller, and the error of the simulation larger.
    let closer = problem.mean_square(&direct.residual) < problem.mean_square(&fit.residual);
    (closer && direct.criterion(count) < fit.criterion(count) - FEEDTHROUGH_GAIN).then_some(direct)
}

/// Whether the residual foretells the inputs. What acts within the sample may be the feedthrough that is asked for.
fn feedback(problem: &Problem, fit: &Fit) -> bool {
    let data = problem.data;
    let innovations = fit.noise.whiten(&fit.residual, &problem.mask);
    let signals = data.signals();
    let inputs: Vec<&[Vec<f64>]> = data.segments.iter().map(|s| &s.inputs[..signals]).collect();
    !inputs_foretold(&innovations, &problem.mask, &inputs, None).is_empty()
}

/// Decrease of the deviance from `a` to `b` on blocks that neither is fitted to, over their share of all that is fitted:
/// what the gain of all would be. The blocks that are set aside for the proof are not among them.
pub(crate) fn validated_gain(problem: &Problem, a: &Fit, b: &Fit) -> Option<Validated> {
    let (train, test, share) = super::cross_validation::inner(problem.data, &problem.mask);
    let (a, b) = rayon::join(
        || super::cross_validation::refit(problem, a, &train),
        || super::cross_validation::refit(problem, b, &train),
    );
    let (a, b) = (a?, b?);
    Some(Validated {
        gain: a.noise.deviance(&a.residual, &test) - b.noise.deviance(&b.residual, &test),
        share,
    })
}

/// What blocks of the fitted part say of a gain when they are left out of the fit.
pub(crate) struct Validated {
    pub(crate) gain: f64,
    /// Their share of the fitted values.
    pub(crate) share: f64,
}

/// Effects of one kind, of which a recording hardly holds two: misfit of the one would be called the other.
const KINDS: &[&[&str]] = &[
    &[
        "coulomb_friction",
        "stribeck_friction",
        "hysteresis",
        "input_backlash",
        "valve_stiction",
    ],
    &[
        "cubic_stiffness",
        "quadratic_stiffness",
        "end_stop",
        "law",
        "gravity_torque",
        "radiation",
    ],
    &["input_delay", "actuator_lag", "input_rate_limit"],
    &[
        "sensor_offset",
        "sensor_drift",
        "load_step",
        "periodic_disturbance",
        "state_of_charge",
    ],
    &["gain_change", "stiffness_change", "mass_change"],
    &[
        "input_curve",
        "input_saturation",
        "input_dead_zone",
        "input_asymmetry",
    ],
];

pub(crate) fn look_alikes(a: &str, b: &str) -> bool {
    KINDS
        .iter()
        .any(|kind| kind.contains(&a) && kind.contains(&b))
}

/// The fit tried harder.
pub(crate) fn polished(problem: &Problem, fit: &Fit) -> Fit {
    fit.improved(problem, Effort::FINAL)
        .filter(|better| better.deviance < fit.deviance)
        .unwrap_or_else(|| fit.clone())
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::explain::linear::fixtures::{self, SAMPLES, recorded, spring};
    use crate::explain::linear::model::coordinates::Coordinates;
    use crate::explain::linear::model::linear_plant::Plant;
    use crate::explain::linear::model::structure::Structure;

    #[test]
    fn a_second_effect_must_bring_a_share_of_the_first() {
        assert_eq!(required(100.0), 30.0);
        assert_eq!(required(2000.0), 200.0);
    }

    #[test]
    fn effects_of_one_kind_are_not_told_apart() {
        assert!(look_alikes("cubic_stiffness", "end_stop"));
        assert!(look_alikes("input_backlash", "coulomb_friction"));
        assert!(!look_alikes("coulomb_friction", "cubic_stiffness"));
        for kind in KINDS {
            for id in *kind {
                assert!(
                    crate::explain::effects::library().any(|d| d.id == *id),
                    "{id}"
                );
            }
        }
    }

    /// What passes through shows, a plant without is left without, and a simulation that was given is not asked.
    #[test]
    fn a_feedthrough_is_freed_where_there_is_one() {
        let gains = [0.0, 0.3];
        for (seed, gain) in gains.into_iter().enumerate() {
            for constant in [true, false] {
                let mut data = recorded(&spring(Vec::new()), &[], seed as u64);
                let segment = &mut data.segments[0];
                for (y, u) in segment.outputs[0].iter_mut().zip(&segment.inputs[0]) {
                    *y += gain * u;
                }
                let mut structure = Structure {
                    plant_free: true,
                    ..spring(Vec::new())
                };
                if constant {
                    // An operating point enters as an input that is one.
                    data.constant = true;
                    data.inputs = 2;
                    data.segments[0].inputs.push(vec![1.0; SAMPLES]);
                    structure.coordinates = Arc::new(Coordinates::new(&Plant {
                        inputs: 2,
                        b: vec![0.005, 0.0, 0.09, 0.0],
                        d: vec![0.0; 2],
                        ..fixtures::plant()
                    }));
                }
                let problem = Problem::new(&data);
                let start = structure.given();
                let fit = Fit::run(&problem, structure, start, None, Effort::FINAL).unwrap();
                let freed = with_feedthrough(&problem, &fit);
                assert_eq!(freed.is_some(), gain > 0.0 && constant, "{gain} {constant}");
            }
        }
    }
}
