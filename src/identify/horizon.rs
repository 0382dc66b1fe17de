//! Choice of the past and future windows.

use nalgebra::DMatrix;

use crate::linalg::{cholesky_upper, qr_r};
use crate::moments::RFactor;

/// Share of the samples that regressors may take when the past window is chosen: `p q <= Nc / 10` keeps
/// the second-order part of the variance below a tenth.
const SAMPLES_PER_REGRESSOR: usize = 10;
/// Longest past window that is tried first; longer ones only when the truncation asks for them.
pub(super) const LONGEST_PAST: usize = 100;
/// Longest past window that is chosen at all.
pub(super) const LONGEST_PAST_ON_DEMAND: usize = 250;
/// Future windows shorter than this lose efficiency.
const SHORTEST_FUTURE: usize = 10;

/// Longest past window for a record of `samples` samples of `channels` channels.
pub(super) fn longest_past(samples: usize, channels: usize, limit: usize) -> usize {
    (samples / (SAMPLES_PER_REGRESSOR * channels + 1)).clamp(1, limit)
}

/// Akaike's criterion (corrected for small samples: Hurvich & Tsai 1989, Bedrick & Tsai 1994) of the
/// vector ARX model for every past window up to that of `factor`, all over the same windows.
///
/// One triangular factor with the newest block first holds them all: the residual of past window `p'` is
/// what the outputs have below row `p' q`.
pub(super) fn akaike(factor: &RFactor, feedthrough: bool) -> Vec<(usize, f64)> {
    let (q, outputs) = (factor.channels(), factor.outputs);
    let past = factor.past;
    let order = factor.r.ncols();
    let direct = if feedthrough { factor.inputs } else { 0 };
    let mut columns: Vec<usize> = (past * q..past * q + direct).collect();
    for block in (0..past).rev() {
        columns.extend(block * q..(block + 1) * q);
    }
    columns.extend(order - outputs..order);
    let reversed = DMatrix::from_fn(order, columns.len(), |i, j| factor.r[(i, columns[j])]);
    let r = qr_r(&reversed);
    let first_output = columns.len() - outputs;
    let samples = factor.columns as f64;
    // Rounding of the factor is noise that no record is free of.
    let floor: Vec<f64> = (0..outputs)
        .map(|o| {
            let column = r.column(first_output + o);
            column.norm_squared() * 1e-24
        })
        .collect();
    let mut sum = DMatrix::zeros(outputs, outputs);
    let mut out = Vec::with_capacity(past);
    let mut row = r.nrows();
    for window in (1..=past).rev() {
        let regressors = direct + window * q;
        while row > regressors {
            row -= 1;
            let line = r.view((row, first_output), (1, outputs));
            sum += line.transpose() * line;
        }
        let mut padded = sum.clone();
        for (o, floor) in floor.iter().enumerate() {
            padded[(o, o)] += floor;
        }
        let log_determinant = cholesky_upper(&(padded / samples))
            .map(|u| 2.0 * u.diagonal().iter().map(|d| d.ln()).sum::<f64>())
            .unwrap_or(f64::NEG_INFINITY);
        let m = regressors as f64;
        let l = outputs as f64;
        let spare = samples - m - l - 1.0;
        if spare > 0.0 {
            let penalty = 2.0 * l * m * samples / spare;
            out.push((window, samples * log_determinant + penalty));
        }
    }
    out.reverse();
    out
}

/// The window with the smallest criterion.
pub(super) fn best_past(criterion: &[(usize, f64)]) -> Option<usize> {
    criterion
        .iter()
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(past, _)| *past)
}

/// Future window for the order decision: enough for every order that is looked at.
pub(super) fn future_for_order_choice(past: usize, outputs: usize, largest_order: usize) -> usize {
    past.min((largest_order / outputs + 2).max(SHORTEST_FUTURE))
}

/// Future window for an order: half the past window, because slow dynamics, which make the past window
/// long, are only told apart over a long future as well (measured on a plant with a predictor radius of
/// 0.975: the cost of the estimate before the polish falls from thousands to twice its minimum); at least
/// `n / l + 1`, twice over, so that the states are observable with a margin.
pub(super) fn future_for_order(past: usize, outputs: usize, order: usize) -> usize {
    let observable = 2 * (order.div_ceil(outputs) + 1);
    past.min(observable.max(SHORTEST_FUTURE).max(past / 2))
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;
    use rand::{RngExt, SeedableRng};

    use super::*;

    #[test]
    fn the_past_takes_a_tenth_of_the_samples_at_most() {
        assert_eq!(longest_past(2100, 2, 1000), 100);
        assert_eq!(longest_past(2099, 2, 1000), 99);
        assert_eq!(
            (longest_past(5, 3, 100), longest_past(9_000_000, 2, 100)),
            (1, 100)
        );
    }

    #[test]
    fn the_future_is_long_enough_for_the_order() {
        // Half the past; ten; or twice what observability asks for. Never more than the past.
        assert_eq!(future_for_order(60, 2, 5), 30);
        assert_eq!(future_for_order(14, 2, 5), 10);
        assert_eq!(future_for_order(30, 1, 9), 20);
        assert_eq!(future_for_order(30, 2, 16), 18);
        assert_eq!(future_for_order(7, 1, 9), 7);
        assert_eq!(future_for_order_choice(40, 2, 30), 17);
        assert_eq!(future_for_order_choice(40, 2, 4), 10);
        assert_eq!(future_for_order_choice(6, 2, 30), 6);
    }

    /// Each window by a least squares of its own, all over the samples that the longest can use.
    #[test]
    fn the_criterion_is_that_of_each_regression() {
        let (past, samples) = (6, 150);
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let mut white = || random.random::<f64>() - 0.5;
        let u: Vec<f64> = (0..samples).map(|_| white()).collect();
        let mut y = vec![0.0; samples];
        for k in 2..samples {
            y[k] = 0.6 * y[k - 1] - 0.3 * y[k - 2] + u[k - 2] + 0.4 * u[k] + white();
        }
        let factor = RFactor::of_samples(&[&u, &y], 1, past).unwrap();
        let count = (samples - past) as f64;
        for feedthrough in [false, true] {
            let found = akaike(&factor, feedthrough);
            assert_eq!(found.len(), past);
            for (i, (window, criterion)) in found.into_iter().enumerate() {
                assert_eq!(window, i + 1);
                let regressors = 2 * window + usize::from(feedthrough);
                let x = DMatrix::from_fn(samples - past, regressors, |row, j| {
                    let k = past + row;
                    match j / 2 {
                        lag if lag == window => u[k],
                        lag if j % 2 == 0 => u[k - 1 - lag],
                        lag => y[k - 1 - lag],
                    }
                });
                let target = DMatrix::from_fn(samples - past, 1, |row, _| y[past + row]);
                let normal = (x.transpose() * &x).try_inverse().unwrap();
                let left = &target - &x * (normal * x.transpose() * &target);
                let m = regressors as f64;
                let expected = count * (left.norm_squared() / count).ln()
                    + 2.0 * m * count / (count - m - 2.0);
                assert_relative_eq!(criterion, expected, max_relative = 1e-9);
            }
        }
    }
}
