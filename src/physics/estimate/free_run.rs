//! The fit in free run. Its likelihood may have many summits: several ways lead to the highest.

use rayon::prelude::*;

use super::adequacy::Question;
use super::deviance::Deviance;
use super::optimise::{ATTEMPTS, Effort, Range, minimise};
use super::problem::Problem;
use super::{Fit, Form, HOPELESS, ROUND, ROUNDS, SEARCH, SETTLED, residual_tests};
use crate::noise::{Noise, Series};

/// Effort for a first look at a start.
const GLANCE: Effort = Effort {
    iterations: 6,
    settled: 1.0,
    attempts: ATTEMPTS,
};
/// The same where a run takes seconds.
const COSTLY_GLANCE: Effort = Effort {
    iterations: 2,
    settled: 1.0,
    attempts: ATTEMPTS,
};
/// Factors of the observer's gain on the way to free run, and the effort at each.
const WEAKER: [f64; 10] = [0.6, 0.35, 0.2, 0.1, 0.05, 0.025, 0.012, 0.006, 0.003, 0.001];
const CONTINUED: Effort = Effort {
    iterations: 6,
    settled: 0.1,
    attempts: ATTEMPTS,
};
/// First part of the recordings that is fitted when it is made to grow, and the factor by which it grows.
const GROWN_FROM: f64 = 0.05;
const GROWTH: f64 = 1.3;
/// Draws within the bounds are compared on the first samples of each recording; on short recordings there are more of them.
pub(super) const GLANCED_SAMPLES: usize = 1500;
const GLANCED_VALUES: usize = 12_000;
const LEAST_DRAWS: usize = 4;
const MOST_DRAWS: usize = 16;
/// Deviances that differ by less are those of one summit.
const SAME_SUMMIT: f64 = 1.0;
/// How many of them are searched to the end.
const KEPT_DRAWS: usize = 3;
/// Level at which residuals are said to depend on the inputs.
const NOISE: f64 = 1e-3;

/// The fit in free run from the point of the innovation form, reached by weakening the observer in steps: with an observer the
/// likelihood is nearly convex, in free run it may have many summits.
pub(super) fn continue_free_run(problem: &Problem, innovation: &Fit) -> Option<Fit> {
    let mut point = innovation.point.clone();
    let numbers = problem.nominal().len();
    let mut ranges = problem.ranges();
    for weaker in WEAKER {
        for (gain, strong) in point[numbers..]
            .iter_mut()
            .zip(&innovation.point[numbers..])
        {
            *gain = weaker * strong;
        }
        ranges.truncate(numbers);
        ranges.extend(point[numbers..].iter().map(|&gain| Range::held(gain)));
        let mut objective =
            Deviance::new(problem, Form::Innovation, Noise::unit(problem.outputs()));
        objective.noise = objective.rescale(&point)?;
        minimise(&mut objective, &mut point, &ranges, CONTINUED)?;
        // Of an unstable plant there is no free run to be reached.
        if !follows(problem, &objective.residual(&point)?) {
            return None;
        }
    }
    point.truncate(numbers);
    white_fit(problem, &mut point, SEARCH)?;
    coloured_fit(problem, point, innovation.criterion)
}

/// Whether what is left of each output is smaller than its spread about its mean.
pub(super) fn follows(problem: &Problem, residual: &Series) -> bool {
    left(problem, residual).iter().all(|part| *part < 1.0)
}

/// What is left of each output, as a part of its sum of squares about its mean.
pub(super) fn left(problem: &Problem, residual: &Series) -> Vec<f64> {
    let l = problem.outputs();
    let of_output = |o: usize| {
        let (mut left, mut values) = (0.0, Vec::new());
        let recorded = problem.recordings.iter().map(|r| &r.outputs[o]);
        for (e, y) in residual.iter().skip(o).step_by(l).zip(recorded) {
            let known = e.iter().zip(y).filter(|(_, y)| y.is_finite());
            for (e, y) in known {
                left += e * e;
                values.push(*y);
            }
        }
        let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
        left / values.iter().map(|y| (y - mean).powi(2)).sum::<f64>()
    };
    (0..l).map(of_output).collect()
}

