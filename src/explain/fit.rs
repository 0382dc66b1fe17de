//! Levenberg and Marquardt on the whitened simulation error.
//!
//! Derivatives are forward differences whose steps adapt until they move the simulation by a fixed share of its size:
//! parameters differ by ten decades in scale, and most laws are not smooth everywhere. Tails are met by iterated
//! weights (Student's t), the noise model is estimated anew between rounds.

#[cfg(test)]
mod tests;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::data::{Data, Series, difference};
use super::noise::{MOST_ORDER, Mask, Noise, extend_with_kept, kept, sum_of_squares};
use super::structure::Structure;
use crate::linalg::multiply_tn;

/// A difference step should move the outputs by this share of their standard deviation.
const STEP_SHARE: f64 = 1e-5;
/// Steps stay between these, whatever the outputs do.
const SMALLEST_STEP: f64 = 1e-30;
const LARGEST_STEP: f64 = 1e30;

/// Steps that are tried for a secant, each a third of the one before: down to 1e-7 of the number.
const SECANTS: usize = 14;

/// How hard a fit tries.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Effort {
    /// Rounds of noise estimation.
    pub rounds: usize,
    /// Sets of derivatives a round: they are what costs.
    pub derivatives: usize,
    /// Steps that are made with one set before it is taken anew.
    pub steps_each: usize,
    /// Whether a set is updated from what each step has shown: far from the optimum it changes quickly.
    pub updates: bool,
    /// The deviance has settled when a step lowers it by less.
    pub settled: f64,
}

impl Effort {
    /// To see what deserves more.
    pub const SCOUT: Self = Self {
        rounds: 1,
        derivatives: 3,
        steps_each: 4,
        updates: true,
        settled: 0.5,
    };
    /// To rank candidates.
    pub const RANK: Self = Self {
        rounds: 2,
        derivatives: 7,
        steps_each: 4,
        updates: true,
        settled: 0.1,
    };
    /// To report.
    pub const FINAL: Self = Self {
        rounds: 3,
        derivatives: 20,
        steps_each: 2,
        updates: false,
        settled: 0.02,
    };
}

/// What fits share: the data, which samples count, how the outputs are scaled.
#[derive(Debug, Clone)]
pub(crate) struct Problem<'a> {
    pub data: &'a Data,
    pub mask: Mask,
    pub scale: Vec<f64>,
    /// Largest order of the noise model.
    pub noise_order: usize,
}

impl<'a> Problem<'a> {
    /// All samples count but the first few, from which a whitening filter starts.
    pub fn new(data: &'a Data) -> Self {
        let mask = data
            .outputs_as_series()
            .map(|y| (0..y.len()).map(|k| k >= MOST_ORDER).collect())
            .collect();
        Self {
            data,
            mask,
            scale: data.output_scale(),
            noise_order: MOST_ORDER,
        }
    }

    /// Values that count.
    pub fn count(&self) -> usize {
        self.mask.iter().flatten().filter(|keep| **keep).count()
    }

    /// Root mean square of a simulated change, in standard deviations of the outputs.
    pub fn size(&self, change: &Series) -> f64 {
        let (mut sum, mut n) = (0.0, 0usize);
        for (s, change) in change.iter().enumerate() {
            sum += sum_of_squares(change) / self.scale[s % self.scale.len()].powi(2);
            n += change.len();
        }
        (sum / n.max(1) as f64).sqrt()
    }

    /// Mean square of a residual over the values that count, in variances of the outputs.
    pub fn mean_square(&self, residual: &Series) -> f64 {
        let (mut sum, mut n) = (0.0, 0usize);
        for (s, (residual, mask)) in residual.iter().zip(&self.mask).enumerate() {
            let scale = self.scale[s % self.scale.len()];
            for (e, _) in residual.iter().zip(mask).filter(|(_, keep)| **keep) {
                sum += (e / scale).powi(2);
                n += 1;
            }
        }
        sum / n.max(1) as f64
    }

    /// Noise model of a residual.
    pub fn noise(&self, residual: &Series) -> Noise {
        Noise::estimate(residual, self.data.outputs, &self.mask, self.noise_order)
    }
}

