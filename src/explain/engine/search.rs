//! From score tests to fits: candidates are fitted one by one, ranked by one criterion, and added one after the other.

use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::candidate::{Candidate, candidate};
use super::eliminate::alone;
use super::finish::finished;
use super::fitted::{Fitted, TIE, order, searched, with_more};
use super::holdout::{EXPLAINED, Estimator, HeldOut, held_out};
use super::hypothesis::{Ground, Trial, trials};
use super::library::Needs;
use super::names::{SPECIFIC, named, rank_of};
use super::scope::Scope;
use super::screen::{Lead, Screen, screen};
use super::second_effect::{determined, differs, drop_alike};
use super::select::EQUAL;
use crate::physics::estimate::{
    Effort, EstimateError, EstimateOptions, Fit, Form, PlantRecording, Study,
};
use crate::physics::{Hold, ModelSpec, Plant};

/// Leads of each screen that are fitted with the noise of the fit before.
const GLANCED: usize = 12;
/// ... of them at most so many of one kind and at one place.
const OF_A_KIND: usize = 3;
const AT_A_PLACE: usize = 6;
/// The best lead of each term is fitted too where its statistic is at least this part of the best.
const IMITATED: f64 = 0.3;
pub(super) const GLANCE: Effort = Effort {
    iterations: 4,
    settled: 0.3,
    attempts: 4,
};
/// Error of a step where fits are only compared with each other.
const GLANCED_ACCURACY: f64 = 1e-6;
/// Steps a sample that a candidate may need, on average; one that needs more is left out, for the time it costs.
const GLANCED_STEPS: usize = 20;
pub(super) const MOST_STEPS: usize = 60;
/// The best of these are fitted with a noise model of their own, and the best of them until nothing changes.
const FITTED: usize = 5;
pub(super) const FINISHED: usize = 4;
pub(super) const THOROUGH: Effort = Effort {
    iterations: 20,
    settled: 0.05,
    attempts: 8,
};
/// Effort where fits are compared before the best of them are finished.
const COMPARED: Effort = Effort {
    iterations: 10,
    settled: 0.5,
    attempts: 6,
};
pub(super) const ROUNDS: usize = 2;
/// Gain in Schwarz's criterion that is needed, beyond the penalty for what was searched: odds of e^8 (math/physics.md).
pub(crate) const NEEDED: f64 = 16.0;
/// A name is given where the gain is at least this; between [`NEEDED`] and this the place is given, and the best term as a
/// rival (math/physics.md, "Fits and decision").
pub(crate) const SURE: f64 = 24.0;
/// Beside an effect, terms are fitted whose test foretells this part of the gain that is needed.
const FORETOLD: f64 = 0.25;
/// A second effect must gain more, and at least this part of the first.
pub(super) const SECOND: (f64, f64) = (30.0, 0.12);
/// Level of the test that asks for one: of all score tests together.
pub(crate) const LEFT: f64 = 0.01;
/// A better fit of the plant itself is taken from here on, and so often at most.
const BETTER: f64 = 1.0;
const BETTER_FITS: usize = 2;
/// Most effects that are named.
const MOST: usize = 2;

/// What the search has found.
pub(crate) struct Found {
    pub(crate) given: Plant,
    pub(crate) baseline: Fit,
    /// Effects in the order in which they were added, each with its rivals, best first.
    pub(crate) steps: Vec<Vec<Fitted>>,
    /// The strongest test before the first effect, after it, and so on, and how many there were.
    pub(crate) tests: Vec<(f64, usize)>,
    /// The plant with everything that was accepted, its fit, and the covariance of its numbers.
    pub(crate) plant: Plant,
    pub(crate) fit: Fit,
    pub(crate) accepted: usize,
    /// What the recordings say about each hypothesis.
    pub(crate) trials: Vec<Trial>,
    pub(crate) options: EstimateOptions,
    /// Information in a value of what the fit leaves, as a part of that in a value with independent noise.
    pub(crate) information: f64,
    /// Free runs in blocks that the fit had not seen, without and with the effects; none where the plant does not run freely.
    pub(crate) held_out: Option<[HeldOut; 2]>,
}

