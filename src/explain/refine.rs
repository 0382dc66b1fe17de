//! Richer and other forms of the laws that fit: a knee, bristles, a breakaway force.

use rayon::prelude::*;

use super::effects::{self, Definition};
use super::fit::{Effort, Fit, Problem};
use super::inquiry::NEEDED;
use super::plausible::speed_scale;
use super::search::Ranked;
use super::structure::Structure;

/// A law that grows out of a simpler one which fits already: `(id, variant)` of both, and what its further numbers
/// start from.
pub(crate) struct Refinement {
    pub simple: (&'static str, &'static str),
    pub rich: (&'static str, &'static str),
    pub more: More,
}

pub(crate) enum More {
    /// Nothing: another reading of the same numbers.
    Nothing,
    /// Logarithms of pure numbers.
    Numbers(&'static [f64]),
    /// Breakaway excess and Stribeck velocity.
    Breakaway,
    /// Multiples of the sample time.
    Samples(&'static [f64]),
    /// Plain numbers.
    Plain(&'static [f64]),
}

pub(crate) const REFINEMENTS: &[Refinement] = &[
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
        simple: ("cubic_stiffness", ""),
        rich: ("cubic_stiffness", "off centre"),
        // Where the simple one is: about zero, in the middle of the interval.
        more: More::Plain(&[0.0, 0.5]),
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
pub(crate) const FURTHER: &[Refinement] = &[Refinement {
    simple: ("coulomb_friction", "bristles"),
    rich: ("stribeck_friction", "bristles"),
    more: More::Breakaway,
}];

/// Refinements of what is in the running: within this share of the best gain.
const IN_THE_RUNNING: f64 = 0.25;

/// Richer and other forms of the laws that fit well.
pub(crate) fn derived(
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
            More::Plain(numbers) => vec![numbers.to_vec()],
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
