//! How much of its own past a signal needs to be predicted: the order of its autoregression.

use nalgebra::DMatrix;

use super::residual_pass::Residuals;
use crate::linalg::cholesky_upper;

/// Longest past of its own that is allowed for.
const LONGEST: usize = 50;
/// Lags beyond Akaike's choice. It balances the bias of the predictions against their variance; a test at
/// level alpha needs the bias to be smaller than that, and a few lags more cost next to no power.
const MARGIN: usize = 2;
/// Share of the unit diagonal added for channels that are linearly dependent.
const RIDGE: f64 = 1e-12;

/// Longest past that `samples` samples of `channels` channels (all of them) can support.
pub(crate) fn longest(samples: usize, channels: usize) -> usize {
    (samples / (10 * channels)).clamp(1, LONGEST)
}

/// Number of past samples of the channels `first..first + count` that predict these channels: the minimum of
/// Akaike's criterion `N ln det Lambda_a + 2 a count^2` over `a = 0..=limit` and half as much again, plus
/// a margin when it is not 0.
///
/// One Cholesky factor of `[z[k-1], ..., z[k-limit], z[k]]` holds all the residual covariances: that after
/// `a` lags is the product of the rows below the first `a` of the last columns.
pub(crate) fn order(residuals: &Residuals, first: usize, count: usize, limit: usize) -> usize {
    let mut rows = Vec::with_capacity((limit + 1) * count);
    for lag in (1..=limit).chain([0]) {
        rows.extend((0..count).map(|i| residuals.row(first + i, lag)));
    }
    let gram = &residuals.gram.gram;
    let scale: Vec<f64> = rows
        .iter()
        .map(|&i| gram[(i, i)].max(f64::MIN_POSITIVE).sqrt())
        .collect();
    let mut scaled = DMatrix::from_fn(rows.len(), rows.len(), |i, j| {
        gram[(rows[i], rows[j])] / (scale[i] * scale[j])
    });
    for i in 0..rows.len() {
        scaled[(i, i)] += RIDGE;
    }
    let Ok(factor) = cholesky_upper(&scaled) else {
        return limit;
    };
    let target = factor.columns(limit * count, count);
    let n = residuals.gram.columns as f64;
    let mut best = (f64::INFINITY, 0);
    for lags in 0..=limit {
        let rest = target.rows(lags * count, (limit - lags + 1) * count);
        let criterion =
            n * (rest.tr_mul(&rest)).determinant().ln() + 2.0 * (lags * count * count) as f64;
        if criterion < best.0 {
            best = (criterion, lags);
        }
    }
    match best.1 {
        0 => 0,
        lags => (lags + lags / 2 + MARGIN).min(limit),
    }
}
