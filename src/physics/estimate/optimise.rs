//! Levenberg and Marquardt's method within bounds: the one optimiser of plants in equations.

use nalgebra::{DMatrix, DVector};

/// A sum of squares, or a deviance that is one locally.
pub(super) trait Objective {
    /// `-2 log` likelihood at a point and what its derivatives need; none where the plant cannot be simulated.
    fn deviance(&mut self, point: &[f64]) -> Option<f64>;
    /// Curvature (half the Hessian's Gauss-Newton part) and descent direction (minus half the gradient) at the point that was
    /// accepted last.
    fn curvature(&mut self, point: &[f64]) -> Option<(DMatrix<f64>, DVector<f64>)>;
    /// Whether curvature and descent are approximate.
    fn approximate(&self) -> bool {
        false
    }
    /// Makes them exact from now on; false where nothing changes.
    fn refine(&mut self) -> bool {
        false
    }
}

/// Bounds of a free number, and a magnitude for one whose value is 0.
#[derive(Debug, Clone, Copy)]
pub(super) struct Range {
    pub(super) min: f64,
    pub(super) max: f64,
    /// The largest change in one step.
    pub(super) reach: f64,
}

impl Range {
    /// Of a number that stays where it is.
    pub(super) fn held(at: f64) -> Self {
        Self {
            min: at,
            max: at,
            reach: 0.0,
        }
    }
}

/// When to stop.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Effort {
    pub(crate) iterations: usize,
    /// Decrease of the deviance below which the search ends.
    pub(crate) settled: f64,
    /// Attempts at one step.
    pub(crate) attempts: usize,
}

/// Added to a curvature of 1: what the data do not determine stays where it is.
pub(super) const RIDGE: f64 = 1e-10;
/// First damping, and the factors by which it falls and grows.
const DAMPING: f64 = 1e-3;
const LESS: f64 = 0.2;
const MORE: f64 = 5.0;
/// ... with approximate derivatives: where these lead nowhere, exact ones are better than more damping.
const APPROXIMATE_ATTEMPTS: usize = 3;
/// Attempts at one step of a search that should end at a minimum.
pub(crate) const ATTEMPTS: usize = 12;

/// Improves `point`; gives its deviance, or none when even the start cannot be simulated.
pub(super) fn minimise(
    objective: &mut dyn Objective,
    point: &mut Vec<f64>,
    ranges: &[Range],
    effort: Effort,
) -> Option<f64> {
    let mut deviance = objective.deviance(point)?;
    let mut damping = DAMPING;
    for _ in 0..effort.iterations {
        let Some((curvature, descent)) = objective.curvature(point) else {
            break;
        };
        let before = deviance;
        let mut moved = false;
        let attempts = if objective.approximate() {
            effort.attempts.min(APPROXIMATE_ATTEMPTS)
        } else {
            effort.attempts
        };
        for _ in 0..attempts {
            let Some(step) = step(&curvature, &descent, point, ranges, damping) else {
                damping *= MORE;
                continue;
            };
            let trial: Vec<f64> = (point.iter().zip(&step).zip(ranges))
                .map(|((p, s), r)| (p + s).clamp(r.min, r.max))
                .collect();
            let foretold = foretold(&curvature, &descent, point, &trial);
            // Several numbers at their limits together may lead uphill; a shorter step does not.
            if foretold < 0.0 {
                damping *= MORE;
                continue;
            }
            if trial == *point || foretold < effort.settled {
                break;
            }
            match objective.deviance(&trial) {
                Some(now) if now < deviance => {
                    *point = trial;
                    deviance = now;
                    damping = (damping * LESS).max(1e-12);
                    moved = true;
                    break;
                }
                _ => damping *= MORE,
            }
        }
        if !moved || before - deviance < effort.settled {
            if !objective.refine() {
                break;
            }
            damping = DAMPING;
        }
    }
    // The objective must stand at the point that is given back.
    objective.deviance(point).or(Some(deviance))
}

/// Decrease of the deviance that the quadratic model foretells.
fn foretold(curvature: &DMatrix<f64>, descent: &DVector<f64>, from: &[f64], to: &[f64]) -> f64 {
    let step = DVector::from_iterator(from.len(), to.iter().zip(from).map(|(t, f)| t - f));
    2.0 * descent.dot(&step) - step.dot(&(curvature * &step))
}

