//! Decides: consistent, parameters, named, family or unexplained.

use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::adequacy::{Adequacy, adequacy};
use super::data::{Data, Series};
use super::effects::{self, Action, Definition, Sense, Unit};
use super::exact::{Freeze, frozen, spacing};
use super::explanation::Verdict;
use super::fit::{Effort, Fit, Problem};
use super::search::{Boring, Ranked, second_effects, single_effects};
use super::structure::{Functionals, Signal, Structure, dot};

/// Places, laws and starting values that are tried on one recording, about: a name among so many needs
/// `2 ln(300)` more than nothing at all (the maximum of that many chi-squares with one degree of freedom).
pub(crate) const NEEDED: f64 = 11.4;
/// Names whose criteria differ by less explain the recording equally well (Kass and Raftery 1995: 6 is "strong").
const TIE: f64 = super::explanation::EFFECTS_TIE;
/// A missing resonance imitates any linear misfit; it must lead by this share of its gain.
const MODE_HANDICAP: f64 = 0.01;
/// What an answer owes that physics allows but that is rare, such as a hysteresis that gives energy back: odds of 1
/// to 400.
const UNUSUAL: f64 = 12.0;
/// Evidence from which held-out blocks are not asked: they could not say otherwise.
const BEYOND_DOUBT: f64 = 100.0;
/// With a larger probability what is left is called noise, and no second effect is looked for.
const NOTHING_LEFT: f64 = 0.02;
/// Probability of a larger difference when the plant is as it was given.
const SAME_PLANT: f64 = 1e-3;
/// Share of the samples that a threshold must leave on either side of it.
const VISITED: f64 = 0.002;
/// A textbook law is rarely closer to the real one than some percents of what it explains.
const LAW_IMPERFECTION: f64 = 0.02;
/// A second effect must bring this share of what the first brought: misfit of the first breeds false seconds
/// (math/explain.md, choice 9).
const SECOND_SHARE: f64 = 0.1;
/// ... and at least this much.
const SECOND_GAIN: f64 = 30.0;
/// Share of the innovation variance that rounding to levels must make up to be named.
const COARSE: f64 = 0.25;

/// A rival of the answer.
#[derive(Debug, Clone)]
pub(crate) struct Rival {
    pub definition: &'static Definition,
    /// How much better (in the criterion) than the best boring explanation.
    pub gain: f64,
}

