//! One step of a search: score tests, fits of what they find, and the order of these.

use rayon::prelude::*;

use super::fitting::candidate::{Candidate, candidate};
use super::fitting::edit::Place;
use super::fitting::finish::finished;
use super::fitting::fitted::{Fitted, TIE, forms, order, searched, with_more};
use super::fitting::formulas::formulas;
use super::fitting::neighbours::{
    as_parameter_changes, as_plain_functions, of_one_variable, richer_form,
};
use super::fitting::refined_curve::refined_curve;
use super::fitting::release::released;
use super::fitting::second_effect::drop_alike;
use super::hypothesis::{Ground, trials};
use super::scope::Scope;
use super::screening::screen::{Lead, Screen, screen};
use super::terms::names::{SPECIFIC, called, named, rank_of};
use super::thresholds::{
    AT_A_PLACE, BETTER, COMPARED, FINISHED, FITTED, FOLLOWS, FORETOLD, GLANCE, GLANCED,
    GLANCED_STEPS, IMITATED, LEFT, MOST, MOST_STEPS, NEEDED, OF_A_KIND, THOROUGH, chance,
    times_more,
};
use crate::explain::explanation::EquationMap;
use crate::physics::estimate::{EstimateOptions, Fit, Form, PlantRecording, Study};
use crate::physics::{ModelSpec, Plant};

/// Part of the best gain that a term has whose richer forms are tried.
const RICHER: f64 = 0.5;

/// Terms with a name that are fitted at the place of a best that has none.
const NAMED_THERE: usize = 6;

/// What a lead gains at a glance, where it was found, and its fit.
type Glanced = (f64, Lead, usize, Candidate, Fit);

fn promising(screen: &Screen, spec: &ModelSpec, more: usize) -> Vec<Lead> {
    let mut kept: Vec<Lead> = Vec::new();
    for lead in &screen.leads {
        let kind = |l: &&Lead| l.term == lead.term;
        let same =
            |l: &Lead| l.term == lead.term && l.place == lead.place && l.argument == lead.argument;
        let place = |l: &&Lead| l.place == lead.place;
        if kept.iter().any(same)
            || kept.iter().filter(kind).count() >= OF_A_KIND
            || kept.iter().filter(place).count() >= more * AT_A_PLACE
        {
            continue;
        }
        kept.push(lead.clone());
        if kept.len() == more * GLANCED {
            break;
        }
    }
    // What has a name of its own is not crowded out by curves that imitate it, nor by its term in another place.
    let strong = screen.leads.first().map_or(0.0, |l| IMITATED * l.statistic);
    let variables = |l: &Lead| {
        l.argument
            .map_or(&[][..], |a| &screen.arguments[a].variables)
    };
    let specific =
        |l: &&Lead| l.statistic > strong && rank_of(spec, l.term, l.place, variables(l)) < SPECIFIC;
    let id = |l: &Lead| called(spec, l.term, l.place, variables(l));
    for lead in screen.leads.iter().filter(specific) {
        let same = |l: &Lead| l.term == lead.term && id(l) == id(lead);
        if !kept.iter().any(same) {
            kept.push(lead.clone());
        }
    }
    kept.extend(screen.curves.iter().cloned());
    kept
}

/// A plant in which something may be missing.
pub(super) struct Stage<'a> {
    pub(super) plant: &'a Plant,
    pub(super) study: &'a Study<'a>,
    pub(super) fit: &'a Fit,
    /// The plant before effects were found.
    pub(super) given: &'a ModelSpec,
    /// Gain that an effect needs.
    pub(super) needed: f64,
    /// Effects that were found, and the first of them.
    pub(super) accepted: usize,
    pub(super) first: Option<&'a Fitted>,
    pub(super) recordings: &'a [PlantRecording],
    pub(super) options: &'a EstimateOptions,
    pub(super) scope: &'a Scope,
    /// Hypotheses that are not yet part of the plant.
    pub(super) open: &'a [usize],
}

