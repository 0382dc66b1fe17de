//! Intervals from the profile of the likelihood, where that is not the parabola of the covariance.

use super::Fit;
use super::deviance::{Covariances, Deviance};
use super::optimise::{ATTEMPTS, Effort, Objective, Range, minimise};
use super::problem::Problem;

/// 95 % point of the chi-square distribution with one degree of freedom.
const LEVEL: f64 = 3.841_458_820_694_124;
/// The parabola is believed where the deviance at its ends is within this of the level.
const PARABOLA: (f64, f64) = (0.75 * LEVEL, 1.3 * LEVEL);
/// The same along the straight line that the covariance foretells, on which the deviance is at least that of the profile.
const STRAIGHT: (f64, f64) = (0.85 * LEVEL, 1.15 * LEVEL);
/// Effort for the other numbers at one value of the parameter.
const OTHERS: Effort = Effort {
    iterations: 4,
    settled: 1e-2,
    attempts: ATTEMPTS,
};
/// Values tried on a side.
const TRIES: usize = 3;

/// The 95 % interval of free parameter `i`.
pub(super) fn interval(
    objective: &mut Deviance,
    problem: &Problem,
    fit: &Fit,
    covariances: &Covariances,
    i: usize,
) -> (f64, f64) {
    let covariance = &covariances.given_noise;
    let std = covariance[(i, i)].max(0.0).sqrt();
    let mut ranges = problem.ranges();
    ranges.extend(fit.point[ranges.len()..].iter().map(|_| Range {
        min: f64::NEG_INFINITY,
        max: f64::INFINITY,
        reach: f64::INFINITY,
    }));
    let own = ranges[i];
    let value = fit.point[i];
    if !std.is_finite() || std <= 0.0 {
        return (own.min, own.max);
    }
    let joint = covariances.joint[(i, i)].max(0.0).sqrt();
    let width = own.max - own.min;
    let open = if width.is_finite() {
        joint > width / 12f64.sqrt()
    } else {
        joint > value.abs()
    };
    if open {
        // Not determined: the parabola is all there is, within the bounds.
        let reach = LEVEL.sqrt() * joint;
        return ((value - reach).max(own.min), (value + reach).min(own.max));
    }
    let base = objective.deviance(&fit.point).unwrap_or(fit.deviance);
    // Where the covariance says that the others go when the parameter moves.
    let line = |to: f64| -> Vec<f64> {
        let part = (to - value) / covariance[(i, i)];
        let others = (0..fit.point.len()).map(|j| fit.point[j] + part * covariance[(j, i)]);
        others.collect()
    };
    let mut side = |sign: f64| {
        let mut at = value + sign * LEVEL.sqrt() * std;
        let along = line(at);
        let inside = along
            .iter()
            .zip(&ranges)
            .all(|(p, r)| p.is_finite() && *p > r.min && *p < r.max);
        if inside
            && objective
                .deviance(&along)
                .is_some_and(|d| (STRAIGHT.0..STRAIGHT.1).contains(&(d - base)))
        {
            return at;
        }
        let mut best = at;
        for attempt in 0..TRIES {
            let tried = at.clamp(own.min, own.max);
            // From there the other numbers are nearly at their summit; from the estimate they would be far from it.
            let mut point = line(tried);
            for (p, (range, fitted)) in point.iter_mut().zip(ranges.iter().zip(&fit.point)) {
                *p = if p.is_finite() {
                    p.clamp(range.min, range.max)
                } else {
                    *fitted
                };
            }
            point[i] = tried;
            let mut held = ranges.clone();
            held[i] = Range::held(tried);
            let Some(deviance) = minimise(objective, &mut point, &held, OTHERS) else {
                // What cannot be simulated is outside.
                at = 0.5 * (value + tried);
                continue;
            };
            let rise = (deviance - base).max(1e-6);
            best = tried;
            if (PARABOLA.0..PARABOLA.1).contains(&rise) {
                // Within what the parabola says at the first attempt; found at a later one.
                return if attempt == 0 {
                    tried
                } else {
                    value + (tried - value) * (LEVEL / rise).sqrt()
                };
            }
            if tried != at && rise < LEVEL {
                return tried; // the bound is inside the interval
            }
            at = value + (tried - value) * (LEVEL / rise).sqrt().clamp(0.2, 4.0);
        }
        best
    };
    let (low, high) = (side(-1.0), side(1.0));
    // The profile is that of the deviance with the noise model given.
    let wider = joint / std;
    let wider = if wider.is_finite() {
        wider.max(1.0)
    } else {
        1.0
    };
    (
        (value + wider * (low - value)).max(own.min),
        (value + wider * (high - value)).min(own.max),
    )
}
