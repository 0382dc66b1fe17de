//! Effects beside the null models: score tests, fits of the best candidates, and their ranking. The same for a second effect.

use std::sync::Arc;

use rayon::prelude::*;

use super::null_models::Boring;
use crate::explain::effects::{Definition, Unit};
use crate::explain::linear::fit::{Effort, Fit, Problem};
use crate::explain::linear::model::structure::Structure;
use crate::explain::linear::screening::score_tests::{Lead, extended, screen};
use crate::noise::Noise;

/// Effects that are fitted in full from each screening.
const LEADS_EACH: usize = 6;
/// Places of one effect that are fitted in full from each screening.
const PLACES_EACH: usize = 2;

/// A lead that promises less is not fitted: one step underrates what a fit reaches, but not by this much.
const HOPELESS: f64 = -10.0;
/// Scouted fits that are pursued, and forms (places, plant free or not) of one effect among them.
const PROMISING: usize = 14;
const FORMS_EACH: usize = 3;
/// Second effects that are scouted beside each form of a first, and pairs of one first that are pursued.
const SECONDS_EACH: usize = 4;
const PROMISING_SECONDS: usize = 4;

/// One fitted explanation.
#[derive(Debug, Clone)]
pub(crate) struct Ranked {
    pub(crate) fit: Fit,
    pub(crate) criterion: f64,
}

impl Ranked {
    pub(crate) fn new(problem: &Problem, fit: Fit) -> Self {
        Self {
            criterion: fit.criterion(problem.count()),
            fit,
        }
    }
}

/// Screens around `bases` and fits what stands out, frozen and free; best first.
pub(crate) fn single_effects(
    problem: &Problem,
    boring: &Boring,
    allowed: &(dyn Fn(&Definition) -> bool + Sync),
) -> Vec<Ranked> {
    let mut leads: Vec<(usize, Lead)> = Vec::new();
    let bases = [boring.strict.clone(), boring.full.clone()];
    let screens: Vec<(usize, Vec<Vec<Lead>>)> = [0, 1]
        .into_par_iter()
        .map(|index| {
            let mut basis = bases[index].clone();
            let noises = [
                basis.noise.clone(),
                Noise::white(&basis.residual, problem.data.outputs, &problem.mask),
            ];
            (index, screen(problem, &mut basis, &noises, allowed))
        })
        .collect();
    for (index, lists) in screens {
        let mut own: Vec<Lead> = Vec::new();
        for list in lists {
            for lead in shortlist(list, LEADS_EACH, PLACES_EACH) {
                // The second noise model often finds what the first has found.
                if !own.iter().any(|l| l.instance.is_same(&lead.instance)) {
                    own.push(lead);
                }
            }
        }
        leads.extend(own.into_iter().map(|lead| (index, lead)));
    }
    // Every lead beside the plant as given, adjusted, and free. A few steps tell which deserve more.
    let frozen = &boring.strict;
    let one_plant = Arc::ptr_eq(
        &boring.full.structure.coordinates,
        &frozen.structure.coordinates,
    );
    let mut jobs: Vec<(Structure, Vec<f64>)> = Vec::new();
    for (at, (index, lead)) in leads.iter().enumerate() {
        let found_before = leads[..at]
            .iter()
            .any(|(before, other)| before != index && other.instance.is_same(&lead.instance));
        // What was found around a plant of another order has its numbers.
        if !one_plant {
            let basis = if *index == 0 { frozen } else { &boring.full };
            jobs.push(extended(&basis.structure, &basis.theta, lead));
            continue;
        }
        // Beside a plant that stays, where it was found makes no difference.
        if !found_before {
            jobs.push(extended(&frozen.structure, &frozen.theta, lead));
            if boring.near.structure.adjusted > 0 {
                jobs.push(extended(&boring.near.structure, &boring.near.theta, lead));
            }
        }
        jobs.push(if *index == 0 {
            let full = &boring.full.structure;
            let mut theta = full.given();
            if frozen.structure.initial_free {
                let from = full.coordinates.len();
                let states = frozen.structure.states() * frozen.structure.initial.len();
                theta[from..from + states].copy_from_slice(&frozen.theta[..states]);
            }
            extended(full, &theta, lead)
        } else {
            extended(&boring.full.structure, &boring.full.theta, lead)
        });
    }
    pursued(problem, jobs, PROMISING)
}

