//! How far a number can move before the recording objects, where its slope does not say.
//!
//! The covariance comes from slopes at the optimum. Where two columns of slopes fall together there (the zero of a plant
//! and that of a delay between two samples, say) it is next to infinite, although a little further on the recording
//! objects clearly. So it is asked one standard deviation away, and where the deviance has risen by far more than the one
//! that it ought to, the profile of the likelihood takes its place: all other numbers fitted again, up to a rise of one
//! (Venzon and Moolgavkar 1988).

use std::ops::Range;

use nalgebra::DMatrix;

use super::{Effort, Fit, Problem};

/// Rise of the deviance one standard deviation away from which the linearisation is not believed: that of three.
const OBJECTION: f64 = 9.0;
/// Doublings from the first step of a profile to the linearised standard deviation.
const DOUBLINGS: i32 = 12;

impl Fit {
    /// Narrows the variances of the numbers `which` in `covariance` where the recording objects to them; correlations stay.
    pub(crate) fn narrow(
        &self,
        problem: &Problem,
        covariance: &mut DMatrix<f64>,
        which: Range<usize>,
    ) {
        for i in which {
            let std = covariance[(i, i)].max(0.0).sqrt();
            if std == 0.0 || !std.is_finite() || !self.objects(problem, covariance, i) {
                continue;
            }
            let sides: Vec<f64> = [-1.0, 1.0]
                .into_iter()
                .filter_map(|side| self.reach(problem, i, side, std))
                .collect();
            if sides.is_empty() {
                continue;
            }
            let ratio = sides.iter().sum::<f64>() / (sides.len() as f64 * std);
            if ratio < 1.0 {
                covariance.row_mut(i).scale_mut(ratio);
                covariance.column_mut(i).scale_mut(ratio);
            }
        }
    }

    /// Whether one standard deviation of number `i`, with all that moves along, is too much on either side.
    fn objects(&self, problem: &Problem, covariance: &DMatrix<f64>, i: usize) -> bool {
        let std = covariance[(i, i)].sqrt();
        let base = self.noise.deviance(&self.residual, &problem.mask);
        [-1.0, 1.0].into_iter().any(|side| {
            let moved: Vec<f64> = self
                .theta
                .iter()
                .zip(covariance.column(i).iter())
                .map(|(theta, c)| theta + side * c / std)
                .collect();
            let bounds = self.structure.bounds();
            let inside = moved
                .iter()
                .zip(&bounds)
                .all(|(v, (low, high))| low <= v && v <= high);
            // Beyond a bound nothing is known; the profile ends there.
            !inside
                || self
                    .structure
                    .simulate(&moved, problem.data)
                    .is_none_or(|simulated| {
                        let residual = problem.data.residual(&simulated);
                        self.noise.deviance(&residual, &problem.mask) - base > OBJECTION
                    })
        })
    }

    /// How far number `i` goes to one side until the deviance has risen by one, or to `most`; `None` where a bound comes
    /// first.
    pub(super) fn reach(&self, problem: &Problem, i: usize, side: f64, most: f64) -> Option<f64> {
        let bounds = self.structure.bounds();
        let base = self.noise.deviance(&self.residual, &problem.mask);
        // Roots, because the deviance is a parabola where all is well.
        let (mut near, mut risen) = (0.0, 0.0);
        let mut fit = self.clone();
        for doubling in (0..=DOUBLINGS).rev() {
            let far = most * 0.5_f64.powi(doubling);
            let value = self.theta[i] + side * far;
            if value < bounds[i].0 || value > bounds[i].1 {
                return None;
            }
            let now = match fit.held_at(problem, i, value) {
                Some(held) => {
                    fit = held;
                    let deviance = self.noise.deviance(&fit.residual, &problem.mask);
                    (deviance - base).max(0.0).sqrt()
                }
                // It runs away: further than the recording allows.
                None => return Some(0.5 * (near + far)),
            };
            if now >= 1.0 {
                return Some(near + (far - near) * (1.0 - risen) / (now - risen));
            }
            (near, risen) = (far, now);
        }
        Some(most)
    }

    /// The fit of all other numbers with number `i` at `value`, under the same noise.
    fn held_at(&self, problem: &Problem, i: usize, value: f64) -> Option<Self> {
        let mut fit = self.clone();
        fit.theta[i] = value;
        fit.simulated = fit.structure.simulate(&fit.theta, problem.data)?;
        fit.residual = problem.data.residual(&fit.simulated);
        let noise = self.noise.clone();
        fit.descend(problem, &noise, Effort::FINAL, Some(i));
        Some(fit)
    }
}
