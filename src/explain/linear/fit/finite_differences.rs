//! How the simulation changes with each number: differences whose steps adapt until they move the outputs by a fixed share
//! of their size, because parameters differ by ten decades in scale, and most laws are not smooth everywhere.

use rayon::prelude::*;

use super::{Fit, Problem};
use crate::explain::linear::data::{Series, difference};

/// A difference step should move the outputs by this share of their standard deviation.
const STEP_SHARE: f64 = 1e-5;
/// Steps stay between these, whatever the outputs do.
const SMALLEST_STEP: f64 = 1e-30;
const LARGEST_STEP: f64 = 1e30;

/// Steps that are tried for a secant, each a third of the one before: down to 1e-7 of the number.
const SECANTS: usize = 14;

/// First guesses of the difference steps; they adapt.
pub(super) fn first_steps(theta: &[f64]) -> Vec<f64> {
    theta.iter().map(|v| (v.abs() * 1e-5).max(1e-7)).collect()
}

/// What one number does to the simulation over a step.
struct Nudge {
    /// The step that was made, backward (negative) from an upper bound.
    step: f64,
    change: Series,
    /// Root mean square of the change, in standard deviations of the outputs.
    size: f64,
}

impl Nudge {
    fn slope(mut self) -> Series {
        for value in self.change.iter_mut().flatten() {
            *value /= self.step;
        }
        self.change
    }
}

impl Fit {
    /// Change of the simulation with each number: a series a number, and none for one that moves nothing.
    pub(crate) fn sensitivities(&mut self, problem: &Problem) -> Vec<Option<Series>> {
        let bounds = self.structure.bounds();
        let held = self.structure.held();
        let mut steps = std::mem::take(&mut self.steps);
        let columns = steps
            .par_iter_mut()
            .with_max_len(1)
            .enumerate()
            .map(|(i, step)| {
                (!held[i])
                    .then(|| self.sensitivity(problem, i, bounds[i].1, step))
                    .flatten()
            })
            .collect();
        self.steps = steps;
        columns
    }

    /// What a step of number `i` does; none where the simulation runs away.
    fn nudge(&self, problem: &Problem, i: usize, upper_bound: f64, step: f64) -> Option<Nudge> {
        let mut theta = self.theta.clone();
        let step = if theta[i] + step > upper_bound {
            -step
        } else {
            step
        };
        theta[i] += step;
        let simulated = self.structure.simulate(&theta, problem.data)?;
        let change = difference(&simulated, &self.simulated);
        let size = problem.size(&change);
        Some(Nudge { step, change, size })
    }

    /// Change of the simulation with number `i`, whose difference step adapts; `None` where it moves nothing.
    fn sensitivity(
        &self,
        problem: &Problem,
        i: usize,
        upper_bound: f64,
        step: &mut f64,
    ) -> Option<Series> {
        for _ in 0..4 {
            let Some(nudge) = self.nudge(problem, i, upper_bound, *step) else {
                *step = (*step * 1e-2).max(SMALLEST_STEP);
                continue;
            };
            if nudge.size == 0.0 {
                *step = (*step * 1e3).min(LARGEST_STEP);
                continue;
            }
            *step = (*step * (STEP_SHARE / nudge.size).clamp(1e-4, 1e4))
                .clamp(SMALLEST_STEP, LARGEST_STEP);
            if (STEP_SHARE / 30.0..=30.0 * STEP_SHARE).contains(&nudge.size) {
                return Some(nudge.slope());
            }
        }
        None
    }

    /// Change of the simulation per number `i` over a step about as large as the number is uncertain. Small steps do not
    /// tell where a law sticks or slips: the outputs jump where it decides otherwise.
    pub(super) fn secant(&self, problem: &Problem, i: usize) -> Option<Series> {
        let upper_bound = self.structure.bounds()[i].1;
        // What a standard deviation of one number moves.
        let wanted = (problem.mean_square(&self.residual) / problem.count().max(1) as f64).sqrt();
        let mut step = 0.3 * self.theta[i].abs().max(self.steps[i]);
        let mut last: Option<Nudge> = None;
        for _ in 0..SECANTS {
            let nudge = self.nudge(problem, i, upper_bound, step);
            step /= 3.0;
            let Some(nudge) = nudge else { continue };
            // A third of the step that moves as much as before is one of those jumps.
            let jumps = last
                .as_ref()
                .is_some_and(|before| nudge.size > 0.6 * before.size);
            if nudge.size == 0.0 || jumps {
                break;
            }
            let small = nudge.size <= wanted;
            last = Some(nudge);
            if small {
                break;
            }
        }
        last.map(Nudge::slope)
    }
}
