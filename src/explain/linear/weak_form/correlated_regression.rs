//! Linear least squares over windows whose errors are correlated.

use nalgebra::{DMatrix, DVector};

use crate::explain::linear::effective_samples::effective;
use crate::linalg::multiply_tn;

/// `target = columns c + error`.
#[derive(Debug, Clone)]
pub(crate) struct Regression {
    pub(crate) coefficients: DVector<f64>,
    /// Inverse of the Gram matrix.
    pub(crate) inverse: DMatrix<f64>,
    pub(crate) residual: Vec<f64>,
    /// Sum of squared errors.
    pub(crate) squares: f64,
}

impl Regression {
    /// Least squares; `None` where the columns are dependent.
    pub(crate) fn new(columns: &[&[f64]], target: &[f64]) -> Option<Self> {
        let (n, m) = (target.len(), columns.len());
        if n <= m {
            return None;
        }
        let scale: Vec<f64> = columns
            .iter()
            .map(|c| c.iter().map(|v| v * v).sum::<f64>().sqrt())
            .collect();
        if scale.iter().any(|s| !(*s > 0.0 && s.is_finite())) {
            return None;
        }
        let x = DMatrix::from_fn(n, m, |i, j| columns[j][i] / scale[j]);
        let gram = multiply_tn(&x, &x);
        // Dependent to half the digits: the normal equations have no more.
        let smallest = gram.symmetric_eigenvalues().min();
        if smallest < 1e-9 {
            return None;
        }
        let inverse = gram.cholesky()?.inverse();
        let t = DVector::from_column_slice(target);
        let scaled = &inverse * x.tr_mul(&t);
        let residual: Vec<f64> = (&t - &x * &scaled).iter().copied().collect();
        Some(Self {
            coefficients: DVector::from_fn(m, |i, _| scaled[i] / scale[i]),
            inverse: DMatrix::from_fn(m, m, |i, j| inverse[(i, j)] / (scale[i] * scale[j])),
            squares: residual.iter().map(|r| r * r).sum(),
            residual,
        })
    }

    /// Number of independent windows that the errors amount to: `N / sum rho^2` (Bartlett 1946).
    pub(crate) fn effective(&self) -> f64 {
        effective(&self.residual)
    }

    /// Sum of squared errors of the motion: over the square of the first coefficient, which is the mass. Laws that change
    /// the input change what the errors of the force are measured in; those of the acceleration stay the same.
    pub(crate) fn motion_squares(&self) -> f64 {
        self.squares / self.coefficients[0].powi(2).max(1e-300)
    }

    /// Covariance of the coefficients, with as many windows as are independent.
    pub(crate) fn covariance(&self) -> DMatrix<f64> {
        let n = self.residual.len() as f64;
        let free = (n - self.coefficients.len() as f64).max(1.0);
        &self.inverse * (self.squares / free * (n / self.effective()).max(1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn dependent_columns_are_refused() {
        let a: Vec<f64> = (0..50).map(f64::from).collect();
        let b: Vec<f64> = a.iter().map(|v| 2.0 * v).collect();
        assert!(Regression::new(&[&a, &b], &a).is_none());
        let one = vec![1.0; 50];
        let fit = Regression::new(&[&a, &one], &b).unwrap();
        assert!((fit.coefficients[0] - 2.0).abs() < 1e-12 && fit.coefficients[1].abs() < 1e-10);
    }

    /// Coefficients scatter as their stated covariance says, whether the errors are independent or not.
    #[test]
    fn coefficients_are_as_certain_as_is_said() {
        const RUNS: u64 = 200;
        for correlated in [0.0, 0.8] {
            let mut squares = [0.0; 2];
            for seed in 0..RUNS {
                let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
                let mut white = || random.random::<f64>() - 0.5;
                let mut passed = [0.0; 2];
                let mut coloured = |i: usize| {
                    passed[i] = correlated * passed[i] + white();
                    passed[i]
                };
                let a: Vec<f64> = (0..600).map(|_| coloured(0)).collect();
                let one = vec![1.0; 600];
                let target: Vec<f64> = a.iter().map(|a| 2.0 * a - 1.0 + coloured(1)).collect();
                let fit = Regression::new(&[&a, &one], &target).unwrap();
                let covariance = fit.covariance();
                for (i, truth) in [2.0, -1.0].into_iter().enumerate() {
                    let error = fit.coefficients[i] - truth;
                    squares[i] += error * error / covariance[(i, i)] / RUNS as f64;
                }
            }
            // Bartlett's count is that of a slope whose regressor is as slow as the errors; a mean of such errors
            // scatters more, by (1 + rho)^2/(1 + rho^2) at most.
            let slow = (1.0 + correlated).powi(2) / (1.0 + correlated * correlated);
            assert!(
                (0.7..1.4).contains(&squares[0]),
                "{correlated}: {squares:?}"
            );
            assert!(
                (0.7..1.4 * slow).contains(&squares[1]),
                "{correlated}: {squares:?}"
            );
        }
    }

    #[test]
    fn what_does_not_determine_its_numbers_is_refused() {
        let (a, b) = ([1.0, 2.0, -1.0], [0.5, -1.0, 3.0]);
        let target = [2.0, 1.0, 4.0];
        let found = Regression::new(&[&a, &b], &target).unwrap();
        assert_eq!(found.coefficients.len(), 2);
        // As many numbers as values leave nothing to judge by.
        assert!(Regression::new(&[&a[..2], &b[..2]], &target[..2]).is_none());
        for bad in [0.0, f64::NAN, f64::INFINITY] {
            assert!(
                Regression::new(&[&a, &[bad; 3]], &target).is_none(),
                "{bad}"
            );
        }
        let twice = a.map(|v| 2.0 * v);
        assert!(Regression::new(&[&a, &twice], &target).is_none());
    }
}
