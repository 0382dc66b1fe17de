//! Whether estimates differ from the text as a whole. Where they are correlated, each alone may not.

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::explain::explanation::JointTest;

/// Level of the test: that of 3.3 standard deviations of one parameter.
pub(in crate::explain::plant_answer) const LEVEL: f64 = 1e-3;
/// Eigenvalues of a matrix of correlations below this are rounding of its inversion.
const ROUNDING: f64 = 1e-10;

impl JointTest {
    /// Whether the estimates differ from the text.
    pub(crate) fn rejects(&self) -> bool {
        self.p_value < LEVEL
    }
}

/// Wald's test of the whole shift from the text with its covariance. Numbers without a variance are left out.
pub(in crate::explain::plant_answer) fn joint_test(
    shift: &[f64],
    covariance: &DMatrix<f64>,
) -> Option<JointTest> {
    let determined: Vec<usize> = (0..shift.len())
        .filter(|&i| covariance[(i, i)].is_finite() && covariance[(i, i)] > 0.0)
        .collect();
    let std = |i: usize| covariance[(i, i)].sqrt();
    let n = determined.len();
    let correlation = DMatrix::from_fn(n, n, |a, b| {
        let (i, j) = (determined[a], determined[b]);
        covariance[(i, j)] / (std(i) * std(j))
    });
    if n == 0 || correlation.iter().any(|r| !r.is_finite()) {
        return None;
    }
    let most = (0..n)
        .flat_map(|i| (0..i).map(move |j| (i, j)))
        .map(|at| correlation[at].abs())
        .fold(0.0, f64::max);
    let scaled = DVector::from_iterator(n, determined.iter().map(|&i| shift[i] / std(i)));
    let eigen = SymmetricEigen::new(correlation);
    let largest = eigen.eigenvalues.max();
    let (mut chi_square, mut degrees_of_freedom) = (0.0, 0_u32);
    for (value, vector) in eigen
        .eigenvalues
        .iter()
        .zip(eigen.eigenvectors.column_iter())
    {
        if *value > ROUNDING * largest {
            chi_square += vector.dot(&scaled).powi(2) / value;
            degrees_of_freedom += 1;
        }
    }
    let law = ChiSquared::new(f64::from(degrees_of_freedom)).ok()?;
    Some(JointTest {
        chi_square,
        degrees_of_freedom: degrees_of_freedom as usize,
        p_value: law.sf(chi_square),
        largest_correlation: most.min(1.0),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlated_estimates_differ_together_and_not_alone() {
        // Each shift is one standard deviation; the difference of the two is determined ten times better.
        let covariance = DMatrix::from_row_slice(2, 2, &[1.0, 0.995, 0.995, 1.0]);
        let apart = joint_test(&[1.0, -1.0], &covariance).unwrap();
        // (1, -1) is an eigenvector with the eigenvalue 0.005.
        assert!((apart.chi_square - 2.0 / 0.005).abs() < 1e-6, "{apart:?}");
        assert_eq!(apart.degrees_of_freedom, 2);
        assert!((apart.largest_correlation - 0.995).abs() < 1e-12);
        assert!(apart.rejects());
        let along = joint_test(&[1.0, 1.0], &covariance).unwrap();
        assert!((along.chi_square - 2.0 / 1.995).abs() < 1e-6, "{along:?}");
        assert!(!along.rejects());
    }

    #[test]
    fn scales_do_not_matter_and_what_is_not_determined_is_left_out() {
        let mut covariance = DMatrix::from_row_slice(2, 2, &[1e-12, 0.5e-3, 0.5e-3, 1e6]);
        let one = joint_test(&[2e-6, -1e3], &covariance).unwrap();
        let unit = DMatrix::from_row_slice(2, 2, &[1.0, 0.5, 0.5, 1.0]);
        let same = joint_test(&[2.0, -1.0], &unit).unwrap();
        assert!((one.chi_square - same.chi_square).abs() < 1e-9);
        covariance[(1, 1)] = f64::INFINITY;
        let alone = joint_test(&[2e-6, -1e3], &covariance).unwrap();
        assert_eq!(alone.degrees_of_freedom, 1);
        assert!((alone.chi_square - 4.0).abs() < 1e-9);
        covariance[(0, 0)] = 0.0;
        assert_eq!(joint_test(&[2e-6, -1e3], &covariance), None);
    }
}
