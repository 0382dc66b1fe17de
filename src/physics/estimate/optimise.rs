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
            let trial: Vec<f64> = point
                .iter()
                .zip(&step)
                .zip(ranges)
                .map(|((p, s), r)| (p + s.clamp(-r.reach, r.reach)).clamp(r.min, r.max))
                .collect();
            if trial == *point || foretold(&curvature, &descent, point, &trial) < effort.settled {
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

/// The damped step. What is at a bound and would leave it is held there.
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
    // A step that meets a bound ends there, and the others are found again for it.
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
            let bounded = (point[i] + step[i]).clamp(ranges[i].min, ranges[i].max) - point[i];
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
