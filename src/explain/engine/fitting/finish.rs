//! The last fits of the best candidates.

use rayon::prelude::*;

use crate::explain::engine::fitting::fitted::{Fitted, searched, with_more};
use crate::explain::engine::screening::along::range_along;
use crate::explain::engine::terms::names::{SPECIFIC, rank};
use crate::explain::engine::thresholds::{
    FINISHED, MOST_STEPS, ROUNDS, THOROUGH, limited, times_more,
};
use crate::physics::estimate::{EstimateOptions, Fit, Form, PlantRecording, Study};

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
    let short = times_more(study.count().max(study.samples())) > 1;
    let refined_from = |f: &Fitted, start: &Fit| -> Option<(Fit, Option<Range>)> {
        let options = with_more(options, f.candidate.values.len());
        let limited = limited(f.candidate.plant.clone(), study, MOST_STEPS);
        let inner = study.of(&limited, &options).ok()?;
        // Of few values several noise models have a maximum of their own: that of the start, white noise, and that of the plant without
        // the term.
        let mut starts = vec![start.clone()];
        if short && start.form == Form::FreeRun {
            starts.extend(inner.gaussian(start));
            starts.extend((before.form == start.form).then(|| Fit {
                noise: before.noise.clone(),
                ..start.clone()
            }));
        }
        let refined = (starts.into_iter())
            .filter_map(|start| inner.refit(&start, ROUNDS, THOROUGH))
            .min_by(|a, b| a.criterion.total_cmp(&b.criterion))?;
        // Of a plant that the term has changed much, its variable has other values than before.
        let range = range_along((&inner, &refined), recordings, &f.argument);
        Some((refined, range))
    };
    let refined: Vec<Option<(Fit, Option<Range>)>> = fitted
        .par_iter()
        .enumerate()
        .map(|(i, f)| {
            // A name must not lose to a curve for the steps that its fit lacks.
            let named = rank(spec, f) < SPECIFIC && f.gain > HALF * best && i < 2 * FINISHED;
            if i >= FINISHED && !named {
                return None;
            }
            refined_from(f, &f.fit)
        })
        .collect();
    let take = |f: &mut Fitted, (refined, range): (Fit, Option<Range>)| {
        f.range = range.unwrap_or(f.range);
        if refined.criterion < f.fit.criterion {
            f.gain = before.criterion - refined.criterion - searched(&f.lead, recordings);
            let first = options.free.len();
            f.shapes = refined.point[first..][..f.lead.shapes.len()].to_vec();
            f.fit = refined;
        }
    };
    for (f, refined) in fitted.iter_mut().zip(refined) {
        if let Some(refined) = refined {
            take(f, refined);
        }
    }
    fitted.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    // A likelihood with a noise model has several maxima, and chance would decide which name has found the best: each begins again
    // where the best one ended, until that stays the best.
    let first = study.parameters();
    for _ in 0..EXCHANGES {
        let Some(best) = fitted.first().filter(|f| f.gain > 0.0) else {
            break;
        };
        let (most, others) = (best.gain, best.without_term(first));
        let exchanged: Vec<Option<(Fit, Option<Range>)>> = fitted
            .par_iter()
            .enumerate()
            .map(|(i, f)| {
                let close = i < 2 * FINISHED && f.gain > HALF * most;
                if i == 0 || !(short || close) || rank(spec, f) >= SPECIFIC {
                    return None;
                }
                let mut start = f.candidate.from(&others, first);
                let values = f.values();
                start.point[first..][..values.len()].copy_from_slice(values);
                refined_from(f, &start)
            })
            .collect();
        for (f, refined) in fitted.iter_mut().zip(exchanged) {
            if let Some(refined) = refined {
                take(f, refined);
            }
        }
        fitted.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        if fitted[0].gain <= most {
            break;
        }
    }
    fitted
}
