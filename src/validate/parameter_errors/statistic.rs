//! From scores to a verdict: what the errors of the parameters add to or take from their covariance.
//!
//! Whitened scores `g(theta)` of a right model have unit covariance at the true parameters, and move by
//! `Q (theta^ - theta)` to first order, `Q` the mean of whitened regressors times whitened sensitivities
//! times `sqrt(N)`.
//! - Fresh record: `theta^` is independent of it, `Cov(g) = I + Q Cov(theta) Q'`.
//! - Estimation record, efficient estimate: `theta^ - theta = -J^-1 (1/N) sum psi' Lambda^-1 e` to first order,
//!   so that `Cov(g, theta^) = -Q Cov(theta)` and `Cov(g) = I - Q Cov(theta) Q'` (Ljung, *System
//!   Identification*, 2nd ed., section 16.6; Box & Pierce 1970 for autoregressions). This holds for tested
//!   samples that are only part of those estimated from.
//!
//! In the second case `Cov(theta) = rho J^-1 / N` is inserted, `J = E[psi' Lambda^-1 psi]` averaged over the same
//! samples as `Q`, and only the scale `rho = min(1, N tr(J Cov) / rank)` (tested over estimated-from samples) is
//! taken from the covariance of the model: then what is subtracted is a projection times `rho` whatever the
//! sampling errors of `J` and `Q`, and no variance comes out negative.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::averages::Averages;
use super::residual_sensitivity::Sensitivity;
use crate::linalg::{multiply, multiply_nt, multiply_tn, svd_thin, symmetric_eigen};
use crate::validate::residuals::Partial;
use crate::validate::{Relation, ValidateError};

/// Variances below this share of what they were before the estimation count as fitted away. An effect
/// that the model leaves out, of size `delta` along such a direction, is itself fitted away but for
/// `lambda delta`, and would add `lambda delta^2` to the statistic: leaving these directions out costs little
/// power, while the sampling error of a small `lambda`, about `1 / sqrt(N)` times the square root of the number of
/// directions, would inflate the statistic.
const FITTED: f64 = 0.1;
/// Directions of the parameter space below this share of the largest information change only the basis.
const GAUGE: f64 = 1e-8;
/// Two-sided 99 % quantile of the normal law.
const NORMAL_99: f64 = 2.575_829_303_548_901;

/// What the parameters do to the covariance of the whitened scores: `inflation I + U diag(change) U'`.
#[derive(Debug, Clone)]
pub(crate) struct ScoreCovariance {
    /// Orthonormal columns.
    directions: DMatrix<f64>,
    /// Change of the variance along each.
    change: DVector<f64>,
    /// Variance of all the other directions.
    pub(crate) inflation: f64,
}

impl ScoreCovariance {
    /// Parameters known without error.
    pub(crate) fn exact(dimension: usize) -> Self {
        Self {
            directions: DMatrix::zeros(dimension, 0),
            change: DVector::zeros(0),
            inflation: 1.0,
        }
    }

    /// With the errors of the parameters.
    pub(crate) fn new(
        partial: &Partial,
        sensitivity: &Sensitivity,
        averages: &Averages,
        relation: Relation,
    ) -> Result<Self, ValidateError> {
        let n = partial.samples as f64;
        match relation {
            Relation::Fresh => {
                let factor = crate::linalg::symmetric_square_root_factor(sensitivity.covariance())?;
                let q = multiply(&averages.cross, &factor) * n.sqrt();
                let svd = svd_thin(&q)?;
                // The averages are over part of the record only: the part of Q that they miss.
                let missed = n * averages.error * (1.0 - averages.samples as f64 / n).max(0.0);
                Ok(Self {
                    change: svd.values.map(|s| s * s),
                    directions: svd.u,
                    inflation: 1.0 + missed + averages.remainder,
                })
            }
            Relation::Estimation => {
                let information = &averages.information;
                let loss = information.component_mul(sensitivity.covariance()).sum();
                let rho = (n * loss / sensitivity.rank().max(1) as f64).min(1.0);
                let eigen = symmetric_eigen(&averages.information)?;
                let largest = eigen.values.amax();
                let kept: Vec<usize> = (0..eigen.values.len())
                    .filter(|&i| eigen.values[i] > GAUGE * largest)
                    .collect();
                let root = DMatrix::from_fn(eigen.values.len(), kept.len(), |i, j| {
                    eigen.vectors[(i, kept[j])] / eigen.values[kept[j]].sqrt()
                });
                let q = multiply(&averages.cross, &root);
                let svd = svd_thin(&q)?;
                Ok(Self {
                    change: svd.values.map(|s| -(rho * s * s).min(1.0)),
                    directions: svd.u,
                    inflation: 1.0,
                })
            }
        }
    }

