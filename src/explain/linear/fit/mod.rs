//! Levenberg and Marquardt on the whitened simulation error.
//!
//! Tails are met by iterated weights (Student's t), the noise model is estimated anew between rounds.

mod change_time;
mod finite_differences;
mod fit_covariance;
mod gauss_newton;
mod profile_likelihood;
#[cfg(test)]
mod tests;

use nalgebra::DVector;

use self::gauss_newton::Jacobian;
use super::data::{Data, Series};
use super::model::structure::Structure;
use crate::noise::{Colours, Mask, Noise, sum_of_squares};

/// How hard a fit tries.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Effort {
    /// Rounds of noise estimation.
    pub(crate) rounds: usize,
    /// Sets of derivatives a round: they are what costs.
    pub(crate) derivatives: usize,
    /// Steps that are made with one set before it is taken anew.
    pub(crate) steps_each: usize,
    /// Whether a set is updated from what each step has shown: far from the optimum it changes quickly.
    pub(crate) updates: bool,
    /// The deviance has settled when a step lowers it by less.
    pub(crate) settled: f64,
}

impl Effort {
    /// To see whether a candidate leads anywhere.
    pub(crate) const GLANCE: Self = Self {
        derivatives: 1,
        ..Self::SCOUT
    };
    /// To see what deserves more.
    pub(crate) const SCOUT: Self = Self {
        rounds: 1,
        derivatives: 2,
        steps_each: 4,
        updates: true,
        settled: 0.5,
    };
    /// To rank candidates.
    pub(crate) const RANK: Self = Self {
        rounds: 2,
        derivatives: 7,
        steps_each: 4,
        updates: true,
        settled: 0.1,
    };
    /// To report.
    pub(crate) const FINAL: Self = Self {
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
    pub(crate) data: &'a Data,
    pub(crate) mask: Mask,
    pub(crate) scale: Vec<f64>,
    /// Which noise models are tried.
    pub(crate) colours: Colours,
}

impl<'a> Problem<'a> {
    /// All samples count.
    pub(crate) fn new(data: &'a Data) -> Self {
        let mask = data
            .outputs_as_series()
            .map(|y| vec![true; y.len()])
            .collect();
        Self {
            data,
            mask,
            scale: data.output_scale(),
            colours: Colours::All,
        }
    }

    /// Values that count.
    pub(crate) fn count(&self) -> usize {
        self.mask.iter().flatten().filter(|keep| **keep).count()
    }

    /// Root mean square of a simulated change, in standard deviations of the outputs.
    pub(crate) fn size(&self, change: &Series) -> f64 {
        let (mut sum, mut n) = (0.0, 0usize);
        for (s, change) in change.iter().enumerate() {
            sum += sum_of_squares(change) / self.scale[s % self.scale.len()].powi(2);
            n += change.len();
        }
        (sum / n.max(1) as f64).sqrt()
    }

    /// Mean square of a residual over the values that count, in variances of the outputs.
    pub(crate) fn mean_square(&self, residual: &Series) -> f64 {
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
    pub(crate) fn noise(&self, residual: &Series) -> Noise {
        Noise::estimate(residual, self.data.outputs, &self.mask, self.colours)
    }
}

/// A structure with its best numbers.
#[derive(Debug, Clone)]
pub(crate) struct Fit {
    pub(crate) structure: Structure,
    pub(crate) theta: Vec<f64>,
    pub(crate) noise: Noise,
    /// `-2 log` likelihood under its own noise model.
    pub(crate) deviance: f64,
    /// Free numbers of the structure and its noise model.
    pub(crate) free: usize,
    pub(crate) simulated: Series,
    pub(crate) residual: Series,
    pub(crate) steps: Vec<f64>,
}

impl Fit {
    /// Schwarz's criterion: smaller is better.
    pub(crate) fn criterion(&self, count: usize) -> f64 {
        self.deviance + (self.free as f64) * (count.max(2) as f64).ln()
    }

    /// Becomes `other` if that has the lesser criterion.
    pub(crate) fn better_of(&mut self, other: Self, count: usize) {
        if other.criterion(count) < self.criterion(count) {
            *self = other;
        }
    }

    /// Simulates the structure at `theta` and takes its noise model, without any fitting.
    pub(crate) fn at(problem: &Problem, structure: Structure, theta: Vec<f64>) -> Option<Self> {
        let simulated = structure.simulate(&theta, problem.data)?;
        let residual = problem.data.residual(&simulated);
        let noise = problem.noise(&residual);
        Some(Self::under(
            problem, structure, theta, noise, simulated, residual,
        ))
    }

    /// The fit of these numbers, whose simulation and residual are known, under `noise`.
    fn under(
        problem: &Problem,
        structure: Structure,
        theta: Vec<f64>,
        noise: Noise,
        simulated: Series,
        residual: Series,
    ) -> Self {
        Self {
            deviance: noise.deviance(&residual, &problem.mask),
            free: structure.free_len() + noise.len(),
            steps: finite_differences::first_steps(&theta),
            structure,
            theta,
            noise,
            simulated,
            residual,
        }
    }

    /// Fits all free numbers from `theta` on. `start` is the noise model of the first round; without it that of the
    /// residual at the start, white.
    pub(crate) fn run(
        problem: &Problem,
        structure: Structure,
        theta: Vec<f64>,
        start: Option<&Noise>,
        effort: Effort,
    ) -> Option<Self> {
        let simulated = structure.simulate(&theta, problem.data)?;
        let residual = problem.data.residual(&simulated);
        let noise = match start {
            Some(start) => start.clone(),
            None => Noise::white(&residual, problem.data.outputs, &problem.mask),
        };
        Self::under(problem, structure, theta, noise, simulated, residual).improved(problem, effort)
    }

    /// The fit of all free numbers that begins with those of this one, and with its noise model.
    pub(crate) fn improved(&self, problem: &Problem, effort: Effort) -> Option<Self> {
        let mut fit = self.clone();
        let rounds = if fit.theta.is_empty() {
            1
        } else {
            effort.rounds
        };
        let mut best: Option<Self> = None;
        for _ in 0..rounds {
            let noise = fit.noise.clone();
            fit.descend(problem, &noise, effort, None);
            fit.noise = problem.noise(&fit.residual);
            fit.deviance = fit.noise.deviance(&fit.residual, &problem.mask);
            fit.free = fit.structure.free_len() + fit.noise.len();
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

    /// Steps at a fixed noise model while they help, number `held` left where it is. Derivatives serve several steps: near
    /// the optimum they hardly change, and they are what costs.
    fn descend(&mut self, problem: &Problem, noise: &Noise, effort: Effort, held: Option<usize>) {
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
                let mut slopes = self.sensitivities(problem);
                if let Some(held) = held {
                    slopes[held] = None;
                }
                jacobian = Jacobian::new(problem, noise, &slopes);
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
}
