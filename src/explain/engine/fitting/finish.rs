//! The last fits of the best candidates.

use rayon::prelude::*;

use crate::explain::engine::fitting::fitted::{Fitted, forms, searched, with_more};
use crate::explain::engine::screening::along::{factor_along, range_along};
use crate::explain::engine::terms::names::{SPECIFIC, rank};
use crate::explain::engine::terms::values::expression;
use crate::explain::engine::thresholds::{
    FINISHED, MOST_STEPS, ROUNDS, THOROUGH, limited, times_more,
};
use crate::physics::estimate::{EstimateOptions, Fit, PlantRecording, Study};

/// Names that gain this part of the best are finished too.
const HALF: f64 = 0.5;

/// Terms that explain this part of another's mean square are alike.
const ALIKE: f64 = 0.9;

/// How often fits begin again where the best has ended.
const EXCHANGES: usize = 2;

/// Smallest and largest value.
type Range = (f64, f64);

/// The best of all fits, fitted until nothing changes; the others as they are. Best first.
pub(in crate::explain::engine) fn finished(
    mut fitted: Vec<Fitted>,
    study: &Study,
    before: &Fit,
    recordings: &[PlantRecording],
    options: &EstimateOptions,
) -> Vec<Fitted> {
    fitted.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let best = fitted.first().map_or(0.0, |f| f.gain);
    let spec = &study.plant().spec;
    let first = study.parameters();
    let refined = |f: &Fitted, start: Fit| -> Option<(Fit, Option<Range>)> {
        let options = with_more(options, f.candidate.values.len());
        let limited = limited(f.candidate.plant.clone(), study, MOST_STEPS);
        let inner = study.of(&limited, &options).ok()?;
        let refined = (forms(start, before, study.gains()).iter())
            .filter_map(|start| inner.refit(start, ROUNDS, THOROUGH))
            .min_by(|a, b| a.criterion.total_cmp(&b.criterion))?;
        // Of a plant that the term has changed much, its variable has other values than before.
        let range = range_along((&inner, &refined), recordings, &f.argument);
        Some((refined, range))
    };
    // Fits again all that have a start, and orders them.
    let again = |fitted: &mut [Fitted], start: &(dyn Fn(usize, &Fitted) -> Option<Fit> + Sync)| {
        fitted.par_iter_mut().enumerate().for_each(|(i, f)| {
            let Some((fit, range)) = start(i, f).and_then(|start| refined(f, start)) else {
                return;
            };
            f.range = range.unwrap_or(f.range);
            if fit.criterion < f.fit.criterion {
                f.gain = before.criterion - fit.criterion - searched(&f.lead, recordings);
                f.shapes = fit.point[first..][..f.lead.shapes.len()].to_vec();
                f.fit = fit;
            }
        });
        fitted.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    };
    // A name must not lose to a curve for the steps that its fit lacks.
    let is_named = |f: &Fitted| rank(spec, f) < SPECIFIC;
    let close = |i: usize, f: &Fitted, best: f64| i < 2 * FINISHED && f.gain > HALF * best;
    again(&mut fitted, &|i, f| {
        (i < FINISHED || is_named(f) && close(i, f, best)).then(|| f.fit.clone())
    });
    // A likelihood has several maxima, and chance would decide which name has found the best: each begins again where the best one
    // ended, until that stays the best.
    let short = times_more(study.count().max(study.samples())) > 1;
    for _ in 0..EXCHANGES {
        let Some(best) = fitted.first().filter(|f| f.gain > 0.0) else {
            break;
        };
        let (most, others) = (best.gain, best.without_term(first));
        // What is like a better one begins where that ended, with its size: of much less its own fit may have ended elsewhere.
        let like = |i: usize| {
            let better = fitted[..i].iter().take(FINISHED);
            better.into_iter().find_map(|b| {
                let strength = strength_of_like(b, &fitted[i], (study, options, recordings))?;
                Some((b.without_term(first), strength))
            })
        };
        let likes: Vec<Option<(Fit, f64)>> = (0..fitted.len()).into_par_iter().map(like).collect();
        again(&mut fitted, &|i, f| {
            let like = likes.get(i).and_then(Option::as_ref);
            let enough = short || close(i, f, most) || like.is_some();
            let begins = i > 0 && is_named(f) && enough;
            begins.then(|| {
                let from = like.map_or(&others, |(from, _)| from);
                let mut start = f.candidate.from(from, first);
                let values = f.values();
                start.point[first..][..values.len()].copy_from_slice(values);
                if let Some((_, strength)) = like {
                    start.point[first + f.shapes.len()] = *strength;
                }
                start
            })
        });
        if fitted.first().is_none_or(|f| f.gain <= most) {
            break;
        }
    }
    fitted
}

/// The strength with which a term at the same place does along the best fit what the best term does; none where it is not like it.
fn strength_of_like(
    best: &Fitted,
    other: &Fitted,
    (study, options, recordings): (&Study, &EstimateOptions, &[PlantRecording]),
) -> Option<f64> {
    let is_function = |f: &Fitted| {
        let (term, own) = (f.lead.term, ["{a}", "{v}"]);
        let of_itself = own.iter().any(|mark| term.form.contains(mark));
        term.free_strength && term.memories.is_empty() && !of_itself && !f.argument.is_empty()
    };
    let functions = is_function(best) && is_function(other) && best.lead.curve.is_none();
    if !functions || best.lead.place != other.lead.place || other.lead.curve.is_some() {
        return None;
    }
    let text = |f: &Fitted| {
        let of = (&f.argument[..], f.usual);
        expression(f.lead.term, of, &f.shapes, study.sample_time())
    };
    let options = with_more(options, best.candidate.values.len());
    let inner = study.of(&best.candidate.plant, &options).ok()?;
    let texts = [text(best), text(other)];
    let (factor, part) = factor_along((&inner, &best.fit), recordings, &texts)?;
    (part > ALIKE).then_some(factor * best.strength())
}