/// A structure with its best numbers.
#[derive(Debug, Clone)]
pub(crate) struct Fit {
    pub structure: Structure,
    pub theta: Vec<f64>,
    pub noise: Noise,
    /// `-2 log` likelihood under its own noise model.
    pub deviance: f64,
    /// Free numbers of the structure and its noise model.
    pub free: usize,
    pub simulated: Series,
    pub residual: Series,
    pub steps: Vec<f64>,
}

impl Fit {
    /// Schwarz's criterion: smaller is better.
    pub fn criterion(&self, count: usize) -> f64 {
        self.deviance + (self.free as f64) * (count.max(2) as f64).ln()
    }

    /// Becomes `other` if that has the lesser criterion.
    pub fn better_of(&mut self, other: Self, count: usize) {
        if other.criterion(count) < self.criterion(count) {
            *self = other;
        }
    }

    /// Simulates the structure at `theta` and takes its noise model, without any fitting.
    pub fn at(problem: &Problem, structure: Structure, theta: Vec<f64>) -> Option<Self> {
        let simulated = structure.simulate(&theta, problem.data)?;
        let residual = problem.data.residual(&simulated);
        let noise = problem.noise(&residual);
        let deviance = noise.deviance(&residual, &problem.mask);
        let free = structure.len() + noise.len();
        let steps = first_steps(&theta);
        Some(Self {
            structure,
            theta,
            noise,
            deviance,
            free,
            simulated,
            residual,
            steps,
        })
    }

    /// Fits all free numbers from `theta` on. `start` is the noise model of the first round; without it that of the
    /// residual at the start, white.
    pub fn run(
        problem: &Problem,
        structure: Structure,
        theta: Vec<f64>,
        start: Option<&Noise>,
        effort: Effort,
    ) -> Option<Self> {
        let mut fit = Self::at(problem, structure, theta)?;
        fit.noise = match start {
            Some(start) => start.clone(),
            None => Noise::white(&fit.residual, problem.data.outputs, &problem.mask),
        };
        fit.improved(problem, effort)
    }

    /// The fit of all free numbers that begins with those of this one, and with its noise model.
    pub fn improved(&self, problem: &Problem, effort: Effort) -> Option<Self> {
        let mut fit = self.clone();
        let rounds = if fit.theta.is_empty() {
            1
        } else {
            effort.rounds
        };
        let mut best: Option<Self> = None;
        for _ in 0..rounds {
            let noise = fit.noise.clone();
            fit.descend(problem, &noise, effort);
            fit.noise = problem.noise(&fit.residual);
            fit.deviance = fit.noise.deviance(&fit.residual, &problem.mask);
            fit.free = fit.structure.len() + fit.noise.len();
            let settled = best
                .as_ref()
                .is_some_and(|b| (b.deviance - fit.deviance).abs() < 0.2);
            if best.as_ref().is_none_or(|b| fit.deviance < b.deviance) {
                best = Some(fit.clone());
            }
            if settled {
                break;
            }
        }
        best
    }

