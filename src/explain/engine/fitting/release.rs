//! Sizes at which something snaps, searched one by one: the deviance has jumps there, and no slope.

use rayon::prelude::*;

use crate::explain::engine::terms::term::{Shape, Starts, Term};
use crate::explain::engine::thresholds::BETTER;
use crate::physics::estimate::{Fit, Study};

/// Ratio of sizes that are tried after each other, and how many to either side.
const RATIO: f64 = 1.01;
const COUNT: i32 = 15;
/// Searches, each with a fit of everything else after it.
const SEARCHES: usize = 4;

/// A fit with the sizes of a term that are searched so, each search followed by a fit from there; `first` is the place of the
/// term's first number.
pub(in crate::explain::engine) fn released(
    study: &Study,
    term: &Term,
    first: usize,
    mut fit: Fit,
    again: &dyn Fn(&Fit) -> Option<Fit>,
) -> Fit {
    let releases = |s: &Shape| matches!(s.starts, Starts::Releases(_));
    let places = term.shapes.iter().zip(first..);
    let places = places.filter(|(s, _)| releases(s));
    for (_, place) in places {
        for _ in 0..SEARCHES {
            let at = |k: i32| {
                let mut moved = fit.clone();
                moved.point[place] *= RATIO.powi(k);
                let deviance = study.deviance(&moved).unwrap_or(f64::INFINITY);
                (deviance, moved)
            };
            let tried = (-COUNT..=COUNT).into_par_iter().map(at);
            let best = tried.min_by(|a, b| a.0.total_cmp(&b.0));
            let moved = best.filter(|(deviance, _)| *deviance < fit.deviance - BETTER);
            let better = moved.and_then(|(_, moved)| again(&moved));
            let Some(better) = better.filter(|b| b.deviance < fit.deviance - BETTER) else {
                break;
            };
            fit = better;
        }
    }
    fit
}
