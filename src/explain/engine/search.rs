//! From score tests to fits: candidates are fitted one by one, ranked by one criterion, and added one after the other.

use rayon::prelude::*;

use super::fitting::eliminate::alone;
use super::fitting::fitted::{Fitted, TIE, with_more};
use super::fitting::second_effect::{determined, differs, repeats_elsewhere};
use super::holdout::{EXPLAINED, Estimator, HeldOut, held_out};
use super::hypothesis::Trial;
use super::long_recordings::Searched;
use super::scope::Scope;
use super::screening::along::range_along;
use super::step::{Stage, Step, improved, step};
use super::terms::names::named;
use super::terms::term::Needs;
use super::thresholds::{BETTER_FITS, FINISHED, LEFT, MOST, NEEDED, SECOND, SURE, chance};
use crate::explain::explanation::EquationMap;
use crate::physics::estimate::{EstimateError, EstimateOptions, Fit, Form, PlantRecording, Study};
use crate::physics::{Hold, ModelSpec, Plant, VariableId, VariableKind};

/// What the search has found.
#[derive(Clone)]
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
    /// Whether the first is no answer without the second: another effect alone is likelier.
    pub(crate) is_pair: bool,
    /// What the recordings say about each hypothesis.
    pub(crate) trials: Vec<Trial>,
    pub(crate) options: EstimateOptions,
    /// Information in a value of what the fit leaves, as a part of that in a value with independent noise.
    pub(crate) information: f64,
    /// Where in the equations tests find something before an effect is added.
    pub(crate) map: Option<EquationMap>,
    /// Free runs in blocks that the fit had not seen, without and with the effects; none where the plant does not run freely.
    pub(crate) held_out: Option<[HeldOut; 2]>,
    /// Inputs that react to disturbances: free runs prove no function of them.
    pub(crate) reacting: Vec<usize>,
    /// Whether free runs mislead a search, by that or because they add up disturbances.
    pub(crate) misled: bool,
    /// Without an effect, one that few independent values hide.
    pub(crate) likelier: Option<Fitted>,
    /// Values that were searched, and what part of long recordings they are.
    pub(crate) values: usize,
    pub(crate) part: Option<Searched>,
}

/// What fits are compared by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Objective {
    /// The likelihood of the recordings, with a noise model or an observer.
    Likelihood,
    /// The mean square of the error of the free run, with as many values as are independent.
    FreeRun,
}

/// What the equations of a plant leave out of recordings.
#[derive(Clone, Copy)]
pub(crate) struct Question<'a> {
    pub(crate) plant: &'a Plant,
    pub(crate) recordings: &'a [PlantRecording],
    pub(crate) hold: Hold,
    pub(crate) scope: &'a Scope,
    pub(crate) objective: Objective,
}

impl Objective {
    /// How blocks left out are judged.
    pub(super) fn estimator(self) -> Estimator {
        match self {
            Self::FreeRun => Estimator::FreeRun,
            Self::Likelihood => Estimator::Likelihood,
        }
    }
}

impl Found {
    /// The strongest test at the end, and how many there were.
    pub(crate) fn left(&self) -> (f64, usize) {
        // Where no test could be made, none finds anything.
        self.tests
            .get(self.accepted)
            .copied()
            .filter(|t| t.1 > 0)
            .unwrap_or((0.0, 1))
    }

    /// What its effects gain together.
    pub(crate) fn gain(&self) -> f64 {
        let accepted = self.steps.iter().take(self.accepted);
        accepted
            .filter_map(|step| step.first())
            .map(|f| f.gain)
            .sum()
    }

    /// Names of the effects that were accepted.
    pub(super) fn names(&self) -> Vec<&'static str> {
        let accepted = self.steps.iter().take(self.accepted).enumerate();
        let name = |(i, step): (usize, &Vec<Fitted>)| {
            let spec = &self.stage(i).0.spec;
            step.first().map(|f| named(spec, f))
        };
        accepted.filter_map(name).collect()
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