    /// Steps at a fixed noise model while they help. Derivatives serve several steps: near the optimum they hardly
    /// change, and they are what costs.
    fn descend(&mut self, problem: &Problem, noise: &Noise, effort: Effort) {
        let bounds = self.structure.bounds();
        let mut damping = 1e-3;
        let mut cost = noise.deviance(&self.residual, &problem.mask);
        let mut jacobian: Option<Jacobian> = None;
        let mut age = 0;
        let mut taken = 0;
        loop {
            if age >= effort.steps_each {
                jacobian = None;
            }
            let fresh = jacobian.is_none();
            if fresh {
                if taken == effort.derivatives {
                    return;
                }
                taken += 1;
                age = 0;
                jacobian = self.jacobian(problem, noise);
            }
            let Some(derivatives) = &jacobian else {
                return;
            };
            let system = derivatives.normal_equations(problem, noise, &self.residual, None);
            let mut gained = None;
            let mut made = None;
            for _ in 0..if fresh { 8 } else { 1 } {
                let Some(step) = system.step(damping) else {
                    damping *= 10.0;
                    continue;
                };
                let trial: Vec<f64> = self
                    .theta
                    .iter()
                    .zip(step.iter())
                    .zip(&bounds)
                    .map(|((t, s), (lo, hi))| (t + s).clamp(*lo, *hi))
                    .collect();
                if let Some(simulated) = self.structure.simulate(&trial, problem.data) {
                    let residual = problem.data.residual(&simulated);
                    let now = noise.deviance(&residual, &problem.mask);
                    if now < cost {
                        gained = Some(cost - now);
                        // A bound may have cut the step short.
                        let moved = DVector::from_iterator(
                            trial.len(),
                            trial.iter().zip(&self.theta).map(|(t, was)| t - was),
                        );
                        made = Some((moved, std::mem::replace(&mut self.simulated, simulated)));
                        self.theta = trial;
                        self.residual = residual;
                        cost = now;
                        damping = (damping * 0.2).max(1e-9);
                        break;
                    }
                }
                if fresh {
                    damping *= 8.0;
                }
                if damping > 1e8 {
                    return;
                }
            }
            age += 1;
            if let (true, Some(derivatives), Some((step, before))) =
                (effort.updates, &mut jacobian, made)
            {
                derivatives.update(problem, noise, &step, &before, &self.simulated);
            }
            match gained {
                Some(gained) if gained >= effort.settled => {}
                // Little or nothing: the end with new derivatives, else a reason to take them anew.
                _ if fresh => return,
                _ => age = effort.steps_each,
            }
        }
    }

