//! Singular value decomposition.

use nalgebra::{DMatrix, DVector};

use crate::linalg::LinalgError;
use crate::linalg::exchange::{owned, view};
use crate::linalg::finite::all_finite;

/// Thin singular value decomposition `A = U diag(s) V'`, singular values in decreasing order.
#[derive(Debug, Clone)]
pub(crate) struct Svd {
    /// Left singular vectors, `m x k`.
    pub(crate) u: DMatrix<f64>,
    /// Singular values, `k`, decreasing.
    pub(crate) values: DVector<f64>,
    /// Right singular vectors, `n x k` (not transposed).
    pub(crate) v: DMatrix<f64>,
}

/// Thin singular value decomposition.
///
/// # Errors
/// [`LinalgError::NotFinite`] for a matrix with NaN or infinity, [`LinalgError::NoConvergence`].
pub(crate) fn svd_thin(matrix: &DMatrix<f64>) -> Result<Svd, LinalgError> {
    if !all_finite(matrix) {
        return Err(LinalgError::NotFinite {
            what: "singular value decomposition",
        });
    }
    let svd = view(matrix)
        .thin_svd()
        .map_err(|_| LinalgError::NoConvergence {
            what: "singular value decomposition",
            rows: matrix.nrows(),
            columns: matrix.ncols(),
        })?;
    let values = svd.S().column_vector();
    Ok(Svd {
        u: owned(svd.U()),
        values: DVector::from_fn(values.nrows(), |i, _| values[i]),
        v: owned(svd.V()),
    })
}

/// Moore-Penrose inverse; singular values below `relative_tolerance` times the largest count as zero.
///
/// # Errors
/// As `svd_thin`.
pub fn pseudo_inverse(
    matrix: &DMatrix<f64>,
    relative_tolerance: f64,
) -> Result<DMatrix<f64>, LinalgError> {
    let Svd { u, values, mut v } = svd_thin(matrix)?;
    let smallest = values.iter().fold(0.0_f64, |a, &b| a.max(b)) * relative_tolerance;
    for (j, &value) in values.iter().enumerate() {
        let scale = if value > smallest { 1.0 / value } else { 0.0 };
        v.column_mut(j).scale_mut(scale);
    }
    Ok(v * u.transpose())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_multiply_back_and_decrease() {
        let a = DMatrix::from_fn(4, 6, |i, j| ((i * 7 + j * 5) % 9) as f64 - 4.0);
        let svd = svd_thin(&a).unwrap();
        let back = &svd.u * DMatrix::from_diagonal(&svd.values) * svd.v.transpose();
        approx::assert_relative_eq!(back, a, epsilon = 1e-12);
        assert!(svd.values.as_slice().windows(2).all(|w| w[0] >= w[1]));
    }

    #[test]
    fn pseudo_inverse_of_singular_matrix() {
        let a = DMatrix::from_row_slice(3, 2, &[1.0, 2.0, 2.0, 4.0, 3.0, 6.0]);
        let p = pseudo_inverse(&a, 1e-12).unwrap();
        approx::assert_relative_eq!(&a * &p * &a, a, epsilon = 1e-12);
        approx::assert_relative_eq!(&p * &a * &p, p, epsilon = 1e-12);
    }

    #[test]
    fn not_a_number_is_an_error() {
        let a = DMatrix::from_element(2, 2, f64::NAN);
        assert!(svd_thin(&a).is_err());
    }
}
