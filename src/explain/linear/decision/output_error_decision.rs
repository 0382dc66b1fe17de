//! Decides: consistent, parameters, named, family or unexplained.

use rayon::prelude::*;

use crate::explain::effects::{self, Definition};
use crate::explain::explanation::Verdict;
use crate::explain::linear::check::coarse_sensor;
use crate::explain::linear::check::{Freeze, Trouble, frozen};
use crate::explain::linear::data::{Data, difference};
use crate::explain::linear::fit::{Effort, Fit, Problem};
use crate::explain::linear::known::Known;
use crate::explain::linear::model::structure::Structure;
use crate::explain::linear::screening::output_adequacy::{Adequacy, adequacy};
use crate::explain::linear::search::forward_selection::{
    self, pair, polished, validated_gain, with_feedthrough,
};
use crate::explain::linear::search::null_models::Boring;
use crate::explain::linear::search::penalties::{NEEDED, penalty};
use crate::explain::linear::search::plausibility::{add_free_twins, plant_may_stay, reaches, sane};
use crate::explain::linear::search::richer_laws::{
    FURTHER, REFINEMENTS, decides_within, derived, finer_steps,
};
use crate::explain::linear::search::single_effects::{Ranked, fit_lead, single_effects};
use crate::noise::{Colours, Mask};

/// Names whose criteria differ by less explain the recording equally well (Kass and Raftery 1995: 6 is "strong").
const TIE: f64 = crate::explain::explanation::EFFECTS_TIE;
/// Evidence from which held-out blocks are not asked: they could not say otherwise.
const BEYOND_DOUBT: f64 = 100.0;
/// With a larger probability what is left is called noise, and no second effect is looked for.
const NOTHING_LEFT: f64 = 0.02;
/// Share from which nothing else is looked for: rounding would be taken for anything.
const MOSTLY_COARSE: f64 = 0.3;

/// A rival of the answer.
#[derive(Debug, Clone)]
pub(crate) struct Rival {
    pub(crate) definition: &'static Definition,
    /// How much better (in the criterion) than the best boring explanation.
    pub(crate) gain: f64,
}

/// All that was found.
#[derive(Debug, Clone)]
pub(crate) struct Finding {
    pub(crate) verdict: Verdict,
    pub(crate) boring: Boring,
    /// The model that stands: boring or augmented.
    pub(crate) model: Fit,
    /// Best augmented model, named or not.
    pub(crate) augmented: Option<Fit>,
    /// How much better it is than the best boring explanation.
    pub(crate) gain: f64,
    /// Others, best first.
    pub(crate) rivals: Vec<Rival>,
    /// What was wrong with the data before anything was looked for in them.
    pub(crate) troubles: Vec<Trouble>,
    pub(crate) freezes: Vec<Freeze>,
    /// Output and step of a coarse sensor.
    pub(crate) coarse: Option<(usize, f64)>,
    pub(crate) adequacy: Option<Adequacy>,
    pub(crate) count: usize,
    /// Samples that were set aside before anything was looked at.
    pub(crate) heldout: Mask,
    /// What effects that were not found would have had to be: size in the output over its standard deviation.
    pub(crate) detectable: Vec<(
        &'static Definition,
        crate::explain::linear::model::structure::Instance,
        f64,
    )>,
    /// What was decided by the averaged equation of motion.
    pub(crate) weak: Option<Box<crate::explain::linear::weak_form::equation_proof::Proof>>,
}

impl Finding {
    /// Adds what was wrong with the data: where nothing else is missing, it is the answer.
    pub(crate) fn add(&mut self, troubles: Vec<Trouble>) {
        if troubles.iter().any(|t| t.kind.id().is_some())
            && matches!(self.verdict, Verdict::Consistent | Verdict::Parameters)
        {
            self.verdict = Verdict::Named;
        } else if troubles.iter().any(|t| t.kind.is_relation())
            && self.verdict == Verdict::Consistent
        {
            self.verdict = Verdict::Parameters;
        }
        self.troubles = troubles;
    }