/// What fits are compared by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Objective {
    /// The likelihood of the recordings, with a noise model or an observer.
    Likelihood,
    /// The mean square of the error of the free run, with as many values as are independent.
    FreeRun,
}

impl Found {
    /// The strongest test at the end, and how many there were.
    pub(crate) fn left(&self) -> (f64, usize) {
        self.tests.get(self.accepted).copied().unwrap_or_default()
    }

    /// The plant with so many effects, and its fit.
    pub(crate) fn stage(&self, accepted: usize) -> (&Plant, &Fit) {
        match accepted.checked_sub(1) {
            _ if accepted == self.accepted => (&self.plant, &self.fit),
            None => (&self.given, &self.baseline),
            Some(last) => (
                &self.steps[last][0].candidate.plant,
                &self.steps[last][0].fit,
            ),
        }
    }

    /// Drops all effects but the first `accepted`.
    pub(crate) fn keep(&mut self, accepted: usize) {
        if accepted >= self.accepted {
            return;
        }
        let (plant, fit) = self.stage(accepted);
        (self.plant, self.fit) = (plant.clone(), fit.clone());
        self.options
            .free
            .truncate(self.plant.spec.parameters().len());
        self.accepted = accepted;
        for trial in &mut self.trials {
            trial.accepted = trial.accepted.filter(|&step| step < accepted);
        }
    }
}

/// Probability of a chi-square with one degree of freedom beyond `statistic`.
pub(crate) fn chance(statistic: f64) -> f64 {
    ChiSquared::new(1.0).map_or(1.0, |law| law.sf(statistic))
}

fn promising(screen: &Screen, spec: &ModelSpec) -> Vec<Lead> {
    let mut kept: Vec<Lead> = Vec::new();
    for lead in &screen.leads {
        let kind = |l: &&Lead| l.term == lead.term;
        let same =
            |l: &Lead| l.term == lead.term && l.place == lead.place && l.argument == lead.argument;
        let place = |l: &&Lead| l.place == lead.place;
        if kept.iter().any(same)
            || kept.iter().filter(kind).count() >= OF_A_KIND
            || kept.iter().filter(place).count() >= AT_A_PLACE
        {
            continue;
        }
        kept.push(lead.clone());
        if kept.len() == GLANCED {
            break;
        }
    }
    // What has a name of its own is not crowded out by curves that imitate it.
    let strong = screen.leads.first().map_or(0.0, |l| IMITATED * l.statistic);
    let specific = |l: &&Lead| {
        let variables = l
            .argument
            .map_or(&[][..], |a| &screen.arguments[a].variables);
        l.statistic > strong && rank_of(spec, l.term, l.place, variables) < SPECIFIC
    };
    for lead in screen.leads.iter().filter(specific) {
        if !kept.iter().any(|l| l.term == lead.term) {
            kept.push(lead.clone());
        }
    }
    kept.extend(screen.curves.iter().cloned());
    kept
}

/// A plant in which something may be missing.
struct Stage<'a> {
    plant: &'a Plant,
    study: &'a Study<'a>,
    fit: &'a Fit,
    /// The plant before effects were found.
    given: &'a ModelSpec,
    /// Gain that an effect needs.
    needed: f64,
    /// Effects that were found, and the first of them.
    accepted: usize,
    first: Option<&'a Fitted>,
    recordings: &'a [PlantRecording],
    options: &'a EstimateOptions,
    scope: &'a Scope,
    /// Hypotheses that are not yet part of the plant.
    open: &'a [usize],
}

