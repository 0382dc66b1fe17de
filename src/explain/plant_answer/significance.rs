//! Whether a recording tells the parameters of an effect from 0.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Level of the test.
const LEVEL: f64 = 0.05;

/// Wald's test of all parameters of an effect together, which stand at `places` of the free numbers: a strength and the level it acts
/// from may be known together only. True where there is no covariance to test with, and for an effect without parameters.
pub(super) fn differ_from_zero(
    values: &[f64],
    covariance: &DMatrix<f64>,
    places: &[usize],
) -> bool {
    let block = DMatrix::from_fn(places.len(), places.len(), |i, j| {
        covariance[(places[i], places[j])]
    });
    let value = DVector::from_iterator(places.len(), places.iter().map(|&p| values[p]));
    let statistic = || {
        let factor = block.cholesky()?;
        let law = ChiSquared::new(places.len() as f64).ok()?;
        Some((
            value.dot(&factor.solve(&value)),
            law.inverse_cdf(1.0 - LEVEL),
        ))
    };
    statistic().is_none_or(|(statistic, quantile)| statistic.is_nan() || statistic > quantile)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_that_are_known_together_are_significant() {
        // Each is less than two standard deviations from 0; their sum is known well.
        let covariance = DMatrix::from_row_slice(2, 2, &[1.0, -0.99, -0.99, 1.0]);
        assert!(differ_from_zero(&[1.0, 1.0], &covariance, &[0, 1]));
        assert!(!differ_from_zero(&[1.0, -1.0], &covariance, &[0, 1]));
        assert!(!differ_from_zero(&[1.0, 1.0], &covariance, &[1]));
        // Nothing to test, or with.
        assert!(differ_from_zero(&[1.0, 1.0], &covariance, &[]));
        let unknown = DMatrix::from_element(2, 2, f64::INFINITY);
        assert!(differ_from_zero(&[1.0, 1.0], &unknown, &[0, 1]));
    }
}