    /// Gives the effects the shapes of the final fit, and the ranges of their variables along it: names depend on them.
    pub(crate) fn take_shapes(&mut self, recordings: &[PlantRecording]) {
        let study = Study::new(&self.plant, recordings, &self.options).ok();
        let mut first = self.given.spec.parameters().len();
        let accepted = self.steps.iter_mut().take(self.accepted);
        for effect in accepted.filter_map(|step| step.first_mut()) {
            let count = effect.shapes.len();
            if let Some(shapes) = self.fit.point.get(first..first + count) {
                effect.shapes.copy_from_slice(shapes);
            }
            if let Some(study) = &study {
                let range = range_along((study, &self.fit), recordings, &effect.argument);
                effect.range = range.unwrap_or(effect.range);
            }
            first += effect.candidate.values.len();
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

/// Part of the gain that an effect needs from which on it is on trial: it stands if a second beside it gains what both need together.
/// One of two alone may say little, where the other one hides it.
pub(super) const HALF_WAY: f64 = 0.5;

/// What blocks left out say of free runs, where values that depend on each other make a criterion weak. A candidate is accepted if it
/// takes more than half of the mean square off them, and the criterion speaks for it more than chance does, or it is likelier with noise
/// models of both residuals. It is named where it takes as much off what any other function leaves, by the first of these.
/// One that halves what the best leaves comes before it. What depends on time alone is not accepted so: its value in a block is a
/// level that any slow error has.
fn judge_by_blocks(
    fitted: &mut [Fitted],
    tests: usize,
    (plant, fit): (&Plant, &Fit),
    recordings: &[PlantRecording],
    options: &EstimateOptions,
) {
    let errors_of = |plant: &Plant, fit: &Fit| {
        held_out(plant, fit, Estimator::FreeRun, recordings, options.hold)
    };
    let in_colour = |plant: &Plant, fit: &Fit, more: usize| {
        let options = with_more(options, more);
        let study = Study::new(plant, recordings, &options).ok()?;
        study.criterion_in_colour(fit)
    };
    let in_time = |f: &Fitted| f.lead.term.needs == Needs::Time;
    // Of so many tests the largest gains about that much by chance (the maximum of as many chi-squares with one degree of freedom).
    let by_chance = 2.0 * (tests.max(1) as f64).ln();
    let alone = in_colour(plant, fit, 0);
    let count = fitted.len().min(FINISHED);
    let likely: Vec<bool> = fitted[..count]
        .par_iter()
        .map(|f| {
            let own = in_colour(&f.candidate.plant, &f.fit, f.candidate.values.len());
            let gain = alone.zip(own).map(|(alone, own)| alone - own);
            gain.is_some_and(|gain| gain > NEEDED) && !in_time(f)
        })
        .collect();
    for (f, likely) in fitted.iter_mut().zip(&likely) {
        f.likelier = *likely && f.gain > by_chance;
    }
    let Some(without) = errors_of(plant, fit) else {
        return;
    };
    let judged: Vec<(usize, HeldOut)> = (0..count)
        .into_par_iter()
        .filter_map(|i| Some((i, errors_of(&fitted[i].candidate.plant, &fitted[i].fit)?)))
        .collect();
    // At one place, of one variable, two names are two forms of one function.
    let elsewhere = |i: usize, j: usize| {
        let of = |f: &Fitted| (f.lead.place, f.argument.clone());
        of(&fitted[i]) != of(&fitted[j])
    };
    let explains = |errors: &HeldOut| errors.follows() && errors.removed(&without) >= EXPLAINED;
    let provable = |i: usize| fitted[i].gain > by_chance && !in_time(&fitted[i]);
    // What is likelier by its own noise alone may predict, but is not named.
    let predicts = |i: usize| provable(i) || likely[i];
    let mut chosen: Option<&(usize, HeldOut)> = None;
    for candidate @ (i, errors) in &judged {
        let better = match chosen {
            None => fitted[*i].gain > NEEDED || predicts(*i) && explains(errors),
            Some((_, best)) => provable(*i) && errors.removed(best) >= EXPLAINED,
        };
        if better {
            chosen = Some(candidate);
        }
    }
    let Some((first, errors)) = chosen else {
        return;
    };
    let as_good = |(i, other): &(usize, HeldOut)| {
        provable(*i) && elsewhere(*i, *first) && errors.removed(other) < EXPLAINED
    };
    let explains = predicts(*first) && explains(errors);
    let proved = explains && provable(*first) && !judged.iter().any(as_good);
    let first = *first;
    (fitted[first].explains, fitted[first].proved) = (explains, proved);
    fitted[..=first].rotate_right(1);
}

/// A term with a name in the place of a curve, of the same variables, that leaves structure or stands beside another effect: neither is
/// the whole truth then, and of many values the criterion is for more numbers. The curve stays only where it is better in blocks left out
/// by more than chance, or takes most of what the term leaves off them; a function of an input may do that because the input reacts
/// (`super::misled`). The term must gain `least`.
fn named_for_curve(
    spec: &ModelSpec,
    step: &[Fitted],
    least: f64,
    estimator: Estimator,
    recordings: &[PlantRecording],
    hold: Hold,
) -> Option<Fitted> {
    let curve = step.first().filter(|f| f.lead.curve.is_some())?;
    let term = step.iter().find(|f| {
        let alike = f.lead.place == curve.lead.place && f.depends == curve.depends;
        alike && f.gain > least && f.lead.curve.is_none() && named(spec, f) != "law"
    })?;
    let errors = |f: &Fitted| held_out(&f.candidate.plant, &f.fit, estimator, recordings, hold);
    let (of_curve, of_term) = (errors(curve)?, errors(term)?);
    let is_input = |v: &VariableId| spec.variable(*v).kind == VariableKind::Input;
    let of_input = curve
        .depends
        .iter()
        .filter_map(|name| spec.find(name))
        .any(|v| is_input(&v));
    let takes_most = !of_input && of_curve.removed(&of_term) >= EXPLAINED;
    let better = of_curve.surely_smaller(&of_term) || takes_most;
    (!better).then(|| term.clone())
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

/// Forward selection, from the fit of the plant alone and the first step where these are known.
///
/// # Errors
/// As those of an estimation.
pub(super) fn forward(
    question: Question,
    known: Option<&Fit>,
    mut begun: Option<Step>,
) -> Result<Found, EstimateError> {
    let Question {
        plant,
        recordings,
        hold,
        scope,
        objective,
    } = question;
    let least_squares = objective == Objective::FreeRun;
    let mut options = EstimateOptions {
        free: vec![true; plant.spec.parameters().len()],
        hold,
        form: None,
        least_squares,
    };
    let study = Study::new(plant, recordings, &options)?;
    let values = study.count();
    let mut baseline = match known {
        Some(fit) => fit.clone(),
        None => study.fit(least_squares.then_some(Form::FreeRun))?,
    };
    let mut steps: Vec<Vec<Fitted>> = Vec::new();
    let mut now = plant.clone();
    let mut fit = baseline.clone();
    let mut tests = Vec::new();
    let mut first_map = None;
    let mut accepted_so_far = 0;
    let mut asked = vec![Trial::default(); scope.hypotheses.len()];
    // Two steps more than effects may be named: the first may be dropped again, or a term stand for a curve.
    let mut may_drop = begun.is_none();
    // Whether the first effect stands only if a second comes to it.
    let mut on_trial = false;
    for _ in 0..=MOST + 2 {
        let count = accepted_so_far;
        now = now.counting_with(plant);
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
            Some(first) if first.gain <= NEEDED && !on_trial => f64::INFINITY,
            Some(first) if on_trial => NEEDED + SECOND.0 - first.gain,
            Some(first) => SECOND.0.max(SECOND.1 * first.gain),
        };
        let mut attempts = 0;
        let is_new = begun.is_none();
        let first_step = begun.take();
        let mut before: Vec<Fitted> = Vec::new();
        let Step {
            mut fitted,
            strongest,
            map,
        } = loop {
            if let Some(step) = first_step {
                break step;
            }
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
                trials: &asked,
            };
            let mut found = step(&stage);
            found.keep(std::mem::take(&mut before), &stage);
            attempts += 1;
            let again = (attempts <= BETTER_FITS).then(|| improved(&stage, &found.fitted));
            let Some(better) = again.flatten() else {
                break found;
            };
            let lost = fit.criterion - better.criterion;
            let most = found.fitted.iter().map(|f| f.gain).fold(0.0, f64::max);
            match steps.last_mut().and_then(|s| s.first_mut()) {
                None => baseline = better.clone(),
                Some(last) => {
                    last.gain += last.fit.criterion - better.criterion;
                    last.fit = better.clone();
                }
            }
            fit = better;
            // All gains are less by the same amount; where that is little of the best, candidates need not be fitted again.
            found.fitted.iter_mut().for_each(|f| f.gain -= lost);
            if lost < TIE.1 * most {
                break found;
            }
            before = found.fitted;
        };
        if accepted_so_far == 1 && chance(strongest.0) * (strongest.1 as f64) < LEFT {
            let estimator = objective.estimator();
            let term = named_for_curve(&plant.spec, &steps[0], SURE, estimator, recordings, hold);
            if let Some(term) = term {
                options.free.truncate(plant.spec.parameters().len());
                options = with_more(&options, term.candidate.values.len());
                (now, fit) = (term.candidate.plant.clone(), term.fit.clone());
                steps[0].insert(0, term);
                continue;
            }
        }
        if least_squares && is_new {
            judge_by_blocks(&mut fitted, strongest.1, (&now, &fit), recordings, &options);
        }
        for &i in &open {
            let trial = fitted.iter().find(|f| f.hypothesis == Some(i));
            match count {
                0 => asked[i].alone = trial.cloned(),
                _ => asked[i].beside = trial.map(|f| f.gain),
            }
        }
        tests.push(strongest);
        first_map = first_map.or(map);
        if accepted_so_far == 1 {
            let estimator = objective.estimator();
            let least = needed.max(SURE);
            let term = named_for_curve(&now.spec, &fitted, least, estimator, recordings, hold);
            fitted.splice(..0, term);
        }
        let first = steps.first().and_then(|s| s.first());
        let explains_beside = |f: &Fitted| {
            let runs = |plant: &Plant, fit: &Fit| {
                held_out(plant, fit, Estimator::FreeRun, recordings, hold)
            };
            runs(&f.candidate.plant, &f.fit).is_some_and(|with| {
                let removed = |without| with.removed(&without) >= EXPLAINED;
                with.follows_closely() && runs(&now, &fit).is_some_and(removed)
            })
        };
        let new = |f: &&Fitted| {
            first.is_none_or(|first| {
                let id = named(&now.spec, f);
                let first = (first, named(&plant.spec, first));
                let is_another = || {
                    differs(id, f.lead.term.port, &f.depends, first)
                        || f.gain > needed
                            && repeats_elsewhere(id, f.lead.place, &f.depends, first)
                            && explains_beside(f)
                };
                f.hypothesis.is_some() || is_another() && determined(&study, f, &options)
            })
        };
        // What may not be named beside the first, but gains more, may stand in its place.
        let instead = |f: &&Fitted| may_drop && first.is_some_and(|first| f.gain > first.gain);
        let beside = fitted.first().is_some_and(|f| new(&f));
        let best = fitted.first().filter(|f| beside || instead(f));
        // Of a second effect that is small beside a large first one, blocks left out say whether it is what the formula of the first
        // leaves.
        let shows = |f: &Fitted| count > 0 && f.gain > SECOND.0 && beside && explains_beside(f);
        let accepted = best
            .filter(|f| (f.gain > needed || f.explains || shows(f)) && count < MOST)
            .cloned();
        let half_way = |f: &&Fitted| {
            count == 0 && f.hypothesis.is_none() && (f.gain > HALF_WAY * NEEDED || !is_new)
        };
        let accepted = accepted.or_else(|| {
            let tried = best.filter(half_way);
            on_trial |= tried.is_some();
            tried.cloned()
        });
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
            on_trial &= alone.gain <= NEEDED;
            options.free.truncate(plant.spec.parameters().len());
            options = with_more(&options, alone.candidate.values.len());
            (now, fit) = (alone.candidate.plant.clone(), alone.fit.clone());
            tests.truncate(1);
            steps[0].insert(0, alone);
            continue;
        }
        if !beside {
            break;
        }
        on_trial &= count == 0;
        options = with_more(&options, best.candidate.values.len());
        now = best.candidate.plant.clone();
        fit = best.fit.clone();
        if let Some(i) = best.hypothesis {
            asked[i].accepted = Some(count);
        }
        steps.push(fitted);
        accepted_so_far += 1;
    }
    if on_trial {
        options.free.truncate(plant.spec.parameters().len());
        (now, fit) = (plant.clone(), baseline.clone());
        tests.truncate(1);
        accepted_so_far = 0;
    }
    Ok(Found {
        given: plant.clone(),
        baseline,
        steps,
        tests,
        plant: now,
        fit,
        accepted: accepted_so_far,
        is_pair: false,
        trials: asked,
        options,
        information: 1.0,
        held_out: None,
        reacting: vec![],
        misled: false,
        likelier: None,
        values,
        part: None,
        map: first_map,
    })
}
