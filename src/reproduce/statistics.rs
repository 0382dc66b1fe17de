//! Statistics over Monte Carlo runs.

/// Mean; NaN without values.
pub(super) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Variance about the mean, with `n - 1`; NaN for fewer than two values.
pub(super) fn variance(values: &[f64]) -> f64 {
    let middle = mean(values);
    let squares: f64 = values.iter().map(|v| (v - middle).powi(2)).sum();
    if values.len() < 2 {
        f64::NAN
    } else {
        squares / (values.len() - 1) as f64
    }
}

/// Mean, and its standard error over independent runs.
pub(super) fn mean_with_error(values: &[f64]) -> (f64, f64) {
    (
        mean(values),
        (variance(values) / values.len() as f64).sqrt(),
    )
}

/// Root mean square.
pub(super) fn root_mean_square(values: impl IntoIterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0usize);
    for value in values {
        sum += value * value;
        count += 1;
    }
    (sum / count as f64).sqrt()
}

/// Percentiles (`share` of one) by linear interpolation between order statistics at `(i - 0.5) / n`, the rule of
/// Matlab's `prctile`, which Chiuso & Picci use. NaN without values; values that are not finite sort last.
pub(super) fn percentiles<const K: usize>(values: &[f64], shares: [f64; K]) -> [f64; K] {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    shares.map(|share| {
        let Some(last) = sorted.len().checked_sub(1) else {
            return f64::NAN;
        };
        let place = (share * sorted.len() as f64 - 0.5).clamp(0.0, last as f64);
        let below = place.floor() as usize;
        let above = (below + 1).min(last);
        let rest = place - below as f64;
        if rest == 0.0 {
            sorted[below]
        } else {
            sorted[below] * (1.0 - rest) + sorted[above] * rest
        }
    })
}

/// Median.
pub(super) fn median(values: &[f64]) -> f64 {
    percentiles(values, [0.5])[0]
}

/// Logarithmic grid from `from` to `to`, both included.
pub(super) fn logarithmic_grid(from: f64, to: f64, points: usize) -> Vec<f64> {
    let step = (to / from).ln() / (points.max(2) - 1) as f64;
    (0..points)
        .map(|k| {
            if k + 1 == points {
                to
            } else {
                from * (step * k as f64).exp()
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_follow_the_rule_of_the_paper() {
        // prctile([1 2 3 4 5], [10 30 50 90]) = 1, 2, 3, 5 in Matlab.
        let values = [3.0, 1.0, 5.0, 2.0, 4.0];
        let found = percentiles(&values, [0.05, 0.1, 0.3, 0.5, 0.6, 0.95]);
        for (found, expected) in found.iter().zip([1.0, 1.0, 2.0, 3.0, 3.5, 5.0]) {
            approx::assert_relative_eq!(*found, expected, epsilon = 1e-12);
        }
        assert!(percentiles(&[], [0.5])[0].is_nan());
        assert_eq!(median(&[1.0, f64::INFINITY, 2.0]), 2.0);
    }

    #[test]
    fn moments() {
        let values = [1.0, 2.0, 3.0, 4.0];
        approx::assert_relative_eq!(variance(&values), 5.0 / 3.0, epsilon = 1e-14);
        let (middle, error) = mean_with_error(&values);
        assert_eq!(middle, 2.5);
        approx::assert_relative_eq!(error, (5.0f64 / 12.0).sqrt(), epsilon = 1e-14);
        assert_eq!(root_mean_square([3.0, 4.0]), 12.5f64.sqrt());
        assert!(variance(&[1.0]).is_nan());
    }

    #[test]
    fn the_grid_has_its_ends() {
        let grid = logarithmic_grid(0.02, 3.0, 8);
        assert_eq!((grid[0], grid[7]), (0.02, 3.0));
        approx::assert_relative_eq!(grid[3], 0.171, max_relative = 5e-3);
    }
}
