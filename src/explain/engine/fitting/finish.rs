//! The last fits of the best candidates.

use rayon::prelude::*;

use crate::explain::engine::fitting::fitted::{Fitted, searched, with_more};
use crate::explain::engine::screening::along::range_along;
use crate::explain::engine::terms::names::{SPECIFIC, rank};
use crate::explain::engine::thresholds::{FINISHED, MOST_STEPS, ROUNDS, THOROUGH, limited};
use crate::physics::estimate::{EstimateOptions, Fit, PlantRecording, Study};

/// Names that gain this part of the best are finished too.
const HALF: f64 = 0.5;

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
    let refined: Vec<Option<(Fit, Option<Range>)>> = fitted
        .par_iter()
        .enumerate()
        .map(|(i, f)| {
            // A name must not lose to a curve for the steps that its fit lacks.
            let named = rank(spec, f) < SPECIFIC && f.gain > HALF * best && i < 2 * FINISHED;
            if i >= FINISHED && !named {
                return None;
            }
            let options = with_more(options, f.candidate.values.len());
            let limited = limited(f.candidate.plant.clone(), study, MOST_STEPS);
            let inner = study.of(&limited, &options).ok()?;
            let refined = inner.refit(&f.fit, ROUNDS, THOROUGH)?;
            // Of a plant that the term has changed much, its variable has other values than before.
            let range = range_along((&inner, &refined), recordings, &f.argument);
            Some((refined, range))
        })
        .collect();
    for (f, refined) in fitted.iter_mut().zip(refined) {
        let Some((refined, range)) = refined else {
            continue;
        };
        f.range = range.unwrap_or(f.range);
        if refined.criterion < f.fit.criterion {
            f.gain = before.criterion - refined.criterion - searched(&f.lead, recordings);
            let first = options.free.len();
            f.shapes = refined.point[first..][..f.lead.shapes.len()].to_vec();
            f.fit = refined;
        }
    }
    fitted.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    fitted
}
