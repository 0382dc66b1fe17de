//! Is what an explanation leaves behind noise?
//!
//! Some forty flexible features an output (hats in the input, the position and the rate, in time, products, delays, play) are
//! sent through the plant and regressed on the residual, beyond what the fitted numbers explain. The test is made
//! under low-order noise: an autoregression of high order learns slow misfit as colour and hides it
//! (math/explain.md, choice 10). A significant share of little size is no objection: every model is wrong somewhere.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::fit::{Fit, Problem};
use super::noise::Noise;
use super::screen::Bench;

/// Significance at which what is left counts as structure.
pub(crate) const LEVEL: f64 = 1e-4;
/// Share of the residual's variance from which structure matters.
pub(crate) const SHARE: f64 = 0.03;

/// Structure that is left counts as imperfection of a law that is right in kind, while it is below this share of what
/// the law has explained: the textbook form of a law is rarely closer to a real one than some percents.
pub(crate) const OF_REMOVED: f64 = 0.03;

/// The same for a plant of another class, over what it has removed of the simulation error. Its few numbers stand for
/// holes, pumps and sensors whose coefficients vary by some percents with the flow.
const OF_CLASS: f64 = 0.1;

/// What a residual still holds.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Adequacy {
    pub features: usize,
    pub p_value: f64,
    /// Share of the whitened residual's variance that the features explain, less what chance explains.
    pub share: f64,
    /// The same, over what the explanation has removed from the error before it.
    pub of_removed: f64,
    /// Below this `of_removed` is imperfection.
    allowed: f64,
}

impl Adequacy {
    /// Whether the explanation suffices.
    pub fn holds(&self) -> bool {
        self.p_value > LEVEL || self.share < SHARE || self.of_removed < self.allowed
    }

    /// The same for a plant of another class than the linear one. What it removes is slow, and an autoregression of order
    /// one, under which this test is made, counts that for little; so it is measured as simulation error, whose mean
    /// square was `before` and is `now`.
    pub fn of_class(self, before: f64, now: f64) -> Self {
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
            allowed: OF_CLASS,
            ..self
        }
    }
}

/// Tests what `fit` leaves; `before` is the best explanation without its effects.
pub(crate) fn adequacy(problem: &Problem, fit: &Fit, before: Option<&Fit>) -> Option<Adequacy> {
    let mut fit = fit.clone();
    let noise = Noise::estimate(&fit.residual, problem.data.outputs, &problem.mask, 1);
    let sensitivities = fit.sensitivities(problem);
    let bench = Bench::new(problem, &fit, &noise, sensitivities)?;
    let (gained, left, features) = bench.feature_gain()?;
    let n = problem.count() as f64;
    let variance = (left - gained) / (n - features as f64).max(1.0);
    let statistic = gained / variance.max(1e-300);
    let p_value = ChiSquared::new(features as f64).map_or(1.0, |d| d.sf(statistic));
    Some(Adequacy {
        features,
        p_value,
        allowed: OF_REMOVED,
        of_removed: before.map_or(f64::INFINITY, |before| {
            // What was there is measured by the same features, so that noise is not counted as removed.
            let whitened = noise.whiten(&before.residual);
            let there: f64 = whitened
                .iter()
                .zip(&problem.mask)
                .flat_map(|(e, m)| {
                    e.iter()
                        .zip(m)
                        .filter(|(_, keep)| **keep)
                        .map(|(e, _)| e * e)
                })
                .sum();
            let now: f64 = noise
                .whiten(&fit.residual)
                .iter()
                .zip(&problem.mask)
                .flat_map(|(e, m)| {
                    e.iter()
                        .zip(m)
                        .filter(|(_, keep)| **keep)
                        .map(|(e, _)| e * e)
                })
                .sum();
            (gained - features as f64 * variance).max(0.0) / (there - now).max(1e-300)
        }),
        share: ((gained - features as f64 * variance) / left).max(0.0),
    })
}
