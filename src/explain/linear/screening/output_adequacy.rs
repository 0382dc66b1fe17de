//! Is what an explanation leaves behind noise?
//!
//! Some seventy flexible features an output (hats in the input and its rate, in the position and the rate, in time, products,
//! delays, play, curves at the sensor) are sent through the plant and regressed on the residual, beyond what the
//! fitted numbers explain: along the motion of the explanation, and along that of the simulation as given, because an
//! explanation that fails may have lost the motion. A line in the spectrum is looked for as well. The tests are made
//! under low-order noise: an autoregression of high order learns slow misfit as colour and hides it
//! (math/explain.md, choice 10). A significant share of little size is no objection: every model is wrong somewhere.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::score_tests::Bench;
use crate::explain::document::sentences::p_value;
use crate::explain::linear::data::{Series, difference};
use crate::explain::linear::fit::{Fit, Problem};
use crate::explain::linear::model::structure::Instance;
use crate::noise::{Colours, Mask, Noise};

/// Significance at which what is left counts as structure.
pub(crate) const LEVEL: f64 = 1e-4;
/// Significance from which structure that is left is taken off what noise allows.
const STRUCTURE: f64 = 0.01;
/// Share of the residual's variance from which structure matters where no physics is named.
pub(crate) const SHARE: f64 = 0.03;

/// Structure that is left counts as imperfection of a law that is right in kind, while it is below this share of what
/// the law has explained: the textbook form of a law is rarely closer to a real one than some thousandths.
const OF_REMOVED: f64 = 0.0075;
/// The same for dry friction, whose textbook laws leave out bristles, lubricant and dwell time (Armstrong-Helouvry,
/// Dupont and Canudas de Wit 1994).
const OF_REMOVED_BY_FRICTION: f64 = 0.02;

/// Motions that differ by more (in standard deviations of the outputs) are both tried.
const OTHER_MOTION: f64 = 0.1;

/// The same for a plant of another class, over what it has removed of the simulation error. Its few numbers stand for
/// holes, pumps and sensors whose coefficients vary by some percents with the flow.
const OF_CLASS: f64 = 0.1;

/// What a residual still holds.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Adequacy {
    pub(crate) features: usize,
    pub(crate) p_value: f64,
    /// Share of the whitened residual's variance that is explained, less what chance explains.
    pub(crate) share: f64,
    /// Share of the variance of the simulation error itself, not whitened, that is structure: what is above the noise.
    pub(crate) share_of_error: f64,
    /// The same, over what the explanation has removed from the error before it; infinite without one.
    pub(crate) of_removed: f64,
    /// The share of it that the named laws may be wrong by.
    pub(crate) tolerated: f64,
}

impl Adequacy {
    /// What the features find, where that does not count against the explanation by its significance.
    pub(crate) fn sentence(&self, of: &str) -> String {
        let (features, probability) = (self.features, p_value(self.p_value));
        if self.p_value >= STRUCTURE {
            return format!(
                "Nothing is left{of} that {features} flexible features find ({probability})"
            );
        }
        format!(
            "{features} flexible features find structure in the residual{of} at the {} % level ({probability}), but not at the {} % \
             level, which would count against the answer",
            100.0 * STRUCTURE,
            100.0 * LEVEL
        )
    }

    /// Whether the explanation suffices.
    pub(crate) fn holds(&self) -> bool {
        self.p_value > LEVEL
            || if self.of_removed.is_finite() {
                self.of_removed < self.tolerated
            } else {
                self.share < SHARE
            }
    }

    /// What the structure that is left is worth in a likelihood of `count` values.
    pub(crate) fn gain(&self, count: usize) -> f64 {
        -(count as f64) * (-self.share.min(0.999_999)).ln_1p()
    }

    /// The same for a plant of another class than the linear one. What it removes is slow, and an autoregression of order
    /// one, under which this test is made, counts that for little; so it is measured as simulation error, whose mean
    /// square was `before` and is `now`.
    pub(crate) fn of_class(self, before: f64, now: f64) -> Self {
        if self.holds() {
            return self;
        }
        let removed = before - now;
        Self {
            of_removed: if removed > 0.0 {
                self.share * now / removed
            } else {
                f64::INFINITY
            },
            tolerated: OF_CLASS,
            ..self
        }
    }
}

/// One test: its probability under noise, and the variance that it explains beyond chance.
struct Structure {
    p_value: f64,
    explained: f64,
}

/// Tests what `fit` leaves; `given` is the simulation as given, `before` the best explanation without the effects of
/// `fit`, if it has any.
pub(crate) fn adequacy(
    problem: &Problem,
    fit: &Fit,
    given: &Fit,
    before: Option<&Fit>,
) -> Option<Adequacy> {
    adequacy_under(Colours::Few, problem, fit, given, before)
}