/// The fit in free run from the values of the text and, unless that leaves white noise that does not depend on the inputs, to
/// longer and longer parts of the recordings; unless both end at one summit, also from the values of the text less one term
/// each, and from draws within the bounds. Summits are compared under white noise: a
/// coloured noise model would absorb what a wrong one leaves.
pub(super) fn fit_free_run(problem: &Problem) -> Option<Fit> {
    let mut point = problem.nominal();
    let mut highest = white_fit(problem, &mut point, SEARCH).unwrap_or(f64::INFINITY);
    let mut best = if highest.is_finite() {
        coloured_fit(problem, point, f64::INFINITY)
    } else {
        None
    };
    if best.as_ref().is_some_and(|fit| leaves_noise(problem, fit)) {
        return best;
    }
    if !problem.plant.costly()
        && let Some((deviance, point)) = grown_fit(problem)
    {
        // Two ways that end at one summit: there is no sign of others, and what is left is not a matter of the start.
        if (deviance - highest).abs() < SAME_SUMMIT {
            return best;
        }
        if deviance < highest {
            highest = deviance;
            best = coloured_fit(problem, point, f64::INFINITY).or(best);
            if best.as_ref().is_some_and(|fit| leaves_noise(problem, fit)) {
                return best;
            }
        }
    }
    // Draws are compared on the first part of the recordings.
    let recordings = problem.parts(|r| r.before_measured(GLANCED_SAMPLES));
    let short = problem.with_recordings(&recordings);
    let draws = (GLANCED_VALUES / short.count().max(1)).clamp(LEAST_DRAWS, MOST_DRAWS);
    let (draws, glance) = if problem.plant.costly() {
        (LEAST_DRAWS, COSTLY_GLANCE)
    } else {
        (draws, GLANCE)
    };
    let draws = problem.draws(draws).into_iter().map(|d| (d, None));
    let starts: Vec<_> = problem.without_terms().into_iter().chain(draws).collect();
    let mut tried: Vec<(f64, Vec<f64>)> = starts
        .into_par_iter()
        .filter_map(|(mut point, held)| {
            let (deviance, _) = white_fit_holding(&short, &mut point, glance, held)?;
            Some((deviance, point))
        })
        .collect();
    tried.sort_by(|a, b| a.0.total_cmp(&b.0));
    tried.truncate(KEPT_DRAWS);
    let searched: Vec<(f64, Vec<f64>)> = tried
        .into_par_iter()
        .filter_map(|(_, mut point)| Some((white_fit(problem, &mut point, SEARCH)?, point)))
        .collect();
    for (deviance, point) in searched {
        if deviance < highest - SAME_SUMMIT {
            highest = deviance;
            best = coloured_fit(problem, point, f64::INFINITY).or(best);
        }
    }
    best
}

/// The fit under white noise to longer and longer first parts of the recordings, each from the one before, with its deviance. On
/// a short part the likelihood has few summits; where small errors grow along a recording, a long one has many.
fn grown_fit(problem: &Problem) -> Option<(f64, Vec<f64>)> {
    let mut point = problem.nominal();
    let mut part = GROWN_FROM;
    while part < 1.0 {
        let recordings = problem.parts(|r| r.first_part(part));
        let short = problem.with_recordings(&recordings);
        if short.count() > 2 * point.len() {
            white_fit(&short, &mut point, CONTINUED)?;
        }
        part *= GROWTH;
    }
    let deviance = white_fit(problem, &mut point, SEARCH)?;
    Some((deviance, point))
}

/// Whether the residuals of a fit are white and pass the tests. Coloured noise may hide what another summit explains.
pub(super) fn leaves_noise(problem: &Problem, fit: &Fit) -> bool {
    if fit.noise.colours.iter().any(|c| c.len() > 0) {
        return false;
    }
    let mut objective = Deviance::new(problem, Form::FreeRun, fit.noise.clone());
    let (Some(residual), Some(simulated)) = (
        objective.residual(&fit.point),
        objective.simulated(&fit.point),
    ) else {
        return false;
    };
    let innovations = fit.noise.whiten(&residual, &problem.mask);
    let tests = residual_tests(problem, fit, &innovations, &simulated);
    let level = NOISE / tests.len().max(1) as f64;
    // A noise model without colour was found white already, unless no other was asked for.
    let chosen = !problem.least_squares();
    tests
        .iter()
        .filter(|t| !(chosen && t.question == Question::White))
        .all(|t| t.p_value > level)
}

/// Rounds of noise model and parameters from a point; given up where it cannot reach the criterion of a rival.
pub(super) fn coloured_fit(problem: &Problem, mut point: Vec<f64>, rival: f64) -> Option<Fit> {
    let mut objective = Deviance::new(problem, Form::FreeRun, Noise::unit(problem.outputs()));
    let mut last = f64::INFINITY;
    for _ in 0..ROUNDS {
        let residual = objective.residual(&point)?;
        objective.noise = problem.noise(&residual);
        let deviance = minimise(&mut objective, &mut point, &problem.ranges(), ROUND)?;
        let now = problem.criterion(deviance, objective.noise.len(), 0);
        if last - deviance < SETTLED || now > rival + HOPELESS {
            last = deviance;
            break;
        }
        last = deviance;
    }
    let criterion = problem.criterion(last, objective.noise.len(), 0);
    Some(Fit {
        form: Form::FreeRun,
        point,
        noise: objective.noise,
        deviance: last,
        criterion,
    })
}

/// Improves a point under white noise whose size is that of what is left; gives the deviance with the size at the end.
pub(super) fn white_fit(problem: &Problem, point: &mut Vec<f64>, effort: Effort) -> Option<f64> {
    white_fit_holding(problem, point, effort, None).map(|(deviance, _)| deviance)
}

/// The same with one of the parameters held; gives the noise too.
pub(super) fn white_fit_holding(
    problem: &Problem,
    point: &mut Vec<f64>,
    effort: Effort,
    held: Option<usize>,
) -> Option<(f64, Noise)> {
    let mut objective = Deviance::new(problem, Form::FreeRun, Noise::unit(problem.outputs()));
    let mut ranges = problem.ranges();
    if let Some(i) = held {
        ranges[i] = Range::held(point[i]);
    }
    for _ in 0..2 {
        objective.noise = objective.rescale(point)?;
        minimise(&mut objective, point, &ranges, effort)?;
    }
    let noise = objective.rescale(point)?;
    let residual = objective.residual(point)?;
    Some((noise.deviance(&residual, &problem.mask), noise))
}
