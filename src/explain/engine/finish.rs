//! The last fits of the best candidates.

use rayon::prelude::*;

use super::fitted::{Fitted, searched, with_more};
use super::library::Starts;
use super::names::{SPECIFIC, rank};
use super::search::{FINISHED, MOST_STEPS, ROUNDS, THOROUGH};
use crate::physics::estimate::{Effort, EstimateOptions, Fit, PlantRecording, Study};

/// Names that gain this part of the best are finished too.
const HALF: f64 = 0.5;
/// Times of a change that are tried on either side, and no step of a fit.
const TIMES: usize = 10;
const AS_IT_IS: Effort = Effort {
    iterations: 0,
    settled: 0.0,
    attempts: 0,
};

/// A fit with the time of its change moved where that is better: between the times that were tested there are more optima than
/// one, and descent ends in the nearest.
fn at_its_time(study: &Study, f: &Fitted) -> Fit {
    let mut best = f.fit.clone();
    let first = study.parameters() - f.candidate.values.len();
    for (i, shape) in f.lead.term.shapes.iter().enumerate() {
        let Starts::Length(parts) = shape.starts else {
            continue;
        };
        if shape.positive {
            continue;
        }
        let apart = study.duration() * (parts[1] - parts[0]);
        let from = f.fit.point[first + i];
        for k in 1..=TIMES {
            for sign in [-1.0, 1.0] {
                let mut trial = f.fit.clone();
                trial.point[first + i] = from + sign * apart * k as f64 / TIMES as f64;
                if let Some(moved) = study.refit(&trial, 0, AS_IT_IS)
                    && moved.deviance < best.deviance
                {
                    best = moved;
                }
            }
        }
    }
    best
}

/// The best of all fits, fitted until nothing changes; the others as they are. Best first.
pub(super) fn finished(
    mut fitted: Vec<Fitted>,
    study: &Study,
    before: &Fit,
    recordings: &[PlantRecording],
    options: &EstimateOptions,
) -> Vec<Fitted> {
    fitted.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let best = fitted.first().map_or(0.0, |f| f.gain);
    let spec = &study.plant().spec;
    let refined: Vec<Option<Fit>> = fitted
        .par_iter()
        .enumerate()
        .map(|(i, f)| {
            // A name must not lose to a curve for the steps that its fit lacks.
            let named = rank(spec, f) < SPECIFIC && f.gain > HALF * best && i < 2 * FINISHED;
            if i >= FINISHED && !named {
                return None;
            }
            let options = with_more(options, f.candidate.values.len());
            let limited = f.candidate.plant.clone().with_most_steps(MOST_STEPS);
            let inner = study.of(&limited, &options).ok()?;
            inner.refit(&at_its_time(&inner, f), ROUNDS, THOROUGH)
        })
        .collect();
    for (f, refined) in fitted.iter_mut().zip(refined) {
        let Some(refined) = refined else { continue };
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
