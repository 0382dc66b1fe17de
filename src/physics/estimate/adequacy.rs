//! Whether what an estimated plant leaves is noise: white, and no function of the inputs.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// A test of the whitened residuals of one output.
#[derive(Debug, Clone, PartialEq)]
pub struct ResidualTest {
    /// Place of the output.
    pub output: usize,
    /// What is tested.
    pub question: Question,
    /// Chi-square under the hypothesis that it is noise.
    pub statistic: f64,
    /// Its degrees of freedom.
    pub degrees: usize,
    /// Probability of a statistic as large when it is noise.
    pub p_value: f64,
}

/// What is asked of residuals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Question {
    /// Are they white? (Ljung and Box 1978)
    White,
    /// Do they depend on past inputs? Score test: their regression on lags of the inputs.
    Inputs,
    /// Do they depend on squares and products of inputs and simulated outputs? A test of the form of the equations.
    Products,
}

/// Lags of the test of whiteness, and of the regressions.
const LAGS: usize = 20;
const INPUT_LAGS: usize = 8;
/// Values that each degree of freedom needs.
pub(super) const VALUES_A_DEGREE: usize = 10;

/// Ljung and Box's test of series of one output, one a recording; `fitted` coefficients of the noise model were taken from it.
pub(super) fn white(output: usize, series: &[&[f64]], fitted: usize) -> Option<ResidualTest> {
    let n: usize = series.iter().map(|s| s.len()).sum();
    let lags = (LAGS + fitted).min(n / VALUES_A_DEGREE);
    if lags <= fitted {
        return None;
    }
    let square: f64 = series.iter().flat_map(|s| s.iter()).map(|e| e * e).sum();
    let statistic: f64 = (1..=lags)
        .map(|lag| {
            let sum: f64 = series
                .iter()
                .flat_map(|s| s.iter().zip(s.iter().skip(lag)))
                .map(|(a, b)| a * b)
                .sum();
            (sum / square).powi(2) / (n - lag) as f64
        })
        .sum::<f64>()
        * n as f64
        * (n + 2) as f64;
    test(output, Question::White, statistic, lags - fitted)
}

/// Score test of `residuals` against columns of regressors (both whitened alike, and of one length).
pub(super) fn score(
    output: usize,
    question: Question,
    residuals: &[f64],
    columns: &[Vec<f64>],
) -> Option<ResidualTest> {
    let n = residuals.len();
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len().max(1) as f64;
    let columns: Vec<&Vec<f64>> = columns
        .iter()
        .filter(|c| {
            let m = mean(c);
            c.iter().map(|v| (v - m).powi(2)).sum::<f64>()
                > 1e-20 * c.iter().map(|v| v * v).sum::<f64>()
        })
        .collect();
    let k = columns.len();
    if k == 0 || n < VALUES_A_DEGREE * (k + 1) {
        return None;
    }
    let matrix = DMatrix::from_fn(
        n,
        k + 1,
        |i, j| if j == 0 { 1.0 } else { columns[j - 1][i] },
    );
    let scale: Vec<f64> = matrix.column_iter().map(|c| c.norm().max(1e-300)).collect();
    let gram = matrix.tr_mul(&matrix);
    let gram = DMatrix::from_fn(k + 1, k + 1, |i, j| gram[(i, j)] / (scale[i] * scale[j]));
    let e = DVector::from_column_slice(residuals);
    let right = matrix.tr_mul(&e);
    let right = DVector::from_fn(k + 1, |i, _| right[i] / scale[i]);
    let eigen = gram.symmetric_eigen();
    let (mut explained, mut degrees) = (0.0, 0);
    for (i, &value) in eigen.eigenvalues.iter().enumerate() {
        if value > 1e-9 {
            explained += eigen.eigenvectors.column(i).dot(&right).powi(2) / value;
            degrees += 1;
        }
    }
    let m = mean(residuals);
    let total: f64 = residuals.iter().map(|v| (v - m).powi(2)).sum();
    let explained = (explained - n as f64 * m * m).max(0.0);
    test(output, question, n as f64 * explained / total, degrees - 1)
}

/// A chi-square statistic as a test.
pub(super) fn test(
    output: usize,
    question: Question,
    statistic: f64,
    degrees: usize,
) -> Option<ResidualTest> {
    let law = ChiSquared::new(degrees as f64).ok()?;
    statistic.is_finite().then(|| ResidualTest {
        output,
        question,
        statistic,
        degrees,
        p_value: law.sf(statistic),
    })
}

/// Lags `0..` of a series, zero before its begin.
pub(super) fn lagged(series: &[f64]) -> Vec<Vec<f64>> {
    (0..INPUT_LAGS)
        .map(|lag| {
            (0..series.len())
                .map(|k| if k >= lag { series[k - lag] } else { series[0] })
                .collect()
        })
        .collect()
}

/// Squares and products of series, each about its mean.
pub(super) fn products(series: &[&[f64]]) -> Vec<Vec<f64>> {
    let centred: Vec<Vec<f64>> = series
        .iter()
        .map(|s| {
            let m = s.iter().sum::<f64>() / s.len().max(1) as f64;
            s.iter().map(|v| v - m).collect()
        })
        .collect();
    let mut columns = Vec::new();
    for (i, a) in centred.iter().enumerate() {
        for b in &centred[i..] {
            columns.push(a.iter().zip(b).map(|(a, b)| a * b).collect());
        }
    }
    columns
}