/// The same under noise of some of `colours`.
fn adequacy_under(
    colours: Colours,
    problem: &Problem,
    fit: &Fit,
    given: &Fit,
    before: Option<&Fit>,
) -> Option<Adequacy> {
    let mut fit = fit.clone();
    let noise = Noise::estimate(&fit.residual, problem.data.outputs, &problem.mask, colours);
    let sensitivities = fit.sensitivities(problem);
    let bench = Bench::new(problem, &fit, &noise, sensitivities)?;
    let mut tests = Vec::new();
    let mut features = 0;
    let moved = problem.size(&difference(&given.simulated, &fit.simulated)) > OTHER_MOTION;
    for moving in [Some(&fit), moved.then_some(given)].into_iter().flatten() {
        let Some((gained, left, count)) = bench.feature_gain(moving) else {
            continue;
        };
        let free = count as f64;
        let variance = (left - gained) / (problem.count() as f64 - free).max(1.0);
        tests.push(Structure {
            p_value: ChiSquared::new(free).map_or(1.0, |d| d.sf(gained / variance.max(1e-300))),
            explained: (gained - free * variance).max(0.0),
        });
        features = features.max(count);
    }
    if tests.is_empty() {
        return None;
    }
    let left = bench.left;
    let whitened = noise.whiten(&fit.residual, &problem.mask);
    tests.push(line(&whitened, &problem.mask));
    // As many tests, one level: Bonferroni's bound.
    let count = tests.len() as f64;
    let p_value = |t: &Structure| (count * t.p_value).min(1.0);
    let significant = tests
        .iter()
        .filter(|t| p_value(t) <= LEVEL)
        .max_by(|a, b| a.explained.total_cmp(&b.explained));
    let shown =
        significant.or_else(|| tests.iter().min_by(|a, b| a.p_value.total_cmp(&b.p_value)))?;
    let dry = |e: &Instance| matches!(e.definition.id, "coulomb_friction" | "stribeck_friction");
    let tolerated = if fit.structure.new_effects().iter().any(dry) {
        OF_REMOVED_BY_FRICTION
    } else {
        OF_REMOVED
    };
    let share_of_error = if p_value(shown) < STRUCTURE {
        structure_of_error(problem, &fit).unwrap_or(0.0)
    } else {
        0.0
    };
    Some(Adequacy {
        share_of_error,
        tolerated,
        features,
        p_value: p_value(shown),
        share: shown.explained / left,
        of_removed: before.map_or(f64::INFINITY, |before| {
            // What was there is measured in the same metric.
            let there = square(
                &noise.whiten(&before.residual, &problem.mask),
                &problem.mask,
            );
            let now = square(&whitened, &problem.mask);
            (shown.explained / (there - now).max(1e-12 * left)).min(MOST)
        }),
    })
}

/// Share of the variance of the simulation error that features explain beyond what coloured noise of as many independent
/// values would let them.
fn structure_of_error(problem: &Problem, fit: &Fit) -> Option<f64> {
    let mut fit = fit.clone();
    let white = Noise::white(&fit.residual, problem.data.outputs, &problem.mask);
    let sensitivities = fit.sensitivities(problem);
    let bench = Bench::new(problem, &fit, &white, sensitivities)?;
    let (gained, left, features) = bench.feature_gain(&fit)?;
    let independent = fit
        .residual
        .iter()
        .map(|e| crate::explain::linear::effective_samples::effective(e))
        .sum::<f64>();
    let chance = features as f64 / independent.max(1.0);
    Some((gained / left - chance).clamp(0.0, 1.0))
}

/// Cap of a share of next to nothing.
const MOST: f64 = 1e6;

/// Sum of squares of the values that count.
fn square(series: &[Vec<f64>], mask: &[Vec<bool>]) -> f64 {
    series
        .iter()
        .zip(mask)
        .flat_map(|(e, m)| e.iter().zip(m))
        .filter(|(_, keep)| **keep)
        .map(|(e, _)| e * e)
        .sum()
}

/// The largest line of the periodogram against the sum of all (Fisher 1929): `m` ordinates of white noise hold one
/// of more than the share `g` with probability `m exp(-m g)` at most, about.
fn line(whitened: &Series, mask: &Mask) -> Structure {
    let mut found = Structure {
        p_value: 1.0,
        explained: 0.0,
    };
    let mut planner = realfft::RealFftPlanner::<f64>::new();
    for (e, keep) in whitened.iter().zip(mask) {
        let mut kept: Vec<f64> = e
            .iter()
            .zip(keep)
            .map(|(e, keep)| if *keep { *e } else { 0.0 })
            .collect();
        let transform = planner.plan_fft_forward(kept.len());
        let mut spectrum = transform.make_output_vec();
        if transform.process(&mut kept, &mut spectrum).is_err() || spectrum.len() < 8 {
            continue;
        }
        let power: Vec<f64> = spectrum.iter().skip(1).map(|s| s.norm_sqr()).collect();
        let total: f64 = power.iter().sum();
        let m = power.len() as f64;
        let share = power.iter().copied().fold(0.0, f64::max) / total.max(1e-300);
        let p_value = (m.ln() - m * share).exp().min(1.0) * whitened.len() as f64;
        let explained = (share - m.ln() / m).max(0.0)
            * square(std::slice::from_ref(e), std::slice::from_ref(keep));
        if p_value < found.p_value {
            found = Structure { p_value, explained };
        }
    }
    found
}

#[cfg(test)]
mod tests;