/// The damped step. What is at a bound and would leave it is held there, and nothing moves further than its reach.
fn step(
    curvature: &DMatrix<f64>,
    descent: &DVector<f64>,
    point: &[f64],
    ranges: &[Range],
    damping: f64,
) -> Option<Vec<f64>> {
    let mut free: Vec<usize> = (0..point.len())
        .filter(|&i| {
            let (p, r, d) = (point[i], &ranges[i], descent[i]);
            !(p <= r.min && d <= 0.0 || p >= r.max && d >= 0.0) && curvature[(i, i)] > 0.0
        })
        .collect();
    let mut step = vec![0.0; point.len()];
    // A step that meets a limit ends there, and the others are found again for it.
    for _ in 0..=point.len() {
        if free.is_empty() {
            return Some(step);
        }
        let scale: Vec<f64> = free.iter().map(|&i| curvature[(i, i)].sqrt()).collect();
        let m = free.len();
        let matrix = DMatrix::from_fn(m, m, |a, b| {
            let c = curvature[(free[a], free[b])] / (scale[a] * scale[b]);
            c + if a == b { damping + RIDGE } else { 0.0 }
        });
        let held: Vec<usize> = (0..point.len())
            .filter(|i| step[*i] != 0.0 && !free.contains(i))
            .collect();
        let right = DVector::from_fn(m, |a, _| {
            let known: f64 = held
                .iter()
                .map(|&j| curvature[(free[a], j)] * step[j])
                .sum();
            (descent[free[a]] - known) / scale[a]
        });
        let solved = matrix.cholesky()?.solve(&right);
        let mut blocked = false;
        for (a, &i) in free.iter().enumerate() {
            step[i] = solved[a] / scale[a];
        }
        if !step.iter().all(|s| s.is_finite()) {
            return None;
        }
        for &i in &free.clone() {
            let range = &ranges[i];
            let reached = step[i].clamp(-range.reach, range.reach);
            let bounded = reached.clamp(range.min - point[i], range.max - point[i]);
            if bounded != step[i] {
                step[i] = bounded;
                free.retain(|&j| j != i);
                blocked = true;
            }
        }
        if !blocked {
            return Some(step);
        }
        free.iter().for_each(|&i| step[i] = 0.0);
    }
    Some(step)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sum of squares with its minimum 0 at `lowest`.
    struct Quadratic {
        curvature: DMatrix<f64>,
        lowest: DVector<f64>,
    }

    impl Objective for Quadratic {
        fn deviance(&mut self, point: &[f64]) -> Option<f64> {
            let from = DVector::from_row_slice(point) - &self.lowest;
            Some(from.dot(&(&self.curvature * &from)))
        }

        fn curvature(&mut self, point: &[f64]) -> Option<(DMatrix<f64>, DVector<f64>)> {
            let to = &self.lowest - DVector::from_row_slice(point);
            Some((self.curvature.clone(), &self.curvature * to))
        }
    }

    fn range(reach: f64) -> Range {
        Range {
            min: -10.0,
            max: 10.0,
            reach,
        }
    }

    #[test]
    fn what_does_not_meet_a_limit_is_found_again_for_what_does() {
        let curvature = DMatrix::from_row_slice(2, 2, &[2.0, 1.0, 1.0, 2.0]);
        let lowest = DVector::from_row_slice(&[3.0, -1.0]);
        let descent = &curvature * &lowest;
        let at = |range: Range| {
            step(
                &curvature,
                &descent,
                &[0.0, 0.0],
                &[range, self::range(9.0)],
                0.0,
            )
            .unwrap()
        };
        let bounded = Range {
            max: 1.0,
            ..range(9.0)
        };
        for limited in [at(range(1.0)), at(bounded)] {
            assert!((limited[0] - 1.0).abs() < 1e-9, "{limited:?}");
            assert!(limited[1].abs() < 1e-9, "{limited:?}");
        }
        let free = at(range(9.0));
        assert!((free[0] - 3.0).abs() < 1e-8 && (free[1] + 1.0).abs() < 1e-8);
    }

    /// Both numbers meet their reach in the first step, (0.1, 1.9), which leads uphill.
    #[test]
    fn a_step_that_limits_turn_uphill_is_made_shorter() {
        let curvature = DMatrix::from_row_slice(2, 2, &[1.0, -0.9, -0.9, 1.0]);
        let lowest = DVector::from_row_slice(&[3.0, 2.0]);
        let descent = &curvature * &lowest;
        assert!(foretold(&curvature, &descent, &[0.0, 0.0], &[0.1, 1.9]) < 0.0);
        let mut objective = Quadratic { curvature, lowest };
        let mut point = vec![0.0, 0.0];
        let effort = Effort {
            iterations: 100,
            settled: 1e-12,
            attempts: ATTEMPTS,
        };
        let left = minimise(
            &mut objective,
            &mut point,
            &[range(0.1), range(1.9)],
            effort,
        );
        assert!(
            left.is_some_and(|left| left < 1e-6),
            "{left:?} at {point:?}"
        );
    }
}