/// Fits structures from their starts, best first: a first step for all; a few for those that then do well, and for the best
/// form of each effect, because a first step compares forms of one law and not laws; more for the `most` that promise best.
fn pursued(problem: &Problem, jobs: Vec<(Structure, Vec<f64>)>, most: usize) -> Vec<Ranked> {
    let mut glanced: Vec<Ranked> = jobs
        .into_par_iter()
        .filter_map(|(structure, start)| fit_lead(problem, structure, start, Effort::GLANCE))
        .map(|fit| Ranked::new(problem, fit))
        .collect();
    glanced.sort_by(|a, b| a.criterion.total_cmp(&b.criterion));
    let form = |r: &Ranked| {
        let effect = r.fit.structure.effects.last().map(|e| e.definition.id);
        (effect, r.fit.structure.plant_free)
    };
    let chosen: Vec<Ranked> = (0..glanced.len())
        .filter(|&i| i < most || !glanced[..i].iter().any(|r| form(r) == form(&glanced[i])))
        .map(|i| glanced[i].clone())
        .collect();
    let mut scouted = continued(problem, chosen, Effort::SCOUT);
    scouted.sort_by(|a, b| a.criterion.total_cmp(&b.criterion));
    let mut promising: Vec<Ranked> = Vec::new();
    for r in scouted {
        let forms = promising.iter().filter(|p| form(p).0 == form(&r).0);
        if forms.count() < FORMS_EACH && promising.len() < most {
            promising.push(r);
        }
    }
    let mut ranked = continued(problem, promising, Effort::RANK);
    ranked.sort_by(|a, b| a.criterion.total_cmp(&b.criterion));
    ranked
}

/// Each of `list` after more effort, where that helps.
fn continued(problem: &Problem, list: Vec<Ranked>, effort: Effort) -> Vec<Ranked> {
    list.into_par_iter()
        .map(|r| match r.fit.improved(problem, effort) {
            Some(fit) if fit.deviance < r.fit.deviance => Ranked::new(problem, fit),
            _ => r,
        })
        .collect()
}

/// The best leads: so many effects, so many places of each.
fn shortlist(leads: Vec<Lead>, effects: usize, places: usize) -> Vec<Lead> {
    let mut kept: Vec<Lead> = Vec::new();
    for lead in leads.into_iter().filter(|l| l.gain > HOPELESS) {
        let id = lead.instance.definition.id;
        let same = kept
            .iter()
            .filter(|l| l.instance.definition.id == id)
            .count();
        let mut ids: Vec<&str> = kept.iter().map(|l| l.instance.definition.id).collect();
        ids.sort_unstable();
        ids.dedup();
        if same >= places || (same == 0 && ids.len() >= effects) {
            continue;
        }
        kept.push(lead);
    }
    kept
}

/// Fits one lead; times of change are scanned to the sample, since no gradient finds them from afar.
pub(crate) fn fit_lead(
    problem: &Problem,
    structure: Structure,
    start: Vec<f64>,
    effort: Effort,
) -> Option<Fit> {
    let start = best_size(problem, &structure, start);
    let fit = Fit::run(problem, structure, start, None, effort)?;
    let last = fit.structure.effects.len().checked_sub(1);
    let Some(at) = last.and_then(|index| fit.structure.change_time(index)) else {
        return Some(fit);
    };
    let scanned = scan(problem, &fit, at)?;
    let better = Fit::run(
        problem,
        fit.structure.clone(),
        scanned,
        Some(&fit.noise),
        effort,
    )?;
    Some(if better.deviance < fit.deviance {
        better
    } else {
        fit
    })
}

/// The start whose size fits best: for laws that grow with their first number (delays, widths), whose gradient only
/// knows the neighbourhood.
fn best_size(problem: &Problem, structure: &Structure, start: Vec<f64>) -> Vec<f64> {
    let Some(effect) = structure.effects.last() else {
        return start;
    };
    if !effect.definition.grows_with_first() {
        return start;
    }
    let index = structure.effects.len() - 1;
    let at = structure.effect_offset(index) + effect.amplitudes(structure.states());
    let logarithmic = effect.definition.parameters[0].logarithmic;
    let h = problem.data.sample_time;
    let sizes: Vec<f64> = if effect.definition.parameters[0].unit == Unit::Second {
        [0.1, 0.3, 0.7, 1.3, 2.0, 3.0, 4.5, 7.0]
            .map(|samples| samples * h)
            .to_vec()
    } else {
        let own = if logarithmic {
            start[at].exp()
        } else {
            start[at]
        };
        [0.25, 0.5, 2.0, 4.0].map(|factor| factor * own).to_vec()
    };
    let cost = |theta: &[f64]| -> f64 {
        structure
            .simulate(theta, problem.data)
            .map_or(f64::INFINITY, |simulated| {
                let residual = problem.data.residual(&simulated);
                Noise::white(&residual, problem.data.outputs, &problem.mask)
                    .deviance(&residual, &problem.mask)
            })
    };
    let mut best = (cost(&start), start);
    for size in sizes {
        let mut trial = best.1.clone();
        trial[at] = if logarithmic { size.ln() } else { size };
        let now = cost(&trial);
        if now < best.0 {
            best = (now, trial);
        }
    }
    best.1
}