    /// `g' Cov(g)^+ g`, its degrees of freedom, and the number of directions fitted away.
    fn quadratic(&self, scores: &DMatrix<f64>) -> (f64, usize, usize) {
        let g = DMatrix::from_column_slice(scores.len(), 1, scores.as_slice());
        let along = multiply_tn(&self.directions, &g);
        let mut statistic = g.norm_squared() / self.inflation;
        let mut fitted = 0;
        for (i, change) in self.change.iter().enumerate() {
            let square = along[(i, 0)] * along[(i, 0)];
            let variance = self.inflation + change;
            statistic -= square / self.inflation;
            if variance < FITTED * self.inflation {
                fitted += 1;
            } else {
                statistic += square / variance;
            }
        }
        (statistic.max(0.0), scores.len() - fitted, fitted)
    }
}

/// Outcome of a test, not yet in words.
#[derive(Debug, Clone)]
pub(crate) struct Outcome {
    pub(crate) statistic: f64,
    pub(crate) degrees_of_freedom: usize,
    pub(crate) fitted: usize,
    pub(crate) inflation: f64,
    pub(crate) p_value: f64,
    /// Correlation of each tested regressor (row) with each target channel (column).
    pub(crate) correlations: DMatrix<f64>,
    /// Their two-sided 99 % bounds.
    pub(crate) bounds: DMatrix<f64>,
}

/// The test; `None` when no degree of freedom is left.
pub(crate) fn outcome(partial: &Partial, covariance: &ScoreCovariance) -> Option<Outcome> {
    let (statistic, degrees_of_freedom, fitted) = covariance.quadratic(&partial.scores);
    if degrees_of_freedom == 0 || !statistic.is_finite() {
        return None;
    }
    let law = ChiSquared::new(degrees_of_freedom as f64).ok()?;
    let (u, t) = (&partial.regressor_root, &partial.target_root);
    let (rank_w, rank_t) = (u.ncols(), t.ncols());
    let covariances = partial.covariances();
    let mut correlations = DMatrix::zeros(u.nrows(), t.nrows());
    let mut bounds = correlations.clone();
    let count = covariance.change.len();
    for o in 0..t.nrows() {
        // Rows of (U (x) t_o) times the directions, all tested regressors at once.
        let mut folded = DMatrix::zeros(count, rank_w);
        for j in 0..rank_t {
            let part = covariance.directions.rows(j * rank_w, rank_w);
            folded += part.transpose() * t[(o, j)];
        }
        let reach = multiply_nt(u, &folded);
        let t_square = t.row(o).norm_squared();
        for w in 0..u.nrows() {
            let size = u.row(w).norm_squared() * t_square;
            if size <= 0.0 {
                continue;
            }
            let change: f64 = (0..count)
                .map(|i| covariance.change[i] * reach[(w, i)] * reach[(w, i)])
                .sum();
            let variance = (covariance.inflation + change / size).max(FITTED);
            correlations[(w, o)] = (covariances[(w, o)] / size.sqrt()).clamp(-1.0, 1.0);
            bounds[(w, o)] = (NORMAL_99 * (variance / partial.samples as f64).sqrt()).min(1.0);
        }
    }
    Some(Outcome {
        statistic,
        degrees_of_freedom,
        fitted,
        inflation: covariance.inflation,
        p_value: law.sf(statistic).clamp(0.0, 1.0),
        correlations,
        bounds,
    })
}
