//! Partial correlations: what some regressors say about a target beyond what others already said.
//!
//! All three tests of residuals are this one with other roles. With the target `t[k]`, the conditioning
//! regressors `c[k]` and the tested regressors `w[k]`, all stacked from one Gram matrix of lagged samples,
//! `w~ = w - S_wc S_cc^-1 c` and `t~ = t - S_tc S_cc^-1 c` give the score `sum w~[k] t~[k]'`. Under the
//! hypothesis that `w` adds nothing its covariance is `N S_{w|c} (x) Lambda`, so
//!
//! `G = S_{w|c}^{-1/2} (sum w~ t~') Lambda^{-1/2} / sqrt(N)`
//!
//! has independent standard normal entries: the Lagrange multiplier form of the test of Granger (1969,
//! Econometrica 37:424), and of Hosking's portmanteau statistic (1980, JASA 75:602) when nothing is
//! conditioned on and `w` is the past of `t`.

use nalgebra::{DMatrix, DVector};

use crate::linalg::{LinalgError, multiply, multiply_tn, symmetric_eigen};

/// Directions of the regressors with a smaller share of variance left (regressors scaled to unit variance)
/// say nothing that the others have not said: inputs of few frequencies, or slow ones.
const COLLINEAR: f64 = 1e-9;

/// The scores with the linear maps that made them.
#[derive(Debug, Clone)]
pub(crate) struct Partial {
    /// Whitened scores `G`, rank of the tested regressors x rank of the target.
    pub(crate) scores: DMatrix<f64>,
    /// `Theta`: `w_white = sqrt(N) Theta [c; w]` has unit covariance.
    pub(crate) theta: DMatrix<f64>,
    /// `T`: `t_white = sqrt(N) T t~` has unit covariance.
    pub(crate) target: DMatrix<f64>,
    /// Back from whitened to tested regressors, `w~ = regressor_root w_white`, per sample.
    pub(crate) regressor_root: DMatrix<f64>,
    /// `t~ = target_root t_white`, per sample.
    pub(crate) target_root: DMatrix<f64>,
    /// `S_tc S_cc^-1`.
    pub(crate) coefficients: DMatrix<f64>,
    /// Number of samples.
    pub(crate) samples: usize,
    /// Number of conditioning regressors.
    pub(crate) conditions: usize,
}

impl Partial {
    /// Tests the rows `tested` of the Gram matrix on the rows `target`, given the rows `conditions`.
    pub(crate) fn new(
        gram: &DMatrix<f64>,
        samples: usize,
        conditions: &[usize],
        tested: &[usize],
        target: &[usize],
    ) -> Result<Self, LinalgError> {
        let scale = |rows: &[usize]| -> Vec<f64> {
            rows.iter()
                .map(|&i| {
                    let d = gram[(i, i)];
                    if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 }
                })
                .collect()
        };
        let (dc, dw, dt) = (scale(conditions), scale(tested), scale(target));
        let block = |rows: &[usize], dr: &[f64], columns: &[usize], ds: &[f64]| {
            DMatrix::from_fn(rows.len(), columns.len(), |i, j| {
                gram[(rows[i], columns[j])] * dr[i] * ds[j]
            })
        };
        let s_cc = block(conditions, &dc, conditions, &dc);
        let s_cw = block(conditions, &dc, tested, &dw);
        let s_ct = block(conditions, &dc, target, &dt);
        // S_cc^-1 = F F'.
        let f = whitener(&s_cc)?.0.transpose();
        let (f_w, f_t) = (multiply_tn(&f, &s_cw), multiply_tn(&f, &s_ct));
        let s_ww = block(tested, &dw, tested, &dw) - multiply_tn(&f_w, &f_w);
        let s_wt = block(tested, &dw, target, &dt) - multiply_tn(&f_w, &f_t);
        let s_tt = block(target, &dt, target, &dt) - multiply_tn(&f_t, &f_t);

