//! Two effects in place of what forward selection has found: one term may do some of the work of two, each of which does less alone.

use super::fitting::edit::Place;
use super::fitting::fitted::{Fitted, TIE, tie_with_curve};
use super::holdout::{CLOSE, held_out};
use super::search::{Found, HALF_WAY, Question, forward};
use super::step::Step;
use super::terms::documentation::plant_effects;
use super::terms::names::{family, named, special_case};
use super::thresholds::{IMITATED, LEFT, NEEDED, SECOND, chance, is_spent};
use crate::physics::estimate::{EstimateError, Fit, Study};

/// Other first effects beside which a second is looked for, where what was found leaves structure.
const OTHER_FIRSTS: usize = 4;
/// ... and in place of a law.
const FIRSTS_OF_A_LAW: usize = 2;

/// What the equations leave out. The fit of the plant alone may be known.
///
/// # Errors
/// As those of an estimation.
pub(crate) fn search(question: Question, known: Option<&Fit>) -> Result<Found, EstimateError> {
    let found = forward(question, known, None)?;
    let found = special_case_first(question, &found).unwrap_or(found);
    let estimator = question.objective.estimator();
    let errors = |of: &Found| {
        let (recordings, hold) = (question.recordings, question.hold);
        held_out(&of.plant, &of.fit, estimator, recordings, hold)
    };
    let best = pairs(question, &found)
        .into_iter()
        .filter(|pair| pair.gain() > found.gain() + tie(&found, pair))
        .max_by(|a, b| a.gain().total_cmp(&b.gain()));
    let follows = |pair: &Found| {
        let both = errors(pair).zip(errors(&found));
        both.is_some_and(|(pair, single)| pair.over(&single) < 1.0)
    };
    match best.filter(follows) {
        Some(pair) => Ok(Found {
            is_pair: true,
            ..pair
        }),
        None => Ok(found),
    }
}

/// By how much a pair must gain more. A law gives way to two names that are only likelier.
fn tie(found: &Found, pair: &Found) -> f64 {
    match found.names().contains(&"law") && !pair.names().contains(&"law") {
        true => TIE.0,
        false => TIE.0.max(TIE.1 * found.gain()),
    }
}

/// Two effects that begin with the special case of the first, where both gain as much: beside the second, the number that the special case
/// lacks may say nothing.
fn special_case_first(question: Question, found: &Found) -> Option<Found> {
    let spec = &question.plant.spec;
    let (first, others) = found.steps.first()?.split_first()?;
    let wanted = special_case(named(spec, first)).filter(|_| found.accepted > 1)?;
    let is_wanted = |f: &Fitted| named(spec, f) == wanted && f.lead.place == first.lead.place;
    let at = others.iter().position(is_wanted)?;
    let least = found.gain() - tie_with_curve(found.gain());
    with_first(question, found, at + 1).filter(|simple| simple.gain() >= least)
}

/// Two effects of which the first is another of those that were fitted.
fn with_first(question: Question, found: &Found, first: usize) -> Option<Found> {
    let mut fitted = found.steps[0].clone();
    fitted[..=first].rotate_right(1);
    let begun = Step {
        fitted,
        strongest: found.tests[0],
        map: found.map.clone(),
    };
    let pair = forward(question, Some(&found.baseline), Some(begun)).ok()?;
    (pair.accepted > 1).then_some(pair)
}

/// Pairs that begin with other first effects, where what was found leaves structure or is a curve of an input.
fn pairs(question: Question, found: &Found) -> Vec<Found> {
    let spec = &question.plant.spec;
    let all = found.steps.first().filter(|_| found.accepted > 0);
    let Some([first, others @ ..]) = all.map(Vec::as_slice) else {
        return vec![];
    };
    // Little beside a large effect is what its formula leaves, as in `decide`.
    let (strongest, tests) = found.left();
    let nothing_left = chance(strongest) * tests as f64 > LEFT;
    let absorbed = absorbs(question, found);
    let little_left = nothing_left || strongest < SECOND.1 * first.gain && !absorbed;
    // A curve of an input may be that of two effects: its middle and its ends. So may any that is not all.
    let of_input = |f: &Fitted| matches!(f.lead.place, Place::Input(_));
    let is_law = named(spec, first) == "law";
    let is_input_curve = of_input(first) && is_law;
    // Nor is a curve all that needs a second effect beside it.
    let is_not_all = is_law && (!nothing_left || absorbed || found.accepted > 1);
    if little_left && !is_input_curve && !is_not_all || first.hypothesis.is_some() {
        return vec![];
    }
    let least = match is_input_curve || is_not_all {
        true => HALF_WAY * NEEDED,
        false => NEEDED.max(IMITATED * first.gain),
    };
    let id = |f: &Fitted| named(spec, f);
    // In place of a law two effects with names are looked for.
    let mut scope = question.scope.clone();
    if is_law && scope.only.is_empty() {
        scope.only = plant_effects().map(|e| e.id.to_owned()).collect();
    }
    let most = match is_law {
        true => FIRSTS_OF_A_LAW,
        false => OTHER_FIRSTS,
    };
    let question = Question {
        scope: &scope,
        ..question
    };
    let proven = |f: &Fitted| f.gain > least && f.hypothesis.is_none();
    let proven_ids = found.steps[0].iter().filter(|f| proven(f)).map(id);
    let special_cases: Vec<&str> = proven_ids.filter_map(special_case).collect();
    let mut tried: Vec<&str> = Vec::new();
    let mut pairs: Vec<Found> = Vec::new();
    for (i, other) in others.iter().enumerate() {
        let its_family = |f: &Fitted| family(id(f)) == family(id(other));
        if id(other) == id(first)
            || tried.contains(&other.lead.term.id)
            || little_left && !is_not_all && !of_input(other)
        {
            continue;
        }
        // A special case may show what it gains only beside the second.
        let as_special_case = special_cases.contains(&id(other)) && other.hypothesis.is_none();
        // Of effects of one family the likeliest has found what is beside them.
        let again = pairs
            .iter()
            .any(|p| p.steps[0].first().is_some_and(its_family));
        let as_other = proven(other) && id(other) != "law" && tried.len() < most && !again;
        if !(as_special_case || as_other) || is_spent(question.plant) {
            continue;
        }
        tried.push(other.lead.term.id);
        pairs.extend(with_first(question, found, i + 1));
    }
    pairs
}

/// Whether the noise model of what was found may stand for physics: it takes up most of what is left, and that is not little.
fn absorbs(question: Question, found: &Found) -> bool {
    let study = Study::new(&found.plant, question.recordings, &found.options);
    study.is_ok_and(|study| {
        let left = study.left(&found.fit).unwrap_or_default();
        left.iter().any(|left| *left > CLOSE) && study.absorbs(&found.fit)
    })
}
