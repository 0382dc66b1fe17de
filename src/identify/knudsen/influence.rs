//! The covariance of Knudsen's estimate by the delta method, from the recordings.
//!
//! With the residual `v_k = y_f(k) - Theta z_k` of window `k`, its influence on the estimate is, to first order,
//!
//! `psi_k = J_Theta vec(v_k z_k' Szz^-1) + J_P vech(v_k v_k' j / dof - P)`, `Szz = Z Z' / j`,
//!
//! and the covariance is `1 / (j dof) sum_{|tau| < h} sum_k psi_k psi_{k + tau}'`. The residuals of windows that are
//! `h` or more apart share no innovation: cutting off the sum there is exact while `L_x = (A - K C)^i` is zero, and
//! there is no bandwidth to choose. It holds for innovations of any distribution. The estimate is centred at its own
//! limit: the bias that a short past leaves in `K` and `R` (Theorem 4) is not in it.

use nalgebra::DMatrix;

use super::future_regression::Regression;
use super::jacobian::Jacobian;
use crate::covariance::ParameterCovariance;
use crate::linalg::{
    LinalgError, multiply, multiply_nt, solve_upper, solve_upper_transposed, symmetric_eigen,
};

/// Windows that are taken at a time.
const BATCH: usize = 1024;

/// Collects the influence of every window.
#[derive(Debug)]
pub(crate) struct Influence<'a> {
    regression: &'a Regression,
    /// `J_Theta` as `(parameter, a) x b`.
    of_coefficients: DMatrix<f64>,
    of_covariance: DMatrix<f64>,
    layout: crate::covariance::ParameterLayout,
    parameters: usize,
    /// Influences of the windows of one experiment, one column each.
    sums: DMatrix<f64>,
    windows: usize,
}

impl<'a> Influence<'a> {
    /// For an estimate with this Jacobian.
    pub(crate) fn new(regression: &'a Regression, jacobian: &Jacobian) -> Self {
        let parameters = jacobian.rows();
        let rows = regression.future * regression.outputs;
        let regressors = regression.regressors();
        // J_Theta vec(v w') with w = Szz^-1 z: the metric goes into the Jacobian, Szz^-1 = j R^-1 R'^-1.
        let stacked = DMatrix::from_fn(parameters * rows, regressors, |pa, b| {
            jacobian.of_coefficients[(pa % parameters, pa / parameters + rows * b)]
        });
        let upper = regression.regressor_factor();
        let half = solve_upper_transposed(&upper, &stacked.transpose());
        let of_coefficients = solve_upper(&upper, &half).transpose() * regression.columns as f64;
        Self {
            regression,
            of_coefficients,
            of_covariance: jacobian.of_covariance.clone(),
            layout: jacobian.layout,
            parameters,
            sums: DMatrix::zeros(parameters, parameters),
            windows: 0,
        }
    }

    /// Adds an experiment: one column of deviations a channel, inputs then outputs, in the units of the regression.
    pub(crate) fn add(&mut self, channels: &[Vec<f64>]) {
        let Regression {
            past,
            future,
            inputs,
            outputs,
            ..
        } = *self.regression;
        let length = past + future;
        let samples = channels.iter().map(Vec::len).min().unwrap_or(0);
        if samples < length {
            return;
        }
        let windows = samples - length + 1;
        let mut influences = DMatrix::zeros(self.parameters, windows);
        let q = inputs + outputs;
        let regressors = self.regression.regressors();
        let mut first = 0;
        while first < windows {
            let count = BATCH.min(windows - first);
            let z = DMatrix::from_fn(regressors, count, |row, k| {
                let (block, channel) = if row < past * q {
                    (row / q, row % q)
                } else {
                    let rest = row - past * q;
                    (past + rest / inputs.max(1), rest % inputs.max(1))
                };
                channels[channel][first + k + block]
            });
            let y = DMatrix::from_fn(future * outputs, count, |row, k| {
                channels[inputs + row % outputs][first + k + past + row / outputs]
            });
            let v = y - multiply(&self.regression.coefficients, &z);
            influences
                .columns_mut(first, count)
                .copy_from(&self.influence(&z, &v));
            first += count;
        }
        self.sums += multiply_nt(&influences, &influences);
        for lag in 1..future.min(windows) {
            let early = influences.columns(0, windows - lag).into_owned();
            let late = influences.columns(lag, windows - lag).into_owned();
            let cross = multiply_nt(&early, &late);
            self.sums += &cross + cross.transpose();
        }
        self.windows += windows;
    }

    /// `psi` of a batch of windows.
    fn influence(&self, z: &DMatrix<f64>, v: &DMatrix<f64>) -> DMatrix<f64> {
        let (rows, count) = v.shape();
        let through_coefficients = multiply(&self.of_coefficients, z);
        let squares = DMatrix::from_fn(rows * rows, count, |ab, k| {
            v[(ab % rows, k)] * v[(ab / rows, k)]
        });
        let divisor = self.regression.degrees_of_freedom() as f64;
        let scale = self.regression.columns as f64 / divisor;
        let mut out = multiply(&self.of_covariance, &squares) * scale;
        let residual = &self.regression.residual_covariance;
        let centre =
            &self.of_covariance * DMatrix::from_column_slice(rows * rows, 1, residual.as_slice());
        for k in 0..count {
            for parameter in 0..self.parameters {
                let linear: f64 = (0..rows)
                    .map(|a| through_coefficients[(parameter + self.parameters * a, k)] * v[(a, k)])
                    .sum();
                out[(parameter, k)] += linear - centre[(parameter, 0)];
            }
        }
        out
    }

    /// The covariance of the system matrices, negative eigenvalues set to zero.
    ///
    /// # Errors
    /// [`LinalgError`] when its eigenvalues cannot be computed.
    pub(crate) fn finish(self) -> Result<ParameterCovariance, LinalgError> {
        let divisor = self.regression.columns as f64 * self.regression.degrees_of_freedom() as f64;
        // With a part of the windows the sum is scaled up to all of them.
        let scale = self.regression.columns as f64 / self.windows.max(1) as f64 / divisor;
        let matrix = self.sums * scale;
        // Parameters of different size: the eigenvalues are those of the correlations.
        let deviations: Vec<f64> = matrix
            .diagonal()
            .iter()
            .map(|v| if *v > 0.0 { v.sqrt() } else { 0.0 })
            .collect();
        let p = self.parameters;
        let correlation = DMatrix::from_fn(p, p, |i, j| {
            let product = deviations[i] * deviations[j];
            if product > 0.0 {
                0.5 * (matrix[(i, j)] + matrix[(j, i)]) / product
            } else {
                0.0
            }
        });
        let mut eigen = symmetric_eigen(&correlation)?;
        for (column, value) in eigen.values.iter().enumerate() {
            eigen
                .vectors
                .column_mut(column)
                .scale_mut(value.max(0.0).sqrt());
        }
        for (row, deviation) in deviations.iter().enumerate() {
            eigen.vectors.row_mut(row).scale_mut(*deviation);
        }
        let joint = multiply_nt(&eigen.vectors, &eigen.vectors);
        let length = self.layout.len();
        Ok(ParameterCovariance {
            layout: self.layout,
            matrix: joint.view((0, 0), (length, length)).into_owned(),
            degrees_of_freedom: None,
        })
    }
}
