//! How much is tried, how hard, and what is enough.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::physics::Plant;
use crate::physics::estimate::{Effort, Study};

/// Leads of each screen that are fitted with the noise of the fit before.
pub(crate) const GLANCED: usize = 12;
/// ... of them at most so many of one kind and at one place.
pub(crate) const OF_A_KIND: usize = 3;
pub(crate) const AT_A_PLACE: usize = 6;
/// The best lead of each term is fitted too where its statistic is at least this part of the best.
pub(crate) const IMITATED: f64 = 0.3;
pub(crate) const GLANCE: Effort = Effort {
    iterations: 4,
    settled: 0.3,
    attempts: 8,
};
/// Error of a step where fits are only compared with each other.
pub(crate) const GLANCED_ACCURACY: f64 = 1e-6;
/// Free runs whose errors are larger than this part of the standard deviation follow nothing: a sensor that shows a constant
/// comes near 1.
pub(crate) const FOLLOWS: f64 = 0.95;
/// Steps a sample that a candidate may need, on average; one that needs more is left out, for the time it costs.
pub(crate) const GLANCED_STEPS: usize = 20;
pub(crate) const MOST_STEPS: usize = 60;
/// ... or so many times what the plant needs without it, or what takes so many steps in all, which is a moment.
const TIMES_OWN: usize = 3;
const CHEAP_STEPS: usize = 200_000;

/// A plant that may need so many steps a sample, and more where it needed them before, or there are few samples.
pub(crate) fn limited(plant: Plant, study: &Study, most: usize) -> Plant {
    let own = TIMES_OWN * study.steps_a_sample();
    plant
        .counting_with(study.plant())
        .with_most_steps(most.max(own).max(CHEAP_STEPS / study.samples().max(1)))
}
/// The best of these are fitted with a noise model of their own, and the best of them until nothing changes.
pub(crate) const FITTED: usize = 5;
/// ... and more of short recordings, whose fits cost little and whose tests order leads badly: so many as have this many samples
/// together, and of each kind and place that many times more leads, up to a limit.
const CHEAP_SAMPLES: usize = 4000;
const MOST_TIMES: usize = 4;

/// How many times more of a recording with so many samples is tried, measured or not.
pub(crate) fn times_more(samples: usize) -> usize {
    (CHEAP_SAMPLES / (FITTED * samples.max(1))).clamp(1, MOST_TIMES)
}
pub(crate) const FINISHED: usize = 4;
pub(crate) const THOROUGH: Effort = Effort {
    iterations: 20,
    settled: 0.05,
    attempts: 8,
};
/// Effort where fits are compared before the best of them are finished.
pub(crate) const COMPARED: Effort = Effort {
    iterations: 10,
    settled: 0.5,
    attempts: 6,
};
pub(crate) const ROUNDS: usize = 2;
/// Operations of runs after which nothing is begun that an answer can do without: other pairs of effects, and a search for the free
/// run. The answers for 64 plants of eight kinds take 2e8 to 3e9; this is about a minute of two cores.
const MOST_WORK: u64 = 4_000_000_000;

/// Whether so much has been tried that only what has begun is finished.
pub(crate) fn is_spent(plant: &Plant) -> bool {
    plant.work() > MOST_WORK
}

/// Gain in Schwarz's criterion that is needed, beyond the penalty for what was searched: odds of e^8 (math/physics.md).
pub(crate) const NEEDED: f64 = 16.0;
/// A name is given where the gain is at least this; between [`NEEDED`] and this the place is given, and the best term as a
/// rival (math/physics.md, "Fits and decision").
pub(crate) const SURE: f64 = 24.0;
/// Beside an effect, terms are fitted whose test foretells this part of the gain that is needed.
pub(crate) const FORETOLD: f64 = 0.25;
/// A second effect must gain more, and at least this part of the first.
pub(crate) const SECOND: (f64, f64) = (30.0, 0.12);
/// Level of the test that asks for one: of all score tests together.
pub(crate) const LEFT: f64 = 0.01;
/// A better fit of the plant itself is taken from here on, and so often at most.
pub(crate) const BETTER: f64 = 1.0;
pub(crate) const BETTER_FITS: usize = 2;
/// Most effects that are named.
pub(crate) const MOST: usize = 2;

/// Probability of a chi-square with one degree of freedom beyond `statistic`.
pub(crate) fn chance(statistic: f64) -> f64 {
    ChiSquared::new(1.0).map_or(1.0, |law| law.sf(statistic))
}

/// The statistic that the strongest of so many tests reaches by chance with probability [`LEFT`].
pub(crate) fn significant(tests: usize) -> f64 {
    let each = LEFT / tests.max(1) as f64;
    ChiSquared::new(1.0).map_or(f64::INFINITY, |law| law.inverse_cdf(1.0 - each))
}
