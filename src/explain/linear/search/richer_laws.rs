//! Richer and other forms of the laws that fit: a knee, bristles, a breakaway force.

use rayon::prelude::*;

use super::penalties::NEEDED;
use super::plausibility::{speed_scale, travel};
use super::single_effects::Ranked;
use crate::explain::effects::{self, Definition};
use crate::explain::linear::fit::{Effort, Fit, Problem};
use crate::explain::linear::model::structure::Structure;

/// A law that grows out of a simpler one which fits already: `(id, variant)` of both, and what its further numbers
/// start from.
pub(crate) struct Refinement {
    pub(crate) simple: (&'static str, &'static str),
    pub(crate) rich: (&'static str, &'static str),
    pub(crate) more: More,
}

pub(crate) enum More {
    /// Nothing: another reading of the same numbers.
    Nothing,
    /// Logarithms of pure numbers.
    Numbers(&'static [f64]),
    /// Breakaway excess and Stribeck velocity.
    Breakaway,
    /// Shares of a typical speed.
    Speed(&'static [f64]),
    /// Multiples of the sample time.
    Samples(&'static [f64]),
    /// Shares of the travel.
    Travel(&'static [f64]),
    /// Plain numbers from each of these, however far the simple form is from the best.
    Each(&'static [&'static [f64]]),
}

pub(crate) const REFINEMENTS: &[Refinement] = &[
    Refinement {
        simple: ("coulomb_friction", ""),
        rich: ("stribeck_friction", ""),
        more: More::Breakaway,
    },
    Refinement {
        simple: ("coulomb_friction", ""),
        rich: ("coulomb_friction", "smooth"),
        more: More::Speed(&[0.005, 0.05]),
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
        simple: ("cubic_stiffness", ""),
        rich: ("cubic_stiffness", "off centre"),
        // Where the simple one is: about zero, in the middle of the interval.
        more: More::Each(&[&[0.0, 0.5]]),
    },
    // From the middle of its gap play may be far from where it was for some time.
    Refinement {
        simple: ("input_backlash", ""),
        rich: ("input_backlash", "from its gap"),
        more: More::Each(&[&[-0.9], &[0.9]]),
    },
    Refinement {
        simple: ("input_delay", ""),
        rich: ("input_delay", "from rest"),
        more: More::Nothing,
    },
    Refinement {
        simple: ("actuator_lag", ""),
        rich: ("actuator_lag", "from rest"),
        more: More::Nothing,
    },
    Refinement {
        simple: ("input_delay", ""),
        rich: ("input_delay", "interpolated"),
        more: More::Nothing,
    },
    Refinement {
        simple: ("input_delay", "from rest"),
        rich: ("input_delay", "interpolated from rest"),
        more: More::Nothing,
    },
    Refinement {
        simple: ("actuator_lag", "from rest"),
        rich: ("actuator_lag", "held from rest"),
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
pub(crate) const FURTHER: &[Refinement] = &[Refinement {
    simple: ("coulomb_friction", "bristles"),
    rich: ("stribeck_friction", "bristles"),
    more: More::Breakaway,
}];

/// What a fine step makes worth trying first: elastic bristles, which a coarse step hides.
const FINE_REFINEMENTS: &[Refinement] = &[Refinement {
    simple: ("coulomb_friction", ""),
    rich: ("coulomb_friction", "presliding"),
    more: More::Travel(&[0.002, 0.01]),
}];

/// Refinements of what is in the running: within this share of the best gain.
const IN_THE_RUNNING: f64 = 0.25;

/// The effect that came last: the only one, or the second of a pair.
fn newest(fit: &Fit) -> Option<&'static Definition> {
    fit.structure.new_effects().last().map(|e| e.definition)
}

/// Whether an entry is a static curve without a form.
fn is_curve(definition: &Definition) -> bool {
    definition.parameters.iter().any(|p| p.held)
}

/// Richer and other forms of the newest effects that fit well.
pub(crate) fn derived(
    problem: &Problem,
    refinements: &[Refinement],
    ranked: &[Ranked],
    base: f64,
    allowed: &(dyn Fn(&Definition) -> bool + Sync),
) -> Vec<Ranked> {
    // A curve without a form is no rival here: what it follows may be a law in its simplest form.
    let laws = ranked
        .iter()
        .filter(|r| newest(&r.fit).is_some_and(|d| !is_curve(d)));
    let Some(least) = laws.map(|r| r.criterion).reduce(f64::min) else {
        return Vec::new();
    };
    let reach = least + (IN_THE_RUNNING * (base - least)).max(NEEDED);
    let mut jobs: Vec<(Structure, Vec<f64>, crate::noise::Noise)> = Vec::new();
    for refinement in refinements {
        let (Some(simple), Some(rich)) = (
            effects::find(refinement.simple.0, refinement.simple.1),
            effects::find(refinement.rich.0, refinement.rich.1),
        ) else {
            continue;
        };
        let mut simple_fits: Vec<&Ranked> = ranked
            .iter()
            .filter(|r| newest(&r.fit).is_some_and(|d| std::ptr::eq(d, simple)))
            .collect();
        simple_fits.sort_by(|a, b| a.criterion.total_cmp(&b.criterion));
        let best = match refinement.more {
            More::Nothing | More::Each(_) => simple_fits.first().copied(),
            _ => simple_fits
                .first()
                .copied()
                .filter(|r| r.criterion <= reach),
        };
        let Some(best) = best.filter(|_| allowed(rich)) else {
            continue;
        };
        let there = |r: &Ranked| newest(&r.fit).is_some_and(|d| std::ptr::eq(d, rich));
        if best.fit.structure.substeps > 1 && ranked.iter().any(there) {
            continue;
        }
        let starts: Vec<Vec<f64>> = match &refinement.more {
            More::Nothing => vec![vec![]],
            More::Each(starts) => starts.iter().map(|numbers| numbers.to_vec()).collect(),
            More::Numbers(numbers) => numbers.iter().map(|v| vec![v.ln()]).collect(),
            More::Samples(samples) => samples
                .iter()
                .map(|v| vec![(v * problem.data.sample_time).ln()])
                .collect(),
            More::Travel(shares) => {
                let size = travel(problem, &best.fit, best.fit.structure.effects.len() - 1);
                shares.iter().map(|v| vec![(v * size).ln()]).collect()
            }
            More::Speed(shares) => {
                let speed = speed_scale(problem, &best.fit, best.fit.structure.effects.len() - 1);
                shares.iter().map(|v| vec![(v * speed).ln()]).collect()
            }
            More::Breakaway => {
                let speed = speed_scale(problem, &best.fit, best.fit.structure.effects.len() - 1);
                [0.05, 0.3]
                    .iter()
                    .map(|share| vec![0.4_f64.ln(), (share * speed).ln()])
                    .collect()
            }
        };
        for more in starts {
            let mut structure = best.fit.structure.clone();
            if let Some(effect) = structure.effects.last_mut() {
                effect.definition = rich;
            }
            let mut theta = best.fit.theta.clone();
            theta.extend(more);
            jobs.push((structure, theta, best.fit.noise.clone()));
        }
    }
    jobs.into_par_iter()
        .filter_map(|(structure, theta, noise)| {
            Fit::run(problem, structure, theta, Some(&noise), Effort::RANK)
        })
        .map(|fit| Ranked::new(problem, fit))
        .collect()
}

/// Laws whose state decides within a sample interval.
const QUICK: &[&str] = &[
    "coulomb_friction",
    "stribeck_friction",
    "hysteresis",
    "end_stop",
];

/// Whether the newest law of `fit` is one of them.
pub(crate) fn decides_within(fit: &Fit) -> bool {
    newest(fit).is_some_and(|d| QUICK.contains(&d.id))
}

/// Fits that are tried with finer steps.
const FINER_EACH: usize = 6;

/// The best fits of laws that decide within an interval, at finer steps: one a form of a law, and the forms that were
/// out of the running at the coarse step.
pub(crate) fn finer_steps(
    problem: &Problem,
    ranked: &[Ranked],
    base: f64,
    allowed: &(dyn Fn(&Definition) -> bool + Sync),
) -> Vec<Ranked> {
    let mut best: Vec<&Ranked> = ranked.iter().collect();
    best.sort_by(|a, b| a.criterion.total_cmp(&b.criterion));
    let Some(least) = best.first().map(|r| r.criterion) else {
        return Vec::new();
    };
    let reach = least + (IN_THE_RUNNING * (base - least)).max(NEEDED);
    let mut chosen: Vec<&Ranked> = Vec::new();
    for r in best {
        let Some(definition) = newest(&r.fit) else {
            continue;
        };
        let known = |c: &&Ranked| newest(&c.fit).is_some_and(|d| std::ptr::eq(d, definition));
        if r.criterion <= reach
            && QUICK.contains(&definition.id)
            && chosen.len() < FINER_EACH
            && !chosen.iter().any(known)
        {
            chosen.push(r);
        }
    }
    let mut finer: Vec<Ranked> = chosen
        .into_par_iter()
        .filter_map(|r| {
            let structure = Structure {
                substeps: crate::explain::linear::model::substeps::STEPS,
                ..r.fit.structure.clone()
            };
            let fit = Fit::run(
                problem,
                structure,
                r.fit.theta.clone(),
                Some(&r.fit.noise),
                Effort::RANK,
            )?;
            Some(Ranked::new(problem, fit))
        })
        .collect();
    for refinements in [FINE_REFINEMENTS, REFINEMENTS, FURTHER] {
        let more = derived(problem, refinements, &finer, base, allowed);
        finer.extend(more);
    }
    finer
}