    /// Root mean square free-run error of each half of `data` when the numbers of the model that stands are fitted to the
    /// other, over the standard deviation of what was recorded, where `mask` counts; `None` where a half does not determine
    /// them. Of drives: one output.
    pub(crate) fn error_across_halves(&self, data: &Data, mask: &Mask) -> Option<f64> {
        let problem = Problem {
            mask: mask.clone(),
            ..Problem::new(data)
        };
        let error = match &self.weak {
            Some(proof) => proof.error_across_halves(&problem),
            None => crate::explain::linear::search::cross_validation::across_halves(
                &problem.mask,
                |own| {
                    Some(
                        crate::explain::linear::search::cross_validation::refit(
                            &problem,
                            &self.model,
                            own,
                        )?
                        .residual,
                    )
                },
            ),
        };
        Some(error? / problem.scale[0])
    }
}

/// Runs the whole inquiry. `structure` is the simulation as it is known, `mask` the samples that count.
pub(crate) fn inquire(
    known: &Known,
    mask: Mask,
    allowed: &(dyn Fn(&Definition) -> bool + Sync),
) -> Option<(Finding, Mask)> {
    let (data, structure) = (&known.data, &known.structure);
    let mut problem = Problem::new(data);
    let mut heldout;
    (problem.mask, heldout) =
        crate::explain::linear::search::cross_validation::set_aside(data, &mask);
    let said = structure.simulate(&structure.given(), data)?;
    let freezes = if allowed(effects::find("sensor_freeze", "")?) {
        frozen(data, &said)
    } else {
        Vec::new()
    };
    for freeze in &freezes {
        let mask = &mut problem.mask[freeze.segment * data.outputs + freeze.output];
        mask[freeze.from + 1..freeze.to].fill(false);
        heldout[freeze.segment * data.outputs + freeze.output][freeze.from + 1..freeze.to]
            .fill(false);
    }
    let count = problem.count();
    let refit = known
        .identified
        .then(|| output_error_refit(&problem))
        .flatten();
    let mut boring = Boring::fit(&problem, structure, refit.as_ref())?;
    // An identified baseline never asked for a direct feedthrough: without it any law makes up for it.
    if let Some(direct) = with_feedthrough(&problem, &boring.full) {
        boring.full = direct;
    }
    // A plant that is known as well as a recording of this length tells costs next to nothing: its numbers are looked for
    // within their uncertainty, not anywhere.
    let known_plant =
        structure.coordinates.len() as f64 * ((count.max(2) as f64).ln() - std::f64::consts::LN_2);
    let same_plant = |fit: &Fit| {
        fit.structure.plant_free
            && known.uncertainty.as_ref().is_some_and(|uncertainty| {
                uncertainty
                    .p_value(&problem, fit)
                    .is_some_and(|p| p > SAME_PLANT)
            })
    };
    let least = |boring: &Boring| {
        let least = boring.best(count).criterion(count);
        match same_plant(&boring.full) {
            true => least.min(boring.full.criterion(count) - known_plant),
            false => least,
        }
    };
    let mut base = least(&boring);
    let coarse = if allowed(effects::find("sensor_quantization", "")?) {
        coarse_sensor(data, &boring.best(count).residual, &problem.mask)
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
        troubles: Vec::new(),
        freezes,
        coarse: coarse.map(|(output, step, _)| (output, step)),
        adequacy: None,
        count,
        heldout,
        detectable: Vec::new(),
        weak: None,
    };
    if coarse.is_some_and(|(_, _, share)| share > MOSTLY_COARSE) {
        // Rounding is most of what is left: it is the answer, and its error would be taken for anything.
        finding.verdict = Verdict::Named;
        finding.model = finding.boring.near.clone();
        return Some((finding, problem.mask));
    }
    let mut ranked = single_effects(&problem, &finding.boring, allowed);
    let promising: Vec<&Fit> = (ranked.iter())
        .filter(|r| base - r.criterion > NEEDED)
        .map(|r| &r.fit)
        .collect();
    if finding.boring.improve_from(&problem, &promising) {
        base = least(&finding.boring);
        finding.model = finding.boring.best(count).clone();
    }
    for refinements in [REFINEMENTS, FURTHER] {
        ranked.extend(derived(&problem, refinements, &ranked, base, allowed));
    }
    let leader = ranked
        .iter()
        .min_by(|a, b| a.criterion.total_cmp(&b.criterion));
    // A law that leaves structure may only have been run too coarsely.
    if leader.is_some_and(|r| {
        base - r.criterion > BEYOND_DOUBT
            && decides_within(&r.fit)
            && adequacy(&problem, &r.fit, &finding.boring.given, None).is_some_and(|a| {
                a.p_value < crate::explain::linear::screening::output_adequacy::LEVEL
            })
    }) {
        ranked.extend(finer_steps(&problem, &ranked, base, allowed));
    }
    for r in &mut ranked {
        if same_plant(&r.fit) {
            r.criterion -= known_plant;
        }
        r.criterion += penalty(r, base, count);
    }
    ranked.retain(|r| sane(&problem, &r.fit));
    add_free_twins(&problem, &finding.boring, &mut ranked, base);
    let mut ranked_all = ranked.clone();
    let uncertainty = known.uncertainty.as_ref();
    ranked.retain(|r| plant_may_stay(&problem, r, &ranked_all, uncertainty));
    // Plants of another class, which no effect added to the linear one becomes.
    ranked.extend(
        crate::explain::linear::search::rectified_sensor::candidates(&problem, structure, allowed),
    );
    ranked.sort_by(|a, b| a.criterion.total_cmp(&b.criterion));
    let of_one = in_one_recording_each(&problem, &ranked, base);
    ranked.extend(of_one);
    ranked.sort_by(|a, b| a.criterion.total_cmp(&b.criterion));
    finding.rivals = rivals(&ranked, base);
    finding.detectable = detectable(&problem, &ranked);
    let needed = NEEDED;
    // Blocks that were not fitted must show the gain in proportion to their share, as far as chance allows
    // (beside a plant as given the gain is one over that plant: over a free one it is mostly fewer numbers).
    let best = ranked.iter().take(4).find(|r| {
        let gain = base - r.criterion;
        let before = if r.fit.structure.plant_free {
            finding.boring.best(count)
        } else {
            &finding.boring.near
        };
        let all = (before.criterion(count) - r.criterion).max(gain);
        gain > needed
            && (gain > BEYOND_DOUBT
                || validated_gain(&problem, before, &r.fit)
                    .is_some_and(|held| held.gain > least_heldout(held.share * all)))
            && reaches(&r.fit, &finding.boring.full, known.uncertainty.is_some())
    });
    if let Some(best) = best {
        // A plant of another class has been searched with everything that comes with it, and to the end.
        let other_class = best.fit.structure.new_effects().len() > 1;
        let mut fit = if other_class {
            best.fit.clone()
        } else {
            let first = polished(&problem, &best.fit);
            match base - first.criterion(count) > BEYOND_DOUBT {
                true => found_again(&problem, structure, refit.as_ref(), first, allowed),
                false => first,
            }
        };
        if let Some(direct) = with_feedthrough(&problem, &fit) {
            fit = direct;
            ranked_all.push(Ranked::new(&problem, fit.clone()));
        }
        let judged =
            |fit: &Fit| fit.criterion(count) - if same_plant(fit) { known_plant } else { 0.0 };
        let mut gain = base - judged(&fit);
        // Where nothing is left, or less than a second effect must bring, there is none to find.
        let left = adequacy(&problem, &fit, &finding.boring.given, None);
        let nothing_left = left.is_some_and(|a| {
            a.p_value > NOTHING_LEFT || a.gain(count) < forward_selection::required(gain)
        });
        let second = if nothing_left || other_class {
            None
        } else {
            pair(&problem, &ranked_all, finding.boring.best(count), allowed)
        };
        if let Some(pair) = second {
            gain = gain.max(base - judged(&pair));
            fit = pair;
        }
        finding.gain = gain;
        finding.adequacy = adequacy(
            &problem,
            &fit,
            &finding.boring.given,
            Some(finding.boring.best(count)),
        );
        if other_class {
            let before = problem.mean_square(&finding.boring.best(count).residual);
            let now = problem.mean_square(&fit.residual);
            finding.adequacy = finding.adequacy.map(|a| a.of_class(before, now));
        }
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
        finding.adequacy = adequacy(
            &problem,
            finding.boring.best(count),
            &finding.boring.given,
            None,
        );
        // What the fewest numbers leave may be little things about the plant, which all of them hold.
        if finding.adequacy.is_some_and(|a| !a.holds()) {
            let full = &finding.boring.full;
            let left = adequacy(&problem, full, &finding.boring.given, None);
            if left.is_some_and(|a| a.holds()) {
                finding.adequacy = left;
                finding.model = full.clone();
                finding.boring.near = full.clone();
            }
        }
        let as_given = finding.boring.given.criterion(count) <= base + 1e-9;
        let refused = as_given && finding.boring.refuses_given();
        if refused {
            finding.model = finding.boring.full.clone();
            finding.boring.near = finding.boring.full.clone();
        }
        // Rounding is no noise: what it makes up may show as structure.
        let rounded = coarse.map_or(0.0, |(_, _, share)| share);
        let holds = finding
            .adequacy
            .is_none_or(|a| a.holds() || a.share < rounded);
        finding.verdict = if !holds {
            Verdict::Unexplained
        } else if !finding.freezes.is_empty() || finding.coarse.is_some() {
            Verdict::Named
        } else if as_given && !refused || is_as_identified(known, &problem, &finding.boring) {
            Verdict::Consistent
        } else {
            Verdict::Parameters
        };
    }
    Some((finding, problem.mask))
}