/// The fit of the plant alone from where a candidate has led, where that is better: what the term seemed to gain was a better
/// fit of the plant's own parameters.
fn improved(stage: &Stage, fitted: &[Fitted]) -> Option<Fit> {
    let first = stage.study.parameters();
    let best = fitted
        .iter()
        .filter(|f| f.hypothesis.is_none() && f.gain > NEEDED);
    best.take(FINISHED)
        .filter(|f| f.candidate.new_states == 0)
        .filter_map(|f| {
            let mut point = f.fit.point.clone();
            point.drain(first..first + f.candidate.values.len());
            let from = Fit {
                point,
                ..f.fit.clone()
            };
            stage.study.refit(&from, 1, THOROUGH)
        })
        .filter(|again| again.criterion < stage.fit.criterion - BETTER)
        .min_by(|a, b| a.criterion.total_cmp(&b.criterion))
}

/// Where the fit of a candidate starts: with the other numbers as they were, or as the regression on its term moves them.
fn started(inner: &Study, made: &Candidate, lead: &Lead, (study, from): (&Study, &Fit)) -> Fit {
    let states = study.plant().spec.states().len();
    let (parameters, outputs) = (study.parameters(), study.outputs());
    let plain = made.from(from, parameters, states, outputs);
    if lead.shift.is_empty() {
        return plain;
    }
    let moved = Fit {
        point: study.moved(from, &lead.shift),
        ..from.clone()
    };
    let moved = made.from(&moved, parameters, states, outputs);
    let deviance = |fit: &Fit| inner.deviance(fit).unwrap_or(f64::INFINITY);
    if deviance(&moved) < deviance(&plain) {
        moved
    } else {
        plain
    }
}

