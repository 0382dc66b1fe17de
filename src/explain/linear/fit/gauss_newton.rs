//! Whitened derivatives, and the weighted least-squares system that they make.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::Problem;
use crate::explain::linear::data::{Series, difference};
use crate::linalg::multiply_tn;
use crate::noise::Noise;

/// Added to a curvature of one: numbers that do the same are held to the smallest change that does it.
const RIDGE: f64 = 1e-12;

/// Whitened derivatives of the values that count, a column a number that moves anything.
pub(super) struct Jacobian {
    columns: DMatrix<f64>,
    used: Vec<usize>,
    total: usize,
}

impl Jacobian {
    /// Of `slopes`, a series a number; none when no number moves anything.
    pub(crate) fn new(problem: &Problem, noise: &Noise, slopes: &[Option<Series>]) -> Option<Self> {
        let rows = problem.count();
        let used: Vec<usize> = (0..slopes.len()).filter(|i| slopes[*i].is_some()).collect();
        if used.is_empty() {
            return None;
        }
        let mut flat = Vec::with_capacity(rows * used.len());
        for slope in slopes.iter().flatten() {
            flat.extend(noise.whiten_kept(slope, &problem.mask));
        }
        flat.iter().all(|v| v.is_finite()).then(|| Self {
            columns: DMatrix::from_vec(rows, used.len(), flat),
            used,
            total: slopes.len(),
        })
    }

    /// Broyden's (1965) least change, each number on the scale of its own column, after which the derivatives foretell
    /// what `step` has just done.
    pub(crate) fn update(
        &mut self,
        problem: &Problem,
        noise: &Noise,
        step: &DVector<f64>,
        before: &Series,
        after: &Series,
    ) {
        let change = difference(after, before);
        let missed = noise.whiten_kept(&change, &problem.mask);
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

    /// The whitened columns, of the values that count.
    #[cfg(test)]
    pub(crate) fn columns(&self) -> &DMatrix<f64> {
        &self.columns
    }

    /// The weighted least-squares system at `residual`, of all rows or of those that `only` lets pass.
    pub(crate) fn normal_equations(
        &self,
        problem: &Problem,
        noise: &Noise,
        residual: &Series,
        only: Option<&[bool]>,
    ) -> NormalEquations {
        let rows = self.columns.nrows();
        let e = noise.whiten_kept(residual, &problem.mask);
        let mut weights: Vec<f64> = e.iter().map(|e| noise.weight(*e)).collect();
        for (weight, pass) in weights.iter_mut().zip(only.unwrap_or_default()) {
            if !pass {
                *weight = 0.0;
            }
        }
        let target = DVector::from_iterator(rows, e.iter().zip(&weights).map(|(e, w)| e * w));
        let mut curvature = if noise.degrees.is_finite() || only.is_some() {
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
        let mut gradient = self.columns.tr_mul(&target);
        let m = self.used.len();
        let scale: Vec<f64> = (0..m)
            // Of what moves nothing in these rows nothing is known: the ridge alone holds it.
            .map(|i| match curvature[(i, i)].sqrt() {
                scale if scale > 1e-140 => scale,
                _ => 1.0,
            })
            .collect();
        for i in 0..m {
            for j in 0..m {
                curvature[(i, j)] /= scale[i] * scale[j];
            }
            gradient[i] /= scale[i];
        }
        NormalEquations {
            curvature,
            gradient,
            scale,
            used: self.used.clone(),
            total: self.total,
        }
    }
}

/// Each number is in units of its own curvature, whose diagonal is therefore one.
pub(super) struct NormalEquations {
    curvature: DMatrix<f64>,
    gradient: DVector<f64>,
    scale: Vec<f64>,
    used: Vec<usize>,
    total: usize,
}

impl NormalEquations {
    fn factor(&self, damping: f64) -> Option<Cholesky<f64, Dyn>> {
        let mut damped = self.curvature.clone();
        for i in 0..self.used.len() {
            damped[(i, i)] += damping + RIDGE;
        }
        damped.cholesky()
    }

    /// Inverse of the curvature, for all numbers.
    pub(crate) fn covariance(&self) -> Option<DMatrix<f64>> {
        let inverse = self.factor(0.0)?.inverse();
        let mut covariance = DMatrix::zeros(self.total, self.total);
        for (i, &a) in self.used.iter().enumerate() {
            for (j, &b) in self.used.iter().enumerate() {
                covariance[(a, b)] = inverse[(i, j)] / (self.scale[i] * self.scale[j]);
            }
        }
        Some(covariance)
    }

    /// The damped step.
    pub(crate) fn step(&self, damping: f64) -> Option<DVector<f64>> {
        let solved = self.factor(damping)?.solve(&self.gradient);
        let mut step = DVector::zeros(self.total);
        for (i, &at) in self.used.iter().enumerate() {
            step[at] = solved[i] / self.scale[i];
        }
        step.iter().all(|v| v.is_finite()).then_some(step)
    }
}