/// Probability of a larger difference between two recordings of one plant, below which its parameters are said to have
/// changed.
const SAME_PLANT: f64 = 1e-3;

/// The fit of an effect, or that of another search for it alone, which is better. Noise models with several poles and zeros follow
/// what a plant lacks as closely as its noise, and may lead a search to another optimum than simple ones.
fn found_again(
    problem: &Problem,
    structure: &Structure,
    refit: Option<&Structure>,
    first: Fit,
    allowed: &(dyn Fn(&Definition) -> bool + Sync),
) -> Fit {
    let count = problem.count();
    let simple = Problem {
        colours: Colours::Simple,
        ..problem.clone()
    };
    let again = || {
        let id = first.structure.new_effects().last()?.definition.id;
        let only = |d: &Definition| d.id == id && allowed(d);
        let mut boring = Boring::fit(&simple, structure, refit)?;
        if let Some(direct) = with_feedthrough(&simple, &boring.full) {
            boring.full = direct;
        }
        let mut ranked = single_effects(&simple, &boring, &only);
        let promising: Vec<&Fit> = ranked.iter().map(|r| &r.fit).collect();
        boring.improve_from(&simple, &promising);
        let base = boring.best(count).criterion(count);
        for refinements in [REFINEMENTS, FURTHER] {
            ranked.extend(derived(&simple, refinements, &ranked, base, &only));
        }
        let best = ranked.iter().filter(|r| sane(problem, &r.fit));
        let best = best.min_by(|a, b| a.criterion.total_cmp(&b.criterion))?;
        Some(polished(
            problem,
            &best.fit.improved(problem, Effort::RANK)?,
        ))
    };
    let better = again().filter(|fit| fit.criterion(count) < first.criterion(count) - TIE);
    better.unwrap_or(first)
}