/// Coarse-to-fine scan of number `at`, the others held.
fn scan(problem: &Problem, fit: &Fit, at: usize) -> Option<Vec<f64>> {
    let length = problem.data.segments[0].samples() as f64 * problem.data.sample_time;
    let mut best = fit.theta.clone();
    let mut least = fit.deviance;
    let mut width = length / 20.0;
    while width > 0.5 * problem.data.sample_time {
        let centre = best[at];
        for i in [-3, -2, -1, 1, 2, 3] {
            let mut trial = best.clone();
            trial[at] = centre + width * f64::from(i) / 3.0;
            let Some(simulated) = fit.structure.simulate(&trial, problem.data) else {
                continue;
            };
            let deviance = fit
                .noise
                .deviance(&problem.data.residual(&simulated), &problem.mask);
            if deviance < least {
                least = deviance;
                best = trial;
            }
        }
        width /= 3.0;
    }
    Some(best)
}

/// Second effects beside each of `firsts`, which are forms of one effect: screened around their fits, then fitted
/// jointly; best first.
pub(crate) fn second_effects(
    problem: &Problem,
    firsts: &[&Ranked],
    allowed: &(dyn Fn(&Definition) -> bool + Sync),
) -> Vec<Ranked> {
    let leads: Vec<(usize, Lead)> = firsts
        .par_iter()
        .enumerate()
        .flat_map_iter(|(index, first)| {
            let mut basis = first.fit.clone();
            let taken: Vec<&str> = basis
                .structure
                .effects
                .iter()
                .map(|e| e.definition.id)
                .collect();
            let noise = basis.noise.clone();
            let other =
                |d: &Definition| allowed(d) && !taken.contains(&d.id) && d.id != "extra_mode";
            screen(problem, &mut basis, &[noise], &other)
                .into_iter()
                .flat_map(|list| shortlist(list, SECONDS_EACH, 1))
                .map(move |lead| (index, lead))
        })
        .collect();
    let jobs = leads
        .iter()
        .map(|(index, lead)| {
            let first = &firsts[*index].fit;
            extended(&first.structure, &first.theta, lead)
        })
        .collect();
    pursued(problem, jobs, PROMISING_SECONDS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explain::linear::fixtures::{SAMPLE_TIME, effect, recorded, spring};

    /// A gain that changes in the middle, looked for from some seconds away: no slope leads there.
    #[test]
    fn the_time_of_a_change_is_found_from_afar() {
        let changed = spring(vec![effect("gain_change", "")]);
        assert_eq!(changed.change_time(0), Some(1));
        let truth = [2.0, 40.03];
        for (seed, start) in [44.0, 38.0, 36.5].into_iter().enumerate() {
            let data = recorded(&changed, &truth, seed as u64);
            let problem = Problem::new(&data);
            let begin = vec![0.1, start];
            let fit = fit_lead(&problem, changed.clone(), begin.clone(), Effort::FINAL).unwrap();
            // As good as one that begins at the truth; noise moves the time by some samples.
            let run = |from| Fit::run(&problem, changed.clone(), from, None, Effort::FINAL);
            let best = run(truth.to_vec()).unwrap();
            assert!(
                fit.deviance < best.deviance + 0.5,
                "{:?} {:?}",
                fit.theta,
                best.theta
            );
            let off = (fit.theta[1] - truth[1]) / SAMPLE_TIME;
            assert!(off.abs() < 4.0, "{:?}", fit.theta);
            // No scan makes it worse than it was.
            let unscanned = run(begin).unwrap();
            assert!(fit.deviance <= unscanned.deviance + 1e-9);
        }
    }

    /// Times scatter about the truth as is stated; what the slope says does not.
    #[test]
    fn the_time_of_a_change_is_as_certain_as_is_said() {
        let changed = spring(vec![effect("gain_change", "")]);
        for (size, runs) in [(0.6, 60), (2.0, 60)] {
            let truth = [size, 40.0];
            let found: Vec<[f64; 2]> = (0..runs)
                .into_par_iter()
                .map(|seed| {
                    let data = recorded(&changed, &truth, 300 + seed);
                    let problem = Problem::new(&data);
                    let begin = vec![0.5 * size, 40.5];
                    let mut fit =
                        fit_lead(&problem, changed.clone(), begin, Effort::FINAL).unwrap();
                    let mut covariance = fit.certainty(&problem).unwrap().covariance;
                    let off = fit.theta[1] - truth[1];
                    let slope = off / covariance[(1, 1)].sqrt();
                    fit.ask_all_times(&problem, &mut covariance, 1);
                    [off / covariance[(1, 1)].sqrt(), slope]
                })
                .collect();
            let [said, slope] = [0, 1].map(|which| {
                let squares: f64 = found.iter().map(|z| z[which].powi(2)).sum();
                (squares / runs as f64).sqrt()
            });
            println!("size {size}: {said:.2} stated, {slope:.1} linearised deviations");
            let far = found.iter().filter(|z| z[0].abs() > 3.0).count();
            assert!(
                (0.6..1.4).contains(&said) && far <= 2,
                "{size}: {said} {far}"
            );
        }
    }
}