/// Fits the leads of a plant; best first. Also the strongest test, and how many there were.
fn step(stage: &Stage) -> (Vec<Fitted>, (f64, usize)) {
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
    let states = plant.spec.states().len();
    let parameters = study.parameters();
    let outputs = study.outputs();
    let mut tried: Vec<(Screen, Fit)> = Vec::new();
    if let Some(s) = screen(study, fit, fit, given, recordings) {
        tried.push((s, fit.clone()));
    }
    let strongest = tried.first().map_or((0.0, 0), |(s, _)| {
        let best = s.leads.first().map_or(0.0, |l| l.statistic);
        (study.information() * best, s.tests)
    });
    // Beside an effect that was found, a second one is looked for only where a test says that something is left.
    let insignificant = chance(strongest.0) * strongest.1 as f64 > LEFT;
    let nothing_left = accepted > 0 && insignificant || accepted == MOST;
    if nothing_left {
        for (screen, _) in &mut tried {
            screen.leads.clear();
            screen.curves.clear();
        }
    }
    // Where the free run strays from the recording, what a term would do depends on where the recording was. That an observer
    // follows the noise too is of no matter for where fits start, but would be for the test above.
    if !nothing_left && options.least_squares {
        let along = study.along_recording(fit);
        if along.form != fit.form
            && let Some(s) = screen(study, fit, &along, given, recordings)
        {
            tried = vec![(s, fit.clone())];
        }
    }
    // A noise model that was fitted where physics is missing absorbs it: the same again under white noise.
    if !nothing_left
        && !options.least_squares
        && let Some(white) = study.least_squares(&fit.point)
        && study.follows(&white)
        && let Some(s) = screen(
            study,
            &white,
            &study.along_recording(&white),
            given,
            recordings,
        )
    {
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
    let mut glanced: Vec<(f64, Lead, usize, Candidate, Fit)> = tried
        .iter()
        .enumerate()
        .flat_map(|(i, (screen, from))| {
            promising(screen, &plant.spec)
                .into_iter()
                .map(move |lead| (i, screen, from, lead))
        })
        .collect::<Vec<_>>()
        .into_par_iter()
        .filter_map(|(i, screen, from, lead)| {
            let made = candidate(&plant.spec, &lead, &screen.arguments, recordings)?;
            let options = with_more(options, made.values.len());
            let rough = made
                .plant
                .clone()
                .with_accuracy(GLANCED_ACCURACY)
                .with_most_steps(GLANCED_STEPS);
            let inner = study.of(&rough, &options).ok()?;
            let start = started(&inner, &made, &lead, (study, from));
            // What a memory does within a sample, such as a contact, frozen slopes do not see.
            let fitted = match made.new_states {
                0 => inner.glance(&start, GLANCE)?,
                _ => inner.refit(&start, 0, GLANCE)?,
            };
            Some((from.deviance - fitted.deviance, lead, i, made, fitted))
        })
        .collect();
    glanced.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut chosen: Vec<(Lead, usize, Candidate, Fit)> = Vec::new();
    for (which, (screen, _)) in tried.iter().enumerate() {
        let list: Vec<_> = glanced.iter().filter(|g| g.2 == which).collect();
        let most = list.first().map_or(0.0, |g| g.0);
        let close = |g: &&_| {
            let (gain, lead, ..): &(f64, Lead, usize, Candidate, Fit) = g;
            let variables = lead
                .argument
                .map_or(&[][..], |a| &screen.arguments[a].variables);
            let specific = rank_of(&plant.spec, lead.term, lead.place, variables) < SPECIFIC;
            *gain > (1.0 - TIE.1) * most && specific
        };
        let best = list.iter().take(FITTED);
        let others = list.iter().skip(FITTED).copied().filter(close);
        chosen.extend(
            best.copied()
                .chain(others)
                .map(|g| (g.1.clone(), g.2, g.3.clone(), g.4.clone())),
        );
    }
    let fitted: Vec<Fitted> = chosen
        .into_par_iter()
        .filter_map(|(lead, which, made, from)| {
            let arguments = &tried[which].0.arguments;
            let options = with_more(options, made.values.len());
            let rough = made
                .plant
                .clone()
                .with_accuracy(GLANCED_ACCURACY)
                .with_most_steps(MOST_STEPS);
            let inner = study.of(&rough, &options).ok()?;
            // Where an observer had to follow what was missing, a free run may do now.
            let mut starts = vec![from.clone()];
            if from.form != fit.form {
                let mut point = from.point.clone();
                let gains = states * outputs;
                point.extend(&fit.point[fit.point.len() - gains..]);
                point.extend(std::iter::repeat_n(0.0, made.new_states * outputs));
                starts.push(Fit {
                    form: fit.form,
                    point,
                    ..from
                });
            }
            let best = starts
                .iter()
                .filter_map(|start| match made.new_states {
                    0 => inner.compare(start, COMPARED),
                    _ => inner.refit(start, 1, THOROUGH),
                })
                .filter(|fit| fit.form == Form::Innovation || inner.follows(fit))
                .min_by(|a, b| a.criterion.total_cmp(&b.criterion))?;
            let gain = fit.criterion - best.criterion - searched(&lead, recordings);
            let argument = lead.argument.map(|a| &arguments[a]);
            Some(Fitted {
                depends: argument.map_or_else(Vec::new, |a| plant.spec.names(&a.variables)),
                argument: argument.map_or_else(String::new, |a| a.expression.clone()),
                range: argument.map_or((0.0, 0.0), |a| (a.quantile(0.0), a.quantile(1.0))),
                travel: argument.map_or(0.0, |a| a.travel(recordings[0].sample_time)),
                shapes: best.point[parameters..][..lead.shapes.len()].to_vec(),
                lead,
                candidate: made,
                fit: best,
                gain,
                hypothesis: None,
                proved: false,
            })
        })
        .collect();
    let mut fitted = finished(fitted, study, fit, recordings, options);
    fitted.retain(|f| f.gain <= NEEDED || f.gain_without_few(study, fit, options) > NEEDED);
    // Values of the fit may make another name of a term.
    fitted.retain(|f| scope.allows(named(&plant.spec, f)));
    let mut origins = vec![fit];
    origins.extend(tried.iter().skip(1).map(|(_, white)| white));
    let ground = Ground {
        plant,
        study,
        fit,
        origins,
        recordings,
        options,
    };
    fitted.extend(trials(&scope.hypotheses, open, &ground));
    fitted.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    order(&plant.spec, &mut fitted);
    (fitted, strongest)
}

/// What blocks left out say of free runs, where values that depend on each other make a criterion weak: a candidate that takes
/// more than half of the mean square off them is proved, and of these, and of those whose criteria are equal, the one that
/// follows best is first. What depends on time alone is not proved so: its value in a block is a level that any slow error has.
fn judge_by_blocks(
    fitted: &mut [Fitted],
    (plant, fit): (&Plant, &Fit),
    recordings: &[PlantRecording],
    hold: Hold,
) {
    let errors_of =
        |plant: &Plant, fit: &Fit| held_out(plant, fit, Estimator::FreeRun, recordings, hold);
    let Some(without) = errors_of(plant, fit) else {
        return;
    };
    let best = fitted.first().map_or(0.0, |f| f.gain);
    let mut judged: Vec<(usize, HeldOut)> = (0..fitted.len().min(FINISHED))
        .into_par_iter()
        .filter_map(|i| Some((i, errors_of(&fitted[i].candidate.plant, &fitted[i].fit)?)))
        .collect();
    judged.retain(|(i, errors)| {
        let f = &fitted[*i];
        let proved = errors.removed(&without) >= EXPLAINED && f.lead.term.needs != Needs::Time;
        proved || f.gain > NEEDED.max(best - NEEDED)
    });
    judged.sort_by(|a, b| a.1.over(&b.1).total_cmp(&1.0));
    let Some((first, least)) = judged.first() else {
        return;
    };
    let id = |i: usize| named(&plant.spec, &fitted[i]);
    let rival = judged[1..]
        .iter()
        .any(|(i, errors)| errors.over(least) <= 1.0 + EQUAL && id(*i) != id(*first));
    if rival {
        return;
    }
    let first = *first;
    fitted[first].proved = least.removed(&without) >= EXPLAINED;
    fitted[..=first].rotate_right(1);
}

/// The second of two effects alone where the first is of no use beside it: both together gain less over it than a second
/// effect must.
fn without_first(
    plant: &Plant,
    stage: &Study,
    baseline: &Fit,
    [first, second]: [&Fitted; 2],
    recordings: &[PlantRecording],
    options: &EstimateOptions,
) -> Option<Fitted> {
    if first.hypothesis.is_some() || second.hypothesis.is_some() {
        return None;
    }
    let mut options = options.clone();
    options.free.truncate(plant.spec.parameters().len());
    let study = Study::new(plant, recordings, &options)
        .ok()?
        .with_information(stage.information());
    let alone = alone(plant, &study, baseline, first, second, recordings, &options)?;
    let both = first.gain + second.gain;
    let needed = SECOND.0.max(SECOND.1 * alone.gain);
    (both - alone.gain < needed).then_some(alone)
}

/// What the equations leave out. The fit of the plant alone may be known.
///
/// # Errors
/// As those of an estimation.
pub(crate) fn search(
    plant: &Plant,
    recordings: &[PlantRecording],
    hold: Hold,
    scope: &Scope,
    objective: Objective,
    known: Option<&Fit>,
) -> Result<Found, EstimateError> {
    let least_squares = objective == Objective::FreeRun;
    let mut options = EstimateOptions {
        free: vec![true; plant.spec.parameters().len()],
        hold,
        form: None,
        least_squares,
    };
    let study = Study::new(plant, recordings, &options)?;
    let mut baseline = match known {
        Some(fit) => fit.clone(),
        None => study.fit(least_squares.then_some(Form::FreeRun))?,
    };
    let mut steps: Vec<Vec<Fitted>> = Vec::new();
    let mut now = plant.clone();
    let mut fit = baseline.clone();
    let mut tests = Vec::new();
    let mut accepted_so_far = 0;
    let mut asked = vec![Trial::default(); scope.hypotheses.len()];
    // One effect more than may be named: the first may be dropped again.
    let mut may_drop = true;
    for _ in 0..=MOST + 1 {
        let count = accepted_so_far;
        let mut study = Study::new(&now, recordings, &options)?;
        if least_squares {
            let share = study.effective_share(&fit).unwrap_or(1.0);
            study = study.with_information(share);
            fit.criterion = study.criterion(&fit);
        }
        let open: Vec<usize> = (0..asked.len())
            .filter(|&i| asked[i].accepted.is_none())
            .collect();
        let needed = match steps.first().and_then(|s| s.first()) {
            None => NEEDED,
            // Where blocks left out, not the criterion, prove the first, no second is looked for.
            Some(first) if first.gain <= NEEDED => f64::INFINITY,
            Some(first) => SECOND.0.max(SECOND.1 * first.gain),
        };
        let mut attempts = 0;
        let (mut fitted, strongest) = loop {
            let stage = Stage {
                plant: &now,
                study: &study,
                fit: &fit,
                given: &plant.spec,
                needed,
                accepted: accepted_so_far,
                first: steps.first().and_then(|s| s.first()),
                recordings,
                options: &options,
                scope,
                open: &open,
            };
            let found = step(&stage);
            attempts += 1;
            let again = (attempts <= BETTER_FITS).then(|| improved(&stage, &found.0));
            let Some(better) = again.flatten() else {
                break found;
            };
            let lost = fit.criterion - better.criterion;
            let (mut fitted, strongest) = found;
            let most = fitted.iter().map(|f| f.gain).fold(0.0, f64::max);
            match steps.last_mut().and_then(|s| s.first_mut()) {
                None => baseline = better.clone(),
                Some(last) => {
                    last.gain += last.fit.criterion - better.criterion;
                    last.fit = better.clone();
                }
            }
            fit = better;
            // All gains are less by the same amount; where that is little of the best, candidates need not be fitted again.
            if lost < TIE.1 * most {
                fitted.iter_mut().for_each(|f| f.gain -= lost);
                break (fitted, strongest);
            }
        };
        if least_squares {
            judge_by_blocks(&mut fitted, (&now, &fit), recordings, hold);
        }
        for &i in &open {
            let trial = fitted.iter().find(|f| f.hypothesis == Some(i));
            match count {
                0 => asked[i].alone = trial.cloned(),
                _ => asked[i].beside = trial.map(|f| f.gain),
            }
        }
        tests.push(strongest);
        let first = steps.first().and_then(|s| s.first());
        let new = |f: &&Fitted| {
            first.is_none_or(|first| {
                let id = named(&now.spec, f);
                let first = (first, named(&plant.spec, first));
                f.hypothesis.is_some()
                    || differs(id, f.lead.term.port, &f.depends, first)
                        && determined(&study, f, &options)
            })
        };
        let best = fitted.first().filter(new);
        let accepted = best
            .filter(|f| (f.gain > needed || f.proved) && count < MOST)
            .cloned();
        let Some(best) = accepted else {
            if steps.is_empty() {
                steps.push(fitted);
            }
            break;
        };
        if may_drop
            && let Some(first) = first
            && let Some(alone) = without_first(
                plant,
                &study,
                &baseline,
                [first, &best],
                recordings,
                &options,
            )
        {
            may_drop = false;
            options.free.truncate(plant.spec.parameters().len());
            options = with_more(&options, alone.candidate.values.len());
            (now, fit) = (alone.candidate.plant.clone(), alone.fit.clone());
            tests.truncate(1);
            steps[0].insert(0, alone);
            continue;
        }
        options = with_more(&options, best.candidate.values.len());
        now = best.candidate.plant.clone();
        fit = best.fit.clone();
        if let Some(i) = best.hypothesis {
            asked[i].accepted = Some(count);
        }
        steps.push(fitted);
        accepted_so_far += 1;
    }
    Ok(Found {
        given: plant.clone(),
        baseline,
        steps,
        tests,
        plant: now,
        fit,
        accepted: accepted_so_far,
        trials: asked,
        options,
        information: 1.0,
        held_out: None,
    })
}