/// Whether an identified simulation differs from the best fit by no more than both are uncertain by.
fn is_as_identified(known: &Known, problem: &Problem, boring: &Boring) -> bool {
    known.uncertainty.as_ref().is_some_and(|uncertainty| {
        uncertainty
            .p_value(problem, &boring.full)
            .is_some_and(|p| p > SAME_PLANT)
    })
}

/// A linear plant of one input and output by simulation error, from which parameters may be fitted: what predicts one step
/// ahead may be of another order, unstable or poor in simulation.
fn output_error_refit(problem: &Problem) -> Option<Structure> {
    let data = problem.data;
    if data.signals() != 1 || data.outputs != 1 || !data.constant {
        return None;
    }
    let plant = crate::explain::linear::identification::steiglitz_mcbride::rebaseline(data)?;
    let (initial, _) =
        crate::explain::linear::identification::autoregression::initial_states(&plant, data)?;
    Some(Structure {
        plant_free: true,
        initial_free: true,
        ..crate::explain::linear::model::structure::without_effects::bare(&plant, &initial)
    })
}

/// Effects that are fitted to the end in one recording only: those that promise most after a first step.
const IN_ONE: usize = 6;

/// Effects in one recording only, where that explains all of them better: what acts in one explains little of all, and another
/// effect may come before it there.
fn in_one_recording_each(problem: &Problem, ranked: &[Ranked], base: f64) -> Vec<Ranked> {
    let recordings = problem.data.segments.len();
    if recordings < 2 {
        return Vec::new();
    }
    let mut best: Vec<&Ranked> = Vec::new();
    let definition = |r: &Ranked| r.fit.structure.new_effects()[0].definition.id;
    for r in ranked {
        let single = r.fit.structure.new_effects().len() == 1;
        if single && best.iter().all(|b| definition(b) != definition(r)) {
            best.push(r);
        }
    }
    let count = problem.count();
    let mut glanced: Vec<(&Ranked, Fit)> = (best.into_par_iter())
        .flat_map_iter(|r| (0..recordings).map(move |recording| (r, recording)))
        .filter_map(|(r, recording)| Some((r, glanced_in_one(problem, &r.fit, recording)?)))
        .collect();
    glanced.sort_by(|a, b| a.1.criterion(count).total_cmp(&b.1.criterion(count)));
    glanced.truncate(IN_ONE);
    let of_one = |(all, glanced): (&Ranked, Fit)| {
        let fit = fit_lead(problem, glanced.structure, glanced.theta, Effort::FINAL)?;
        let better = fit.criterion(count) + chosen_among(problem) < all.fit.criterion(count);
        let mut one = Ranked::new(problem, fit);
        one.criterion += penalty(&one, base, count) + chosen_among(problem);
        (better && sane(problem, &one.fit)).then_some(one)
    };
    glanced.into_par_iter().filter_map(of_one).collect()
}

