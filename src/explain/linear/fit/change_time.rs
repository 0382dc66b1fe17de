//! How certain the time of a change is.
//!
//! A time is chosen among samples, each of which speaks for or against it by itself: the likelihood over times is a random
//! walk with many summits (Hinkley 1970), and its curvature at the highest says nothing of the others. So all times about
//! it are asked, and what is stated is the root mean square distance under their posterior, a flat prior before.

use nalgebra::DMatrix;

use super::{Fit, Problem};

/// Times that are asked on either side.
const TIMES: i32 = 64;
/// How far they reach at first, in samples.
const FIRST_REACH: f64 = 32.0;
/// Share of the posterior in the outer half of the times from which they must reach further.
const OUTSIDE: f64 = 1e-3;

impl Fit {
    /// Replaces the variance of the time of change `at` in `covariance` by that of its posterior, the other numbers held;
    /// correlations stay.
    pub(crate) fn ask_all_times(
        &self,
        problem: &Problem,
        covariance: &mut DMatrix<f64>,
        at: usize,
    ) {
        let linearised = covariance[(at, at)].max(0.0).sqrt();
        let asked = self.spread_of_time(problem, at);
        let ratio = asked / linearised;
        if linearised > 0.0 && ratio.is_finite() {
            covariance.row_mut(at).scale_mut(ratio);
            covariance.column_mut(at).scale_mut(ratio);
        } else {
            // A time that no small step moves has no slopes, and no correlations with it.
            covariance[(at, at)] = asked * asked;
        }
    }

    /// Root mean square distance of the time `at` from where it is, over the posterior.
    fn spread_of_time(&self, problem: &Problem, at: usize) -> f64 {
        let step = problem.data.sample_time;
        let longest = problem.data.segments.iter().map(|s| s.samples());
        let longest = step * longest.max().unwrap_or(0) as f64;
        let base = self.noise.deviance(&self.residual, &problem.mask);
        let weight = |time: f64| {
            let mut theta = self.theta.clone();
            theta[at] = time;
            self.structure
                .simulate(&theta, problem.data)
                .map_or(0.0, |simulated| {
                    let residual = problem.data.residual(&simulated);
                    let risen = self.noise.deviance(&residual, &problem.mask) - base;
                    (-0.5 * risen).exp()
                })
        };
        let mut reach = FIRST_REACH * step;
        loop {
            let (mut sum, mut outer, mut squares) = (0.0, 0.0, 0.0);
            for i in -TIMES..=TIMES {
                let away = reach * f64::from(i) / f64::from(TIMES);
                let weight = weight(self.theta[at] + away);
                sum += weight;
                squares += weight * away * away;
                if 2 * i.abs() > TIMES {
                    outer += weight;
                }
            }
            if outer <= OUTSIDE * sum || reach >= longest {
                return (squares / sum).sqrt();
            }
            reach *= 2.0;
        }
    }
}