/// The fit of the plant alone from where a candidate has led, where that is better: what the term seemed to gain was a better
/// fit of the plant's own parameters.
pub(super) fn improved(stage: &Stage, fitted: &[Fitted]) -> Option<Fit> {
    let first = stage.study.parameters();
    let best = fitted
        .iter()
        .filter(|f| f.hypothesis.is_none() && f.gain > NEEDED);
    best.take(FINISHED)
        .filter_map(|f| stage.study.refit(&f.without_term(first), 1, THOROUGH))
        .filter(|again| again.criterion < stage.fit.criterion - BETTER)
        .min_by(|a, b| a.criterion.total_cmp(&b.criterion))
}

/// Of fits of one term from several starts the best.
fn drop_repeated(mut fitted: Vec<Fitted>) -> Vec<Fitted> {
    fitted.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let mut known: Vec<(&str, Place, String)> = Vec::new();
    fitted.retain(|f| {
        let this = (f.lead.term.id, f.lead.place, f.argument.clone());
        let new = !known.contains(&this);
        known.push(this);
        new
    });
    fitted
}

/// Where the fit of a candidate starts: with the other numbers as they were, or as the regression on its term moves them.
fn started(inner: &Study, made: &Candidate, lead: &Lead, (study, from): (&Study, &Fit)) -> Fit {
    let parameters = study.parameters();
    let plain = made.from(from, parameters);
    if lead.shift.is_empty() {
        return plain;
    }
    let moved = Fit {
        point: study.moved(from, &lead.shift),
        ..from.clone()
    };
    let moved = made.from(&moved, parameters);
    let deviance = |fit: &Fit| inner.deviance(fit).unwrap_or(f64::INFINITY);
    if deviance(&moved) < deviance(&plain) {
        moved
    } else {
        plain
    }
}

/// Whether a sensor shows more than a constant with the term in it.
fn still_shows((study, fit): (&Study, &Fit), lead: &Lead, spec: &ModelSpec) -> bool {
    if !lead.sensor {
        return true;
    }
    let variable = lead.place.variable(spec);
    let output = spec.outputs().into_iter().position(|y| y == variable);
    let left = output.and_then(|o| study.left(fit)?.get(o).copied());
    left.is_none_or(|left| left < FOLLOWS * FOLLOWS)
}

/// What a step has found.
pub(super) struct Step {
    /// Candidates, best first.
    pub(super) fitted: Vec<Fitted>,
    /// The strongest test, and how many there were.
    pub(super) strongest: (f64, usize),
    pub(super) map: Option<EquationMap>,
}