    /// Change of the simulation with each number: a series a number, and none for one that moves nothing.
    pub fn sensitivities(&mut self, problem: &Problem) -> Vec<Option<Series>> {
        let bounds = self.structure.bounds();
        let mut steps = std::mem::take(&mut self.steps);
        let columns = steps
            .par_iter_mut()
            .with_max_len(1)
            .enumerate()
            .map(|(i, step)| self.sensitivity(problem, i, bounds[i].1, step))
            .collect();
        self.steps = steps;
        columns
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
            let mut moved = self.theta.clone();
            // Forward, or backward from an upper bound.
            let made = if moved[i] + *step > upper_bound {
                -*step
            } else {
                *step
            };
            moved[i] += made;
            let Some(simulated) = self.structure.simulate(&moved, problem.data) else {
                *step = (*step * 1e-2).max(SMALLEST_STEP);
                continue;
            };
            let mut change = difference(&simulated, &self.simulated);
            let size = problem.size(&change);
            if size == 0.0 {
                *step = (*step * 1e3).min(LARGEST_STEP);
                continue;
            }
            let far = !(STEP_SHARE / 30.0..=30.0 * STEP_SHARE).contains(&size);
            *step =
                (*step * (STEP_SHARE / size).clamp(1e-4, 1e4)).clamp(SMALLEST_STEP, LARGEST_STEP);
            if far {
                continue;
            }
            for value in change.iter_mut().flatten() {
                *value /= made;
            }
            return Some(change);
        }
        None
    }

    /// Change of the simulation per number `i` over a step about as large as the number is uncertain. Small steps do not
    /// tell where a law sticks or slips: the outputs jump where it decides otherwise.
    fn secant(&self, problem: &Problem, i: usize) -> Option<Series> {
        let upper_bound = self.structure.bounds()[i].1;
        // What a standard deviation of one number moves.
        let wanted = (problem.mean_square(&self.residual) / problem.count().max(1) as f64).sqrt();
        let mut step = 0.3 * self.theta[i].abs().max(self.steps[i]);
        let mut last: Option<(f64, Series)> = None;
        for _ in 0..SECANTS {
            let mut moved = self.theta.clone();
            let made = if moved[i] + step > upper_bound {
                -step
            } else {
                step
            };
            moved[i] += made;
            step /= 3.0;
            let Some(simulated) = self.structure.simulate(&moved, problem.data) else {
                continue;
            };
            let mut change = difference(&simulated, &self.simulated);
            let size = problem.size(&change);
            if size == 0.0 {
                break;
            }
            // A third of the step that moves as much as before is one of those jumps.
            if last.as_ref().is_some_and(|(before, _)| size > 0.6 * before) {
                break;
            }
            for value in change.iter_mut().flatten() {
                *value /= made;
            }
            last = Some((size, change));
            if size <= wanted {
                break;
            }
        }
        last.map(|(_, slope)| slope)
    }

    /// Whitened derivatives of the values that count.
    fn jacobian(&mut self, problem: &Problem, noise: &Noise) -> Option<Jacobian> {
        let columns = self.sensitivities(problem);
        self.whitened(problem, noise, &columns)
    }

    /// Whitened `columns`, one a number, of the values that count.
    fn whitened(
        &self,
        problem: &Problem,
        noise: &Noise,
        columns: &[Option<Series>],
    ) -> Option<Jacobian> {
        let rows: usize = problem.count();
        let used: Vec<usize> = (0..columns.len())
            .filter(|i| columns[*i].is_some())
            .collect();
        if used.is_empty() {
            return None;
        }
        let mut flat = Vec::with_capacity(rows * used.len());
        for column in columns.iter().flatten() {
            for (series, mask) in noise.whiten(column).iter().zip(&problem.mask) {
                extend_with_kept(&mut flat, series, mask);
            }
        }
        flat.iter().all(|v| v.is_finite()).then(|| Jacobian {
            columns: DMatrix::from_vec(rows, used.len(), flat),
            used,
            total: self.theta.len(),
        })
    }

    /// How well the numbers are known.
    pub fn certainty(&mut self, problem: &Problem) -> Option<Certainty> {
        let noise = self.noise.clone();
        let mut columns = self.sensitivities(problem);
        for (i, column) in columns.iter_mut().enumerate() {
            if column.is_none() {
                *column = self.secant(problem, i);
            }
        }
        let jacobian = self.whitened(problem, &noise, &columns)?;
        let first: Vec<bool> = problem
            .mask
            .iter()
            .flat_map(|mask| {
                let n = mask.len();
                mask.iter()
                    .enumerate()
                    .filter_map(move |(k, keep)| keep.then_some(2 * k < n))
            })
            .collect();
        let second: Vec<bool> = first.iter().map(|first| !first).collect();
        let half = |rows: &[bool]| {
            let system = jacobian.normal_equations(problem, &noise, &self.residual, Some(rows));
            Some((system.step(0.0)?, system.covariance()?))
        };
        let halves = half(&first).zip(half(&second));
        Some(Certainty {
            covariance: jacobian
                .normal_equations(problem, &noise, &self.residual, None)
                .covariance()?,
            halves_disagree: halves.map(|((a, va), (b, vb))| {
                (0..self.theta.len())
                    .map(|i| {
                        let variance = va[(i, i)] + vb[(i, i)];
                        if variance > 0.0 {
                            (a[i] - b[i]).abs() / variance.sqrt()
                        } else {
                            0.0
                        }
                    })
                    .collect()
            }),
        })
    }
}

/// How well the numbers of a fit are known.
#[derive(Debug, Clone)]
pub(crate) struct Certainty {
    /// Covariance of the numbers; those that move nothing have none.
    pub covariance: DMatrix<f64>,
    /// How far the two halves of the recordings disagree about each number, in standard deviations of the difference:
    /// one Gauss-Newton step of each half from the common optimum, which is as good as a fit of each (one-step
    /// estimation, Le Cam 1956). Numbers that move nothing disagree by zero. None where a half does not determine all.
    pub halves_disagree: Option<Vec<f64>>,
}

/// Whitened derivatives, a column a number that moves anything.
struct Jacobian {
    columns: DMatrix<f64>,
    used: Vec<usize>,
    total: usize,
}

