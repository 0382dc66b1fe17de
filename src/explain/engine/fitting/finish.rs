//! The last fits of the best candidates.

use rayon::prelude::*;

use crate::explain::engine::fitting::fitted::{Fitted, forms, searched, with_more};
use crate::explain::engine::screening::along::range_along;
use crate::explain::engine::terms::names::{SPECIFIC, rank};
use crate::explain::engine::thresholds::{
    FINISHED, MOST_STEPS, ROUNDS, THOROUGH, limited, times_more,
};
use crate::physics::estimate::{EstimateOptions, Fit, PlantRecording, Study};

/// Names that gain this part of the best are finished too.
const HALF: f64 = 0.5;

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
        again(&mut fitted, &|i, f| {
            let begins = i > 0 && is_named(f) && (short || close(i, f, most));
            begins.then(|| {
                let mut start = f.candidate.from(&others, first);
                let values = f.values();
                start.point[first..][..values.len()].copy_from_slice(values);
                start
            })
        });
        if fitted.first().is_none_or(|f| f.gain <= most) {
            break;
        }
    }
    fitted
}
