//! One step of a search: score tests, fits of what they find, and the order of these.

mod candidates;
mod neighbourhood;
mod origins;
mod promising;

use self::candidates::Candidates;
use self::neighbourhood::{add_formulas, add_neighbours};
use self::origins::Origins;
use super::fitting::edit::Place;
use super::fitting::finish::finished;
use super::fitting::fitted::{Fitted, order};
use super::fitting::formulas::FORMULA;
use super::hypothesis::{Ground, Trial, trials};
use super::scope::Scope;
use super::terms::names::named;
use super::thresholds::{BETTER, FINISHED, NEEDED, THOROUGH};
use crate::explain::explanation::EquationMap;
use crate::physics::estimate::{EstimateOptions, Fit, PlantRecording, Study};
use crate::physics::{ModelSpec, Plant};

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
    /// What was found out about each hypothesis before.
    pub(super) trials: &'a [Trial],
}

/// What a step has found.
pub(super) struct Step {
    /// Candidates, best first.
    pub(super) fitted: Vec<Fitted>,
    /// The strongest test, and how many there were.
    pub(super) strongest: (f64, usize),
    pub(super) map: Option<EquationMap>,
}

impl Step {
    /// Candidates that were found from a worse fit of the plant are still there: tests at the better one may not lead to them. Beside an
    /// effect, what tests at the better fit do not show would make up for what is missing elsewhere.
    pub(super) fn keep(&mut self, before: Vec<Fitted>, stage: &Stage) {
        if before.is_empty() || stage.accepted > 0 {
            return;
        }
        self.fitted.extend(before);
        self.fitted = drop_repeated(std::mem::take(&mut self.fitted));
        order(&stage.plant.spec, &mut self.fitted, stage.needed);
    }
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

/// Of fits of one term, from several starts or in several forms, the best; best first. Each formula is a term of its own.
fn drop_repeated(mut fitted: Vec<Fitted>) -> Vec<Fitted> {
    fitted.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let mut known: Vec<(&str, Place, String, Option<usize>)> = Vec::new();
    fitted.retain(|f| {
        let term = match f.lead.term {
            term if term.id == FORMULA => term.form,
            term => term.id,
        };
        let this = (term, f.lead.place, f.argument.clone(), f.hypothesis);
        let new = !known.contains(&this);
        known.push(this);
        new
    });
    fitted
}

/// Fits the leads of a plant.
pub(super) fn step(stage: &Stage) -> Step {
    let Stage {
        plant,
        study,
        fit,
        recordings,
        options,
        scope,
        ..
    } = *stage;
    let origins = Origins::new(stage);
    let candidates = Candidates {
        stage,
        origins: &origins,
    };
    let fitted = drop_repeated(candidates.fitted());
    let mut fitted = finished(fitted, study, fit, recordings, options);
    fitted.retain(|f| f.gain <= NEEDED || f.gain_without_few(study, fit, options) > NEEDED);
    fitted.retain(|f| f.is_resolved(study));
    // Values of the fit may make another name of a term.
    fitted.retain(|f| scope.allows(named(&plant.spec, f)));
    let mut starts = vec![fit];
    starts.extend(origins.all.iter().skip(1).map(|o| &o.fit));
    starts.extend(&origins.from_text);
    let ground = Ground {
        plant,
        study,
        fit,
        origins: starts,
        recordings,
        options,
    };
    fitted.extend(trials(&scope.hypotheses, stage.trials, &ground));
    if let Some(first) = origins.all.first() {
        let arguments = &first.screen.arguments;
        add_formulas(&mut fitted, arguments, (stage, &ground));
        fitted = add_neighbours(fitted, arguments, (stage, &ground));
    }
    fitted.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    order(&plant.spec, &mut fitted, stage.needed);
    Step {
        fitted,
        strongest: origins.strongest,
        map: origins.map,
    }
}
