//! How many independent values a correlated series amounts to.

use realfft::RealFftPlanner;
use realfft::num_complex::Complex;

/// Lags over which the correlation of the errors is summed, as a share of the windows.
const LAGS_SHARE: usize = 4;

/// `N / sum rho^2` of a series; the share that chance adds to the sum is taken off.
pub(crate) fn effective(series: &[f64]) -> f64 {
    let n = series.len();
    let mean = series.iter().sum::<f64>() / n.max(1) as f64;
    let e: Vec<f64> = series.iter().map(|v| v - mean).collect();
    let variance: f64 = e.iter().map(|v| v * v).sum();
    if n < 4 || variance <= 0.0 {
        return n as f64;
    }
    let lags = n / LAGS_SHARE;
    let sum: f64 = products(&e, lags)
        .iter()
        .skip(1)
        .map(|product| {
            let r = product / variance;
            r * r - 1.0 / n as f64
        })
        .sum();
    n as f64 / (1.0 + 2.0 * sum.max(0.0))
}

/// `sum_k e[k] e[k + lag]` for the lags below `lags`, by way of the spectrum of the padded series.
fn products(series: &[f64], lags: usize) -> Vec<f64> {
    let length = (series.len() + lags).next_power_of_two();
    let mut planner = RealFftPlanner::<f64>::new();
    let (forward, backward) = (
        planner.plan_fft_forward(length),
        planner.plan_fft_inverse(length),
    );
    let mut padded = series.to_vec();
    padded.resize(length, 0.0);
    let mut spectrum = forward.make_output_vec();
    let transformed = forward.process(&mut padded, &mut spectrum).and_then(|()| {
        for value in &mut spectrum {
            *value = Complex::new(value.norm_sqr(), 0.0);
        }
        backward.process(&mut spectrum, &mut padded)
    });
    debug_assert!(transformed.is_ok(), "{transformed:?}");
    padded.truncate(lags);
    for value in &mut padded {
        *value /= length as f64;
    }
    padded
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn correlated_series_have_fewer_independent_values() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let mut white = || random.random::<f64>() - 0.5;
        let n = 4000;
        let e: Vec<f64> = (0..n).map(|_| white()).collect();
        assert!((effective(&e) / n as f64 - 1.0).abs() < 0.2);
        // An autoregression with coefficient a: sum rho^2 = (1 + a^2)/(1 - a^2).
        let a = 0.9;
        let mut state = 0.0;
        let v: Vec<f64> = e
            .iter()
            .map(|e| {
                state = a * state + e;
                state
            })
            .collect();
        let expected = n as f64 * (1.0 - a * a) / (1.0 + a * a);
        assert!((effective(&v) / expected - 1.0).abs() < 0.3);
    }

    #[test]
    fn products_over_lags_are_those_of_the_sums() {
        for n in [4, 7, 64, 301] {
            let e: Vec<f64> = (0..n).map(|k| (k as f64 * 0.7).sin() + 0.1).collect();
            let found = products(&e, n / LAGS_SHARE);
            assert_eq!(found.len(), n / LAGS_SHARE);
            for (lag, found) in found.iter().enumerate() {
                let sum: f64 = e.iter().zip(&e[lag..]).map(|(a, b)| a * b).sum();
                assert!((found - sum).abs() < 1e-12 * n as f64, "{n} {lag}");
            }
        }
    }
}