/// All that was found.
#[derive(Debug, Clone)]
pub(crate) struct Finding {
    pub verdict: Verdict,
    pub boring: Boring,
    /// The model that stands: boring or augmented.
    pub model: Fit,
    /// Best augmented model, named or not.
    pub augmented: Option<Fit>,
    /// How much better it is than the best boring explanation.
    pub gain: f64,
    /// Others, best first.
    pub rivals: Vec<Rival>,
    pub freezes: Vec<Freeze>,
    /// Output and step of a coarse sensor.
    pub coarse: Option<(usize, f64)>,
    pub adequacy: Option<Adequacy>,
    pub count: usize,
    /// What effects that were not found would have had to be: size in the output over its standard deviation.
    pub detectable: Vec<(&'static Definition, super::structure::Instance, f64)>,
}

/// Runs the whole inquiry. `structure` is the simulation as it is known.
pub(crate) fn inquire(
    data: &Data,
    structure: &Structure,
    allowed: &(dyn Fn(&Definition) -> bool + Sync),
) -> Option<(Finding, super::noise::Mask)> {
    let mut problem = Problem::new(data);
    let said = structure.simulate(&structure.given(), data)?;
    let freezes = if allowed(effects::find("sensor_freeze", "")?) {
        frozen(data, &said)
    } else {
        Vec::new()
    };
    for freeze in &freezes {
        let mask = &mut problem.mask[freeze.segment * data.outputs + freeze.output];
        // The whitening filter looks back over its order.
        let to = (freeze.to + super::noise::MOST_ORDER).min(mask.len());
        mask[freeze.from + 1..to].fill(false);
    }
    let count = problem.count();
    let boring = Boring::fit(&problem, structure)?;
    let base = boring.best(count).criterion(count);
    let coarse = if allowed(effects::find("sensor_quantization", "")?) {
        coarse_sensor(&problem, boring.best(count))
    } else {
        None
    };
    let mut finding = Finding {
        verdict: Verdict::Consistent,
        model: boring.best(count).clone(),
        boring,
        augmented: None,
        gain: 0.0,
        rivals: Vec::new(),
        freezes,
        coarse: coarse.map(|(output, step, _)| (output, step)),
        adequacy: None,
        count,
        detectable: Vec::new(),
    };
    let dominated = coarse.is_some_and(|(_, _, share)| share > 0.5);
    if dominated || coarse.is_some_and(|c| c.2 > 0.3) {
        // Rounding is most of what is left: it is the answer, and its error would be taken for anything.
        finding.verdict = Verdict::Named;
        finding.model = finding.boring.near.clone();
        return Some((finding, problem.mask));
    }
    let mut ranked = single_effects(&problem, &finding.boring, allowed);
    for refinements in [REFINEMENTS, FURTHER] {
        ranked.extend(derived(&problem, refinements, &ranked, base, allowed));
    }
    for r in &mut ranked {
        r.criterion += penalty(r, base, count);
    }
    ranked.retain(|r| sane(&problem, &r.fit));
    add_free_twins(&problem, &finding.boring, &mut ranked, base);
    let mut ranked_all = ranked.clone();
    ranked.retain(|r| plant_may_stay(r, &ranked_all));
    ranked.sort_by(|a, b| a.criterion.total_cmp(&b.criterion));
    finding.rivals = rivals(&ranked, base);
    finding.detectable = detectable(&problem, &ranked);
    let needed = NEEDED;
    // Blocks that were not fitted must show the gain in proportion to their share, at least by half.
    // (beside a plant as given the gain is one over that plant: over a free one it is mostly fewer numbers).
    let best = ranked.iter().take(4).find(|r| {
        let gain = base - r.criterion;
        let before = if r.fit.structure.plant_free {
            finding.boring.best(count)
        } else {
            &finding.boring.near
        };
        let expected = super::prove::SHARE * (before.criterion(count) - r.criterion).max(gain);
        gain > needed
            && (gain > BEYOND_DOUBT
                || heldout_gain(&problem, before, &r.fit).is_some_and(|held| held > 0.5 * expected))
    });
    if let Some(best) = best {
        let mut fit = polished(&problem, &best.fit);
        if let Some(direct) = with_feedthrough(&problem, &fit) {
            fit = direct;
            ranked_all.push(Ranked {
                criterion: fit.criterion(count),
                fit: fit.clone(),
            });
        }
        let mut gain = base - fit.criterion(count);
        // Where nothing is left there is no second effect to find.
        let nothing_left = adequacy(&problem, &fit, None).is_some_and(|a| a.p_value > NOTHING_LEFT);
        let second = if nothing_left {
            None
        } else {
            pair(&problem, &ranked_all, base, allowed)
        };
        if let Some(pair) = second {
            let polished = polished(&problem, &pair);
            gain = gain.max(base - polished.criterion(count));
            fit = polished;
        }
        finding.gain = gain;
        finding.adequacy = adequacy(&problem, &fit, Some(finding.boring.best(count)));
        finding.augmented = Some(fit.clone());
        let holds = finding.adequacy.is_none_or(|a| a.holds());
        finding.verdict = if !holds {
            Verdict::Unexplained
        } else if finding.rivals.iter().any(|r| {
            r.definition.id != fit.structure.new_effects()[0].definition.id && gain - r.gain < TIE
        }) && fit.structure.new_effects().len() == 1
        {
            Verdict::Family
        } else {
            Verdict::Named
        };
        finding.model = fit;
    } else {
        finding.adequacy = adequacy(&problem, finding.boring.best(count), None);
        let holds = finding.adequacy.is_none_or(|a| a.holds());
        finding.verdict = if !holds {
            Verdict::Unexplained
        } else if !finding.freezes.is_empty() || finding.coarse.is_some() {
            Verdict::Named
        } else if finding.boring.given.criterion(count) <= base + 1e-9 {
            Verdict::Consistent
        } else {
            Verdict::Parameters
        };
    }
    Some((finding, problem.mask))
}

/// An output on a lattice so coarse that rounding is a good part of the residual: `(output, step, share)`.
fn coarse_sensor(problem: &Problem, fit: &Fit) -> Option<(usize, f64, f64)> {
    problem
        .data
        .outputs_as_series()
        .enumerate()
        .filter_map(|(series, y)| {
            let step = spacing(y)?;
            let residual = &fit.residual[series];
            let variance =
                residual.iter().map(|r| r * r).sum::<f64>() / residual.len().max(1) as f64;
            // Variance of rounding: step^2/12.
            let share = step * step / 12.0 / variance.max(1e-300);
            (share > COARSE).then_some((series % problem.data.outputs, step, share))
        })
        .max_by(|a, b| a.2.total_cmp(&b.2))
}

/// What some effects owe beyond the count of their parameters.
fn penalty(ranked: &Ranked, base: f64, count: usize) -> f64 {
    let Some(effect) = ranked.fit.structure.new_effects().first() else {
        return 0.0;
    };
    let changes = effect
        .definition
        .parameters
        .iter()
        .any(|p| p.name == "from" && p.unit == Unit::Second);
    let mut owed = 0.0;
    if changes {
        // A change point is chosen among all samples: it counts about twice (Zhang and Siegmund 2007).
        owed += (count as f64).ln();
    }
    if effect
        .definition
        .parameters
        .iter()
        .any(|p| p.unit == Unit::Hertz)
    {
        // A frequency is chosen among all bins: it counts about twice (Djuric 1996, 3 ln N for a sinusoid).
        owed += (count as f64).ln();
    }
    if effect.definition.id == "hysteresis" && pulls(&ranked.fit, ranked.fit.structure.first_new())
    {
        owed += UNUSUAL;
    }
    let gain = (base - ranked.criterion).max(0.0);
    owed += match effect.definition.id {
        "extra_mode" => MODE_HANDICAP * gain,
        // Nested in a simpler law: it must do better than make up for the imperfection of that law.
        "stribeck_friction" => LAW_IMPERFECTION * gain,
        // Hardly to be told from a delay, which every sampled loop has.
        "actuator_lag" => TIE,
        _ => 0.0,
    };
    owed
}

/// A law that grows out of a simpler one which fits already: `(id, variant)` of both, and what its further numbers
/// start from.
struct Refinement {
    simple: (&'static str, &'static str),
    rich: (&'static str, &'static str),
    more: More,
}

enum More {
    /// Nothing: another reading of the same numbers.
    Nothing,
    /// Logarithms of pure numbers.
    Numbers(&'static [f64]),
    /// Breakaway excess and Stribeck velocity.
    Breakaway,
    /// Multiples of the sample time.
    Samples(&'static [f64]),
}

const REFINEMENTS: &[Refinement] = &[
    Refinement {
        simple: ("coulomb_friction", ""),
        rich: ("stribeck_friction", ""),
        more: More::Breakaway,
    },
    Refinement {
        simple: ("coulomb_friction", "presliding"),
        rich: ("coulomb_friction", "bristles"),
        more: More::Samples(&[0.5]),
    },
    Refinement {
        simple: ("coulomb_friction", "presliding"),
        rich: ("stribeck_friction", "presliding"),
        more: More::Breakaway,
    },
    Refinement {
        simple: ("input_saturation", ""),
        rich: ("input_saturation", "soft"),
        more: More::Numbers(&[8.0]),
    },
    Refinement {
        simple: ("sensor_saturation", ""),
        rich: ("sensor_saturation", "soft"),
        more: More::Numbers(&[8.0]),
    },
    Refinement {
        simple: ("end_stop", "upper"),
        rich: ("end_stop", "upper damped"),
        more: More::Samples(&[0.5]),
    },
    Refinement {
        simple: ("end_stop", "lower"),
        rich: ("end_stop", "lower damped"),
        more: More::Samples(&[0.5]),
    },
    Refinement {
        simple: ("end_stop", "both"),
        rich: ("end_stop", "both damped"),
        more: More::Samples(&[0.5]),
    },
    Refinement {
        simple: ("input_delay", ""),
        rich: ("input_delay", "interpolated"),
        more: More::Nothing,
    },
    Refinement {
        simple: ("input_rate_limit", ""),
        rich: ("input_rate_limit", "held"),
        more: More::Nothing,
    },
    Refinement {
        simple: ("actuator_lag", ""),
        rich: ("actuator_lag", "held"),
        more: More::Nothing,
    },
];

/// Refinements of refinements.
const FURTHER: &[Refinement] = &[Refinement {
    simple: ("coulomb_friction", "bristles"),
    rich: ("stribeck_friction", "bristles"),
    more: More::Breakaway,
}];

/// Refinements of what is in the running: within this share of the best gain.
const IN_THE_RUNNING: f64 = 0.25;

/// Richer and other forms of the laws that fit well.
fn derived(
    problem: &Problem,
    refinements: &[Refinement],
    ranked: &[Ranked],
    base: f64,
    allowed: &(dyn Fn(&Definition) -> bool + Sync),
) -> Vec<Ranked> {
    let count = problem.count();
    let Some(least) = ranked.iter().map(|r| r.criterion).reduce(f64::min) else {
        return Vec::new();
    };
    let reach = least + (IN_THE_RUNNING * (base - least)).max(NEEDED);
    let mut jobs: Vec<(Structure, Vec<f64>, super::noise::Noise)> = Vec::new();
    for refinement in refinements {
        let (Some(simple), Some(rich)) = (
            effects::find(refinement.simple.0, refinement.simple.1),
            effects::find(refinement.rich.0, refinement.rich.1),
        ) else {
            continue;
        };
        let mut simple_fits: Vec<&Ranked> = ranked
            .iter()
            .filter(|r| std::ptr::eq(r.fit.structure.new_effects()[0].definition, simple))
            .collect();
        simple_fits.sort_by(|a, b| a.criterion.total_cmp(&b.criterion));
        let best = match refinement.more {
            More::Nothing => simple_fits.first().copied(),
            _ => simple_fits
                .first()
                .copied()
                .filter(|r| r.criterion <= reach),
        };
        let Some(best) = best.filter(|_| allowed(rich)) else {
            continue;
        };
        let starts: Vec<Vec<f64>> = match &refinement.more {
            More::Nothing => vec![vec![]],
            More::Numbers(numbers) => numbers.iter().map(|v| vec![v.ln()]).collect(),
            More::Samples(samples) => samples
                .iter()
                .map(|v| vec![(v * problem.data.sample_time).ln()])
                .collect(),
            More::Breakaway => {
                let speed = speed_scale(problem, &best.fit, best.fit.structure.first_new());
                [0.05, 0.3]
                    .iter()
                    .map(|share| vec![0.4_f64.ln(), (share * speed).ln()])
                    .collect()
            }
        };
        for more in starts {
            let mut structure = best.fit.structure.clone();
            let at = structure.first_new();
            structure.effects[at].definition = rich;
            let mut theta = best.fit.theta.clone();
            theta.extend(more);
            jobs.push((structure, theta, best.fit.noise.clone()));
        }
    }
    jobs.into_par_iter()
        .filter_map(|(structure, theta, noise)| {
            Fit::run(problem, structure, theta, Some(&noise), Effort::RANK)
        })
        .map(|fit| Ranked {
            criterion: fit.criterion(count),
            fit,
        })
        .collect()
}

/// A typical speed of the signal that effect `index` looks at.
fn speed_scale(problem: &Problem, fit: &Fit, index: usize) -> f64 {
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
fn pulls(fit: &Fit, index: usize) -> bool {
    let plant = fit.structure.plant(&fit.theta);
    let rows = Functionals::new(&plant);
    let signal = rows.of(&plant, fit.structure.effects[index].signal);
    let direction = fit.structure.direction(&fit.theta, &plant, &rows, index);
    dot(&signal.rate, &direction) < 0.0
}

/// An effect fitted beside the given plant stands only while a free plant does not do significantly better with the
/// same effect: else the effect makes up for wrong parameters (math/explain.md, choice 5).
fn plant_may_stay(ranked: &Ranked, all: &[Ranked]) -> bool {
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
fn add_free_twins(problem: &Problem, boring: &Boring, ranked: &mut Vec<Ranked>, base: f64) {
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
fn sane(problem: &Problem, fit: &Fit) -> bool {
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

/// For each effect that was fitted: the size in the output at which its evidence would have sufficed. The evidence
/// grows with the square of the size, and the fit's own size has an evidence of its deviance.
fn detectable(
    problem: &Problem,
    ranked: &[Ranked],
) -> Vec<(&'static Definition, super::structure::Instance, f64)> {
    let mut list: Vec<(&'static Definition, super::structure::Instance, f64)> = Vec::new();
    for r in ranked {
        let instance = r.fit.structure.new_effects()[0];
        if list.iter().any(|l| l.0.id == instance.definition.id) {
            continue;
        }
        // The same numbers without the effect.
        let mut without = r.fit.structure.clone();
        let at = without.first_new();
        let theta = r.fit.theta[..without.effect_offset(at)].to_vec();
        without.effects.truncate(at);
        let Some(simulated) = without.simulate(&theta, problem.data) else {
            continue;
        };
        let change = problem.size(&simulated, &r.fit.simulated);
        let lost = r
            .fit
            .noise
            .deviance(&problem.data.residual(&simulated), &problem.mask)
            - r.fit.deviance;
        let owed =
            NEEDED + (r.fit.structure.len() - theta.len()) as f64 * (problem.count() as f64).ln();
        if lost > 0.1 && change > 0.0 {
            list.push((instance.definition, instance, change * (owed / lost).sqrt()));
        }
    }
    list
}

/// One line an effect: the best of its forms.
fn rivals(ranked: &[Ranked], base: f64) -> Vec<Rival> {
    let mut list: Vec<Rival> = Vec::new();
    for r in ranked {
        let definition = r.fit.structure.new_effects()[0].definition;
        if list.iter().all(|l| l.definition.id != definition.id) {
            list.push(Rival {
                definition,
                gain: base - r.criterion,
            });
        }
    }
    list
}

/// The fit tried harder.
fn polished(problem: &Problem, fit: &Fit) -> Fit {
    Fit::run(
        problem,
        fit.structure.clone(),
        fit.theta.clone(),
        Some(&fit.noise),
        Effort::FINAL,
    )
    .filter(|better| better.deviance < fit.deviance)
    .unwrap_or_else(|| fit.clone())
}

/// A second effect beside one of the two best singles, where the best single leaves something.
fn pair(
    problem: &Problem,
    ranked: &[Ranked],
    base: f64,
    allowed: &(dyn Fn(&Definition) -> bool + Sync),
) -> Option<Fit> {
    let count = problem.count();
    let mut ranked = ranked.to_vec();
    ranked.sort_by(|a, b| a.criterion.total_cmp(&b.criterion));
    let best = ranked.first()?;
    let id = |r: &Ranked| r.fit.structure.new_effects()[0].definition.id;
    // The two best effects, each with the plant free and as given: a free plant may hide the second effect.
    let mut firsts: Vec<&Ranked> = Vec::new();
    // A resonance imitates any linear misfit, so it is no first effect unless it is the best.
    let second = ranked
        .iter()
        .find(|r| id(r) != id(best) && id(r) != "extra_mode");
    for name in [Some(best), second].into_iter().flatten().map(id) {
        for free in [true, false] {
            firsts.extend(
                ranked
                    .iter()
                    .find(|r| id(r) == name && r.fit.structure.plant_free == free),
            );
        }
    }
    let single_gain = base - best.criterion;
    let found = second_effects(problem, &firsts, allowed);
    let found = found
        .into_iter()
        .filter(|r| {
            !look_alikes(
                r.fit.structure.new_effects()[0].definition.id,
                r.fit.structure.new_effects()[1].definition.id,
            )
        })
        .filter(|r| sane(problem, &r.fit))
        .min_by(|a, b| a.criterion.total_cmp(&b.criterion))?;
    let gain = best.criterion - found.fit.criterion(count);
    let enough = gain > SECOND_GAIN.max(SECOND_SHARE * single_gain);
    // Blocks that were not fitted make up a share of the recording: a real gain shows there in proportion.
    let seen_again = || {
        heldout_gain(problem, &best.fit, &found.fit)
            .is_some_and(|held| held > 0.5 * super::prove::SHARE * gain)
    };
    (enough && seen_again()).then_some(found.fit)
}

/// What a feedthrough must gain to be believed (strong evidence, Kass and Raftery 1995).
const FEEDTHROUGH_GAIN: f64 = 10.0;
/// Share of an input's innovation variance that fed-back noise makes up at least, where a feedthrough would be misled.
const FEEDBACK_SHARE: f64 = 0.05;
/// Lags over which feedback would show.
const FEEDBACK_LAGS: usize = 20;

/// `fit` with the direct feedthrough free, where that gains much and nothing speaks for feedback: under feedback an
/// input that holds the present noise imitates a feedthrough.
fn with_feedthrough(problem: &Problem, fit: &Fit) -> Option<Fit> {
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
    (direct.criterion(count) < fit.criterion(count) - FEEDTHROUGH_GAIN).then_some(direct)
}

/// Whether the residual foretells the inputs: its whitened values correlate with later innovations of an input.
fn feedback(problem: &Problem, fit: &Fit) -> bool {
    let data = problem.data;
    let e = fit.noise.whiten(&fit.residual);
    (0..data.signals()).any(|j| {
        let u: Series = data.segments.iter().map(|s| s.inputs[j].clone()).collect();
        let mask: Vec<Vec<bool>> = u.iter().map(|c| vec![true; c.len()]).collect();
        let own = super::noise::Noise::estimate(&u, 1, &mask, super::noise::MOST_ORDER);
        let w = own.whiten(&u);
        (0..data.outputs).any(|o| {
            (1..=FEEDBACK_LAGS).any(|lag| {
                let (mut sum, mut ee, mut ww, mut n) = (0.0, 0.0, 0.0, 0.0);
                for (s, w) in w.iter().enumerate() {
                    let e = &e[s * data.outputs + o];
                    for k in super::noise::MOST_ORDER..w.len().saturating_sub(lag) {
                        sum += e[k] * w[k + lag];
                        ee += e[k] * e[k];
                        ww += w[k + lag] * w[k + lag];
                        n += 1.0;
                    }
                }
                // Significant, and as much as a controller makes of it.
                sum * sum > f64::max(16.0 / f64::max(n, 1.0), FEEDBACK_SHARE) * ee * ww
            })
        })
    })
}

/// Decrease of the deviance from `a` to `b` on blocks that neither was fitted to.
fn heldout_gain(problem: &Problem, a: &Fit, b: &Fit) -> Option<f64> {
    let (train, test) = super::prove::split(problem.data, &problem.mask);
    let (a, b) = rayon::join(
        || super::prove::refit(problem, a, &train),
        || super::prove::refit(problem, b, &train),
    );
    let (a, b) = (a?, b?);
    Some(a.noise.deviance(&a.residual, &test) - b.noise.deviance(&b.residual, &test))
}

/// Effects of one kind, of which a recording hardly holds two: misfit of the one would be called the other.
const KINDS: &[&[&str]] = &[
    &[
        "coulomb_friction",
        "stribeck_friction",
        "hysteresis",
        "input_backlash",
    ],
    &["cubic_stiffness", "quadratic_stiffness", "end_stop"],
    &["input_delay", "actuator_lag", "input_rate_limit"],
    &[
        "sensor_offset",
        "sensor_drift",
        "load_step",
        "periodic_disturbance",
    ],
    &["gain_change", "stiffness_change"],
];

fn look_alikes(a: &str, b: &str) -> bool {
    KINDS
        .iter()
        .any(|kind| kind.contains(&a) && kind.contains(&b))
}