/// Fits the leads of a plant.
pub(super) fn step(stage: &Stage) -> Step {
    let Stage {
        plant,
        study,
        fit,
        given,
        needed,
        accepted,
        first,
        recordings,
        options,
        scope,
        open,
    } = *stage;
    let parameters = study.parameters();
    let mut tried: Vec<(Screen, Fit)> = Vec::new();
    if let Some(s) = screen(study, fit, fit, given, recordings) {
        tried.push((s, fit.clone()));
    }
    let strongest = tried.first().map_or((0.0, 0), |(s, _)| {
        let best = s.leads.first().map_or(0.0, |l| l.statistic);
        (study.information() * best, s.tests)
    });
    let map = tried.first().map(|(s, _)| s.map.clone());
    // Beside an effect that was found, a second one is looked for only where a test says that something is left.
    let insignificant = chance(strongest.0) * strongest.1 as f64 > LEFT;
    let nothing_left = accepted > 0 && insignificant || accepted == MOST;
    if nothing_left {
        for (screen, _) in &mut tried {
            screen.leads.clear();
            screen.curves.clear();
        }
    }
    // What the plant's parameters have done to make up for a term may lead far from what they are beside it.
    let text = (accepted == 0).then(|| study.nominal());
    let of_text = |from: &Fit| {
        let mut point = from.point.clone();
        let text = text.as_ref()?;
        point[..text.len()].copy_from_slice(text);
        Some(Fit {
            point,
            ..from.clone()
        })
    };
    // In free run with white noise: under the noise of a fit that does not follow, the values of the text lead to another that
    // does not.
    let free = Fit {
        form: Form::FreeRun,
        point: fit.point[..study.nominal().len()].to_vec(),
        ..fit.clone()
    };
    let from_text = study.gaussian(&free).and_then(|from| of_text(&from));
    // A noise model that was fitted where physics is missing absorbs it: the same again under white noise.
    let mut free_run = options.least_squares.then(|| fit.clone());
    if !nothing_left && !options.least_squares {
        free_run = study.least_squares(&fit.point).filter(|w| study.follows(w));
        if let Some(white) = &free_run
            && let Some(s) = screen(study, white, white, given, recordings)
        {
            tried.push((s, white.clone()));
        }
    }
    // Where a free run strays from the recording, what a term would do depends on where the recording was. That an observer
    // follows the noise too is of no matter for where fits start, but would be for the test above.
    if !nothing_left
        && let Some(white) = free_run.or_else(|| from_text.clone())
        && let Some(along) = study.along_recording(&white)
        && let Some(mut s) = screen(study, &white, &along, given, recordings)
    {
        // What depends on inputs or time alone is the same along both.
        s.leads
            .retain(|l| l.argument.is_some_and(|a| !s.arguments[a].held));
        tried.push((s, white));
    }
    // Heavy tails discount what is rare and large, such as the contact with an end stop, and an observer recovers from it: the
    // same again where every value counts.
    if !nothing_left
        && fit.form == Form::Innovation
        && fit.noise.degrees.is_finite()
        && let Some(gaussian) = study.gaussian(fit)
        && let Some(s) = screen(study, &gaussian, &gaussian, given, recordings)
        && chance(s.leads.first().map_or(0.0, |l| l.statistic)) * s.tests as f64 <= LEFT
    {
        tried.push((s, gaussian));
    }
    // Where there is no free run to look at, what no test finds is what a candidate does to the observer.
    if tried.len() == 1 && insignificant && !options.least_squares {
        tried[0].0.leads.clear();
        tried[0].0.curves.clear();
    }
    for (screen, _) in &mut tried {
        scope.restrict(&plant.spec, screen);
        if accepted > 0 {
            let least = FORETOLD * needed / study.information();
            screen.leads.retain(|l| l.statistic >= least);
            screen.curves.retain(|l| l.statistic >= least);
        }
        if let Some(first) = first {
            drop_alike(screen, &plant.spec, (first, named(given, first)));
        }
    }
    // A parameter that has gone to a bound to make up for what is missing stays there while a term is weak.
    let off_bounds = |from: &Fit| {
        let (inside, nominal) = (study.inside(from), study.nominal());
        let own = given.parameters().len();
        let mut point = from.point.clone();
        let mut moved = false;
        for i in (0..own).filter(|i| !inside.contains(i)) {
            moved |= point[i] != nominal[i];
            point[i] = nominal[i];
        }
        moved.then(|| Fit {
            point,
            ..from.clone()
        })
    };
    let more = times_more(study.count().max(study.samples()));
    let glance_lead = |(i, screen, from, lead): (usize, &Screen, &Fit, Lead)| {
        let made = candidate(&plant.spec, &lead, &screen.arguments, recordings)?;
        let options = with_more(options, made.values.len());
        let rough = made.rough(study, GLANCED_STEPS);
        let inner = study.of(&rough, &options).ok()?;
        let start = match screen.strays {
            true => started(&inner, &made, &lead, (study, from)),
            false => made.from(from, parameters),
        };
        // What a memory does within a sample, such as a contact, frozen slopes do not see.
        let glance = |start: &Fit| match made.new_states {
            0 => inner.glance(start, GLANCE),
            _ => inner.refit(start, 0, GLANCE),
        };
        let text = of_text(from)
            .filter(|_| more > 1)
            .or_else(|| off_bounds(from));
        let otherwise = text.and_then(|text| glance(&made.from(&text, parameters)));
        let fitted = (glance(&start).into_iter().chain(otherwise))
            .min_by(|a, b| a.deviance.total_cmp(&b.deviance))?;
        let again = |fit: &Fit| inner.refit(fit, 0, GLANCE);
        let fitted = released(&inner, lead.term, parameters, fitted, &again);
        Some((from.deviance - fitted.deviance, lead, i, made, fitted))
    };
    let mut glanced: Vec<Glanced> = tried
        .iter()
        .enumerate()
        .flat_map(|(i, (screen, from))| {
            promising(screen, &plant.spec, more)
                .into_iter()
                .map(move |lead| (i, screen, from, lead))
        })
        .collect::<Vec<_>>()
        .into_par_iter()
        .filter_map(glance_lead)
        .collect();
    glanced.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut chosen: Vec<(Lead, usize, Candidate, Fit)> = Vec::new();
    for (which, (screen, _)) in tried.iter().enumerate() {
        let list: Vec<_> = glanced.iter().filter(|g| g.2 == which).collect();
        let most = list.first().map_or(0.0, |g| g.0);
        let close = |g: &&_| {
            let (gain, lead, ..): &Glanced = g;
            let variables = lead
                .argument
                .map_or(&[][..], |a| &screen.arguments[a].variables);
            let specific = rank_of(&plant.spec, lead.term, lead.place, variables) < SPECIFIC;
            *gain > (1.0 - TIE.1) * most && specific
        };
        let best = list.iter().take(more * FITTED);
        let others = list.iter().skip(more * FITTED).copied().filter(close);
        chosen.extend(
            best.copied()
                .chain(others)
                .map(|g| (g.1.clone(), g.2, g.3.clone(), g.4.clone())),
        );
    }
    let fit_lead = |(lead, which, made, from): (Lead, usize, Candidate, Fit)| {
        let arguments = &tried[which].0.arguments;
        let options = with_more(options, made.values.len());
        let rough = made.rough(study, MOST_STEPS);
        let inner = study.of(&rough, &options).ok()?;
        let starts = forms(from, fit, study.gains());
        let best = starts
            .iter()
            .filter_map(|start| match made.new_states {
                0 => inner.compare(start, COMPARED),
                _ => inner.refit(start, 1, THOROUGH),
            })
            .filter(|fit| {
                fit.form == Form::Innovation
                    || inner.follows(fit) && still_shows((&inner, fit), &lead, &plant.spec)
            })
            .min_by(|a, b| a.criterion.total_cmp(&b.criterion))?;
        let gain = fit.criterion - best.criterion - searched(&lead, recordings);
        let argument = lead.argument.map(|a| &arguments[a]);
        let fitted = Fitted {
            depends: vec![],
            argument: String::new(),
            range: (0.0, 0.0),
            travel: 0.0,
            usual: 0.0,
            shapes: best.point[parameters..][..lead.shapes.len()].to_vec(),
            lead,
            candidate: made,
            fit: best,
            gain,
            hypothesis: None,
            explains: false,
            proved: false,
            likelier: false,
        };
        Some(fitted.depending_on(argument, &plant.spec, recordings))
    };
    let mut fitted: Vec<Fitted> = chosen.into_par_iter().filter_map(fit_lead).collect();
    // Where the best has no name, terms that have one at its place are fitted as well, whatever a glance said of them.
    let best = fitted.iter().max_by(|a, b| a.gain.total_cmp(&b.gain));
    if let Some(best) = best.filter(|f| f.gain > needed && named(&plant.spec, f) == "law") {
        let same =
            |a: &Lead, b: &Lead| (a.term, a.place, a.argument) == (b.term, b.place, b.argument);
        let known = |l: &Lead| fitted.iter().any(|f| same(&f.lead, l));
        let mut more: Vec<(usize, &Screen, &Fit, Lead)> = Vec::new();
        for (i, (screen, from)) in tried.iter().enumerate() {
            let at_place = screen.leads.iter().filter(|l| l.place == best.lead.place);
            for lead in at_place.filter(|l| !known(l)) {
                let variables = lead
                    .argument
                    .map_or(&[][..], |a| &screen.arguments[a].variables);
                let specific = rank_of(&plant.spec, lead.term, lead.place, variables) < SPECIFIC;
                let again = more.iter().any(|m| same(&m.3, lead));
                let of_term = more.iter().filter(|m| m.3.term == lead.term).count();
                if specific && !again && of_term < 2 && more.len() < NAMED_THERE {
                    more.push((i, screen, from, lead.clone()));
                }
            }
        }
        let glanced = more.into_par_iter().filter_map(glance_lead);
        let chosen = glanced.map(|(_, lead, i, made, fit)| (lead, i, made, fit));
        fitted.extend(chosen.filter_map(fit_lead).collect::<Vec<_>>());
    }
    let fitted = drop_repeated(fitted);
    let mut fitted = finished(fitted, study, fit, recordings, options);
    fitted.retain(|f| f.gain <= NEEDED || f.gain_without_few(study, fit, options) > NEEDED);
    // Values of the fit may make another name of a term.
    fitted.retain(|f| scope.allows(named(&plant.spec, f)));
    let mut origins = vec![fit];
    origins.extend(tried.iter().skip(1).map(|(_, white)| white));
    origins.extend(&from_text);
    let ground = Ground {
        plant,
        study,
        fit,
        origins,
        recordings,
        options,
    };
    fitted.extend(trials(&scope.hypotheses, open, &ground));
    // A formula says in two or three numbers what a curve says in nine or more. Of equals the curve stays: it is level beyond
    // its ends.
    let best = fitted.iter().map(|f| f.gain).fold(0.0, f64::max);
    let unlisted = |f: &Fitted| {
        let unnamed = f.hypothesis.is_none() && named(&plant.spec, f) == "law";
        f.lead.curve.is_some() || unnamed && matches!(f.lead.place, Place::Equation(_))
    };
    let close = |f: &&Fitted| unlisted(f) && f.gain > (1.0 - TIE.1) * best;
    let closest = (fitted.iter().filter(close)).max_by(|a, b| a.gain.total_cmp(&b.gain));
    let closest = closest.and_then(|c| fitted.iter().position(|f| std::ptr::eq(f, c)));
    if let (Some(at), Some((screen, _))) = (closest, tried.first()) {
        let mut better = formulas(&fitted[at], &screen.arguments, &ground);
        if let Some(finer) = refined_curve(&fitted[at], &screen.arguments, &ground) {
            better.extend(formulas(&finer, &screen.arguments, &ground));
            fitted[at] = finer;
        }
        let curve = &fitted[at];
        better.retain(|f| f.gain > curve.gain + TIE.0);
        fitted.extend(better);
    }
    if let Some((screen, _)) = tried.first() {
        let mut best_first: Vec<usize> = (0..fitted.len())
            .filter(|&i| fitted[i].hypothesis.is_none() && fitted[i].gain > RICHER * best)
            .collect();
        best_first.sort_by(|&a, &b| fitted[b].gain.total_cmp(&fitted[a].gain));
        for (rank, &i) in best_first.iter().take(FINISHED).enumerate() {
            let one = &fitted[i];
            let better = richer_form(one, &screen.arguments, &ground);
            let close = rank == 0 && one.gain > (1.0 - TIE.1) * best;
            let of_one = || of_one_variable(one, &screen.arguments, &ground);
            let better = better.or_else(|| close.then(of_one).flatten());
            if let Some(better) = better {
                fitted[i] = better;
            }
        }
        let one = fitted.iter().filter(|f| f.hypothesis.is_none());
        if let Some(one) = one.max_by(|a, b| a.gain.total_cmp(&b.gain)) {
            let mut changes = as_parameter_changes(one, given, &screen.arguments, &ground);
            changes.extend(as_plain_functions(one, &screen.arguments, &ground));
            changes.retain(|f| scope.allows(named(&plant.spec, f)));
            let again = |f: &Fitted| {
                let of = |f: &Fitted| (f.lead.term, f.lead.place, f.argument.clone());
                let same = |c: &Fitted| of(c) == of(f);
                changes.iter().any(|c| same(c) && c.gain > f.gain)
            };
            fitted.retain(|f| !again(f));
            fitted.extend(changes);
        }
    }
    fitted.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    order(&plant.spec, &mut fitted);
    Step {
        fitted,
        strongest,
        map,
    }
}