impl Jacobian {
    /// Broyden's (1965) least change, each number on the scale of its own column, after which the derivatives foretell
    /// what `step` has just done.
    fn update(
        &mut self,
        problem: &Problem,
        noise: &Noise,
        step: &DVector<f64>,
        before: &Series,
        after: &Series,
    ) {
        let change = difference(after, before);
        let missed = kept(&noise.whiten(&change), &problem.mask);
        let step = DVector::from_iterator(self.used.len(), self.used.iter().map(|i| step[*i]));
        let missed = DVector::from_vec(missed) - &self.columns * &step;
        let along: Vec<f64> = self
            .columns
            .column_iter()
            .zip(step.iter())
            .map(|(column, s)| column.norm_squared() * s)
            .collect();
        let length: f64 = along.iter().zip(step.iter()).map(|(a, s)| a * s).sum();
        if length > 0.0 && length.is_finite() {
            for (mut column, a) in self.columns.column_iter_mut().zip(along) {
                column.axpy(a / length, &missed, 1.0);
            }
        }
    }

    /// The weighted least-squares system at `residual`, of all rows or of those that `only` lets pass.
    fn normal_equations(
        &self,
        problem: &Problem,
        noise: &Noise,
        residual: &Series,
        only: Option<&[bool]>,
    ) -> NormalEquations {
        let rows = self.columns.nrows();
        let e = kept(&noise.whiten(residual), &problem.mask);
        let mut weights: Vec<f64> = e.iter().map(|e| noise.weight(*e)).collect();
        for (weight, pass) in weights.iter_mut().zip(only.unwrap_or_default()) {
            if !pass {
                *weight = 0.0;
            }
        }
        let target = DVector::from_iterator(rows, e.iter().zip(&weights).map(|(e, w)| e * w));
        let hessian = if noise.degrees.is_finite() || only.is_some() {
            let mut weighted = self.columns.clone();
            for mut column in weighted.column_iter_mut() {
                for (v, w) in column.iter_mut().zip(&weights) {
                    *v *= w;
                }
            }
            multiply_tn(&self.columns, &weighted)
        } else {
            multiply_tn(&self.columns, &self.columns)
        };
        NormalEquations {
            hessian,
            gradient: self.columns.tr_mul(&target),
            used: self.used.clone(),
            total: self.total,
        }
    }
}

struct NormalEquations {
    hessian: DMatrix<f64>,
    gradient: DVector<f64>,
    used: Vec<usize>,
    total: usize,
}

impl NormalEquations {
    /// Inverse of the curvature, for all numbers.
    fn covariance(&self) -> Option<DMatrix<f64>> {
        let m = self.used.len();
        let scale: Vec<f64> = (0..m)
            .map(|i| self.hessian[(i, i)].sqrt().max(1e-300))
            .collect();
        let mut scaled = self.hessian.clone();
        for i in 0..m {
            for j in 0..m {
                scaled[(i, j)] /= scale[i] * scale[j];
            }
            scaled[(i, i)] += 1e-12;
        }
        let inverse = scaled.cholesky()?.inverse();
        let mut covariance = DMatrix::zeros(self.total, self.total);
        for (i, &a) in self.used.iter().enumerate() {
            for (j, &b) in self.used.iter().enumerate() {
                covariance[(a, b)] = inverse[(i, j)] / (scale[i] * scale[j]);
            }
        }
        Some(covariance)
    }

    /// The damped step, in units of each number's own curvature.
    fn step(&self, damping: f64) -> Option<DVector<f64>> {
        let m = self.used.len();
        let scale: Vec<f64> = (0..m)
            .map(|i| self.hessian[(i, i)].sqrt().max(1e-300))
            .collect();
        let mut h = self.hessian.clone();
        for i in 0..m {
            for j in 0..m {
                h[(i, j)] /= scale[i] * scale[j];
            }
            h[(i, i)] += damping + 1e-12;
        }
        let g = DVector::from_iterator(m, (0..m).map(|i| self.gradient[i] / scale[i]));
        let solved = h.cholesky()?.solve(&g);
        let mut step = DVector::zeros(self.total);
        for (i, &at) in self.used.iter().enumerate() {
            step[at] = solved[i] / scale[i];
        }
        step.iter().all(|v| v.is_finite()).then_some(step)
    }
}

/// First guesses of the difference steps; they adapt.
fn first_steps(theta: &[f64]) -> Vec<f64> {
    theta.iter().map(|v| (v.abs() * 1e-5).max(1e-7)).collect()
}