/// What the choice of a recording owes.
fn chosen_among(problem: &Problem) -> f64 {
    2.0 * (problem.data.segments.len() as f64).ln()
}

/// The effect of `fit` in one recording only, after a first step.
fn glanced_in_one(problem: &Problem, fit: &Fit, recording: usize) -> Option<Fit> {
    let structure = Structure {
        recording: Some(recording),
        ..fit.structure.clone()
    };
    let starts = starts_of_change(problem, &structure, &fit.theta, recording);
    let glanced = starts.into_iter().filter_map(|start| {
        let noise = Some(&fit.noise);
        Fit::run(problem, structure.clone(), start, noise, Effort::GLANCE)
    });
    glanced.min_by(|a, b| a.deviance.total_cmp(&b.deviance))
}

/// Times that are tried for a change in one recording.
const CHANGES_TRIED: usize = 12;

/// Where the fit of an effect in one recording starts: what changes at a time may do so at any time of it, not at the one that all
/// recordings together have shown.
fn starts_of_change(
    problem: &Problem,
    structure: &Structure,
    theta: &[f64],
    recording: usize,
) -> Vec<Vec<f64>> {
    let mut starts = vec![theta.to_vec()];
    if let Some(at) = structure.change_time(structure.first_new()) {
        let segment = &problem.data.segments[recording];
        let length = segment.samples() as f64 * problem.data.sample_time;
        starts.extend((1..=CHANGES_TRIED).map(|i| {
            let mut start = theta.to_vec();
            start[at] = segment.start_time + length * i as f64 / (CHANGES_TRIED + 1) as f64;
            start
        }));
    }
    starts
}

/// What blocks that were not fitted must show of a gain of which `expected` falls to their share: twice a log
/// likelihood ratio has a standard deviation of `2 sqrt(mean)`, and one true effect in twenty may be lost.
fn least_heldout(expected: f64) -> f64 {
    (expected - 1.645 * 2.0 * expected.max(0.0).sqrt()).max(0.0)
}

/// For each effect that was fitted: the size in the output at which its evidence would have sufficed. The evidence
/// grows with the square of the size, and the fit's own size has an evidence of its deviance.
fn detectable(
    problem: &Problem,
    ranked: &[Ranked],
) -> Vec<(
    &'static Definition,
    crate::explain::linear::model::structure::Instance,
    f64,
)> {
    let mut list: Vec<(
        &'static Definition,
        crate::explain::linear::model::structure::Instance,
        f64,
    )> = Vec::new();
    for r in ranked {
        let instance = r.fit.structure.new_effects()[0];
        if list.iter().any(|l| l.0.id == instance.definition.id) {
            continue;
        }
        let (without, theta) = r.fit.structure.without_new_effects(&r.fit.theta);
        let Some(simulated) = without.simulate(&theta, problem.data) else {
            continue;
        };
        let change = problem.size(&difference(&simulated, &r.fit.simulated));
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