        let n = samples as f64;
        let (w_white, w_root) = whitener(&s_ww)?;
        let (t_white, t_root) = whitener(&s_tt)?;
        let freedom = (samples.saturating_sub(1 + conditions.len())).max(1) as f64;
        let scores = &w_white * &s_wt * t_white.transpose() * freedom.sqrt();
        let slope_w = multiply(&f, &f_w); // S_cc^-1 S_cw
        let slope_t = multiply(&f, &f_t);
        let theta_c = -(&w_white * slope_w.transpose());
        let mut theta = DMatrix::zeros(w_white.nrows(), conditions.len() + tested.len());
        for i in 0..theta.nrows() {
            for j in 0..conditions.len() {
                theta[(i, j)] = theta_c[(i, j)] * dc[j];
            }
            for j in 0..tested.len() {
                theta[(i, conditions.len() + j)] = w_white[(i, j)] * dw[j];
            }
        }
        let unscale = |root: DMatrix<f64>, d: &[f64]| {
            DMatrix::from_fn(root.nrows(), root.ncols(), |i, j| {
                if d[i] > 0.0 {
                    root[(i, j)] / (d[i] * n.sqrt())
                } else {
                    0.0
                }
            })
        };
        Ok(Self {
            scores,
            theta,
            target: DMatrix::from_fn(t_white.nrows(), target.len(), |i, j| {
                t_white[(i, j)] * dt[j]
            }),
            regressor_root: unscale(w_root, &dw),
            target_root: unscale(t_root, &dt),
            coefficients: DMatrix::from_fn(target.len(), conditions.len(), |i, j| {
                if dt[i] > 0.0 {
                    slope_t[(j, i)] * dc[j] / dt[i]
                } else {
                    0.0
                }
            }),
            samples,
            conditions: conditions.len(),
        })
    }

    /// Degrees of freedom before anything is fitted away.
    pub(crate) fn dimension(&self) -> usize {
        self.scores.len()
    }

    /// Covariances `(1/N) sum w~ t~'` of tested regressors and target channels, freed of the conditions.
    pub(crate) fn covariances(&self) -> DMatrix<f64> {
        let n = self.samples as f64;
        &self.regressor_root * &self.scores * self.target_root.transpose() / n.sqrt()
    }

    /// Share of the variance of each target channel, as the conditions leave it, that the tested
    /// regressors explain: `R^2`, adjusted for degrees of freedom and clipped at 0.
    pub(crate) fn explained(&self) -> Vec<f64> {
        let n = self.samples as f64;
        let rank = self.scores.nrows() as f64;
        let freedom = n - 1.0 - self.conditions as f64;
        let explained = &self.scores * self.target_root.transpose();
        (0..self.target_root.nrows())
            .map(|i| {
                let variance = self.target_root.row(i).norm_squared();
                if variance <= 0.0 || freedom <= rank {
                    return 0.0;
                }
                let share = (explained.column(i).norm_squared() / (variance * freedom)).min(1.0);
                (1.0 - (1.0 - share) * freedom / (freedom - rank)).clamp(0.0, 1.0)
            })
            .collect()
    }
}

/// `(W, U)` with `W S W' = I` and `U U' = S`, `W U = I` of the rank of `S`: rows of `W` for the directions
/// with a variance above [`COLLINEAR`].
fn whitener(matrix: &DMatrix<f64>) -> Result<(DMatrix<f64>, DMatrix<f64>), LinalgError> {
    let order = matrix.nrows();
    if order == 0 {
        return Ok((DMatrix::zeros(0, 0), DMatrix::zeros(0, 0)));
    }
    let eigen = symmetric_eigen(&((matrix + matrix.transpose()) * 0.5))?;
    let kept: Vec<usize> = (0..order)
        .filter(|&i| eigen.values[i] > COLLINEAR)
        .collect();
    let roots = DVector::from_fn(kept.len(), |i, _| eigen.values[kept[i]].sqrt());
    let forward = DMatrix::from_fn(kept.len(), order, |i, j| {
        eigen.vectors[(j, kept[i])] / roots[i]
    });
    let backward = DMatrix::from_fn(order, kept.len(), |i, j| {
        eigen.vectors[(i, kept[j])] * roots[j]
    });
    Ok((forward, backward))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::least_squares;

    /// The score statistic is `N R^2` of the two regressions written out.
    #[test]
    fn statistic_is_the_gain_of_the_regression() {
        let mut state = 3_u64;
        let data = DMatrix::from_fn(200, 6, |_, j| {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            ((state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5) * 10.0_f64.powi(j as i32 - 3)
        });
        let mut data = data;
        for k in 0..200 {
            data[(k, 5)] += 300.0 * data[(k, 0)] + 2.0 * data[(k, 2)];
        }
        let gram = data.transpose() * &data;
        let partial = Partial::new(&gram, 200, &[0, 1], &[2, 3, 4], &[5]).unwrap();
        let y = data.columns(5, 1).into_owned();
        let rest = |columns: &[usize]| {
            let x = DMatrix::from_fn(200, columns.len(), |i, j| data[(i, columns[j])]);
            (&y - &x * least_squares(&x, &y).unwrap()).norm_squared()
        };
        let (without, with) = (rest(&[0, 1]), rest(&[0, 1, 2, 3, 4]));
        let expected = 197.0 * (1.0 - with / without);
        assert!((partial.scores.norm_squared() - expected).abs() < 1e-8 * expected);
        let adjusted = 1.0 - (with / 194.0) / (without / 197.0);
        assert!((partial.explained()[0] - adjusted).abs() < 1e-10);
    }

    #[test]
    fn collinear_regressors_lose_their_degrees_of_freedom() {
        let data = DMatrix::from_fn(60, 4, |i, j| match j {
            2 => 2.0 * ((i * 7) % 11) as f64,
            3 => ((i * i) % 13) as f64,
            _ => ((i * 7 * (j + 1)) % 11) as f64,
        });
        let gram = data.transpose() * &data;
        let partial = Partial::new(&gram, 60, &[], &[0, 1, 2], &[3]).unwrap();
        assert_eq!(partial.dimension(), 2);
    }
}
