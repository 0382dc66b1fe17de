//! How well bounds hold over Monte Carlo runs.

use nalgebra::DMatrix;
use num_complex::Complex64;

use super::estimation_run::Response;
use crate::covariance::{Covariance2, ellipse_quantile, interval_quantile, projected_variance};
use crate::reproduce::statistics::{mean, mean_with_error, root_mean_square};

/// Level of the paper's bounds.
const LEVEL: f64 = 0.99;

/// What the bounds of many runs do.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bounds {
    /// Share of bounds `|G| +- z sd` that hold the truth, with its standard error over runs.
    pub(super) linear: (f64, f64),
    /// The same for bounds that are symmetric on `log|G|`.
    pub(super) logarithmic: (f64, f64),
    /// The same for the ellipse of the complex response.
    pub(super) ellipse: (f64, f64),
    /// Share of the other runs' estimates within the linear bound of the first run.
    pub(super) others_in_first: f64,
    /// The same, of every run in turn.
    pub(super) others: f64,
    /// Mean predicted over Monte Carlo variance of the response, as a geometric mean over its entries.
    pub(super) variance_ratio: f64,
    /// Root mean square over the runs of the error relative to the magnitude, as a geometric mean over the entries
    /// of the response: a zero of the plant, where any error is large, does not decide.
    pub(super) relative_error: f64,
}

/// Magnitude, and its standard deviation to first order.
fn magnitude(g: Complex64, covariance: &Covariance2) -> (f64, f64) {
    let size = g.norm();
    let variance = projected_variance(covariance, g.re / size, g.im / size);
    (size, variance.sqrt())
}

/// Bound of the magnitude, symmetric on a linear scale.
fn linear_bound(g: Complex64, covariance: &Covariance2) -> (f64, f64) {
    let (size, std) = magnitude(g, covariance);
    let z = interval_quantile(LEVEL, None);
    (size - z * std, size + z * std)
}

fn holds(bound: (f64, f64), value: f64) -> bool {
    (bound.0..=bound.1).contains(&value)
}

/// The share of another estimate of the same accuracy in the bound: the difference has twice the variance.
pub(super) fn share_expected_of_others() -> f64 {
    // P(|d| < z sd) with var d = 2 sd^2.
    statrs::function::erf::erf(interval_quantile(LEVEL, None) / 2.0)
}

/// Measures the bounds of `runs` against the truth at the frequencies `at` (indices into the grid).
pub(super) fn bounds(runs: &[Response], truth: &[DMatrix<Complex64>], at: &[usize]) -> Bounds {
    let entries: Vec<(usize, usize)> = at
        .iter()
        .flat_map(|&w| (0..truth[w].len()).map(move |entry| (w, entry)))
        .collect();
    let share = |inside: &dyn Fn(&Response, usize, usize) -> bool| {
        let of_runs: Vec<f64> = runs
            .iter()
            .map(|run| {
                let count = entries.iter().filter(|(w, e)| inside(run, *w, *e)).count();
                count as f64 / entries.len() as f64
            })
            .collect();
        mean_with_error(&of_runs)
    };
    let linear = share(&|run, w, e| {
        holds(
            linear_bound(run.value[w][e], &run.covariance[w][e]),
            truth[w][e].norm(),
        )
    });
    let logarithmic = share(&|run, w, e| {
        let (size, std) = magnitude(run.value[w][e], &run.covariance[w][e]);
        let distance = (truth[w][e].norm() / size).ln().abs();
        distance <= interval_quantile(LEVEL, None) * std / size
    });
    let ellipse = share(&|run, w, e| {
        let error = truth[w][e] - run.value[w][e];
        let [[a, b], [_, d]] = run.covariance[w][e];
        let square =
            d * error.re * error.re - 2.0 * b * error.re * error.im + a * error.im * error.im;
        square <= ellipse_quantile(LEVEL, None) * (a * d - b * b)
    });
    let in_bound_of = |i: usize| {
        let shares: Vec<f64> = entries
            .iter()
            .map(|&(w, e)| {
                let bound = linear_bound(runs[i].value[w][e], &runs[i].covariance[w][e]);
                let inside = runs
                    .iter()
                    .enumerate()
                    .filter(|(j, other)| *j != i && holds(bound, other.value[w][e].norm()))
                    .count();
                inside as f64 / (runs.len() - 1) as f64
            })
            .collect();
        mean(&shares)
    };
    let others: Vec<f64> = (0..runs.len()).map(in_bound_of).collect();
    let ratios: Vec<f64> = entries
        .iter()
        .map(|&(w, e)| {
            let values: Vec<Complex64> = runs.iter().map(|run| run.value[w][e]).collect();
            let centre = values.iter().sum::<Complex64>() / values.len() as f64;
            let scatter: f64 = values.iter().map(|v| (v - centre).norm_sqr()).sum();
            let predicted: Vec<f64> = runs
                .iter()
                .map(|run| run.covariance[w][e][0][0] + run.covariance[w][e][1][1])
                .collect();
            (mean(&predicted) * (values.len() - 1) as f64 / scatter).ln()
        })
        .collect();
    let errors: Vec<f64> = entries
        .iter()
        .map(|&(w, e)| {
            let of_runs = runs
                .iter()
                .map(|run| (run.value[w][e] - truth[w][e]).norm());
            (root_mean_square(of_runs) / truth[w][e].norm()).ln()
        })
        .collect();
    Bounds {
        linear,
        logarithmic,
        ellipse,
        others_in_first: others[0],
        others: mean(&others),
        variance_ratio: mean(&ratios).exp(),
        relative_error: mean(&errors).exp(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    /// Estimates that scatter exactly as their covariance says have bounds that hold what they promise.
    #[test]
    fn exact_bounds_hold_their_level() {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let truth = vec![DMatrix::from_element(1, 1, Complex64::new(3.0, 4.0)); 2];
        let runs: Vec<Response> = (0..3000)
            .map(|_| Response {
                value: (0..2)
                    .map(|_| {
                        let noise = Complex64::new(0.02 * normal(), 0.01 * normal());
                        DMatrix::from_element(1, 1, truth[0][0] + noise)
                    })
                    .collect(),
                covariance: vec![DMatrix::from_element(1, 1, [[4e-4, 0.0], [0.0, 1e-4]]); 2],
            })
            .collect();
        let found = bounds(&runs, &truth, &[0, 1]);
        for (share, error) in [found.linear, found.logarithmic, found.ellipse] {
            assert!((share - LEVEL).abs() < 4.0 * error, "{share} +- {error}");
        }
        assert!((share_expected_of_others() - 0.9314).abs() < 2e-4);
        assert!((found.others - share_expected_of_others()).abs() < 0.01);
        assert!((found.variance_ratio - 1.0).abs() < 0.06);
        let expected = (5e-4f64).sqrt() / 5.0;
        assert!((found.relative_error / expected - 1.0).abs() < 0.05);
    }
}
