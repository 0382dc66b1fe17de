//! Upper triangular factor of a symmetric matrix.

use faer::Side;
use faer::linalg::cholesky::llt::factor::LltError;
use nalgebra::DMatrix;

use super::eigen::symmetric_eigen;
use super::error::LinalgError;
use super::exchange::view;

/// Upper triangular `R` with positive diagonal and `R' R = G`, for symmetric positive definite `G`.
///
/// # Errors
/// [`LinalgError::NotPositiveDefinite`] with the index of the failing pivot.
pub fn cholesky_upper(gram: &DMatrix<f64>) -> Result<DMatrix<f64>, LinalgError> {
    let order = gram.nrows();
    let factor = view(gram).llt(Side::Lower).map_err(|error| match error {
        LltError::NonPositivePivot { index } => LinalgError::NotPositiveDefinite { order, index },
    })?;
    let lower = factor.L();
    Ok(DMatrix::from_fn(order, order, |i, j| {
        if i <= j { lower[(j, i)] } else { 0.0 }
    }))
}

/// A factor `F` with `F F' = S` for a symmetric positive *semi*definite `S` (negative eigenvalues,
/// which only rounding can cause, are taken as zero). Used to draw from a singular normal law.
///
/// # Errors
/// [`LinalgError::NoConvergence`] or [`LinalgError::NotFinite`].
pub fn symmetric_square_root_factor(matrix: &DMatrix<f64>) -> Result<DMatrix<f64>, LinalgError> {
    let mut eigen = symmetric_eigen(matrix)?;
    for (j, value) in eigen.values.iter().enumerate() {
        let scale = value.max(0.0).sqrt();
        eigen.vectors.column_mut(j).scale_mut(scale);
    }
    Ok(eigen.vectors)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factor_reproduces_gram() {
        let a = DMatrix::from_fn(7, 4, |i, j| ((i * 5 + j * 3) % 7) as f64 - 2.5);
        let gram = a.transpose() * &a;
        let r = cholesky_upper(&gram).unwrap();
        approx::assert_relative_eq!(r.transpose() * &r, gram, epsilon = 1e-12);
        assert!((0..4).all(|i| r[(i, i)] > 0.0));
    }

    #[test]
    fn indefinite_matrix_names_its_pivot() {
        let gram = DMatrix::from_diagonal(&nalgebra::dvector![1.0, 2.0, -1.0]);
        assert_eq!(
            cholesky_upper(&gram),
            Err(LinalgError::NotPositiveDefinite { order: 3, index: 2 })
        );
    }

    #[test]
    fn square_root_of_singular_matrix() {
        let v = nalgebra::dvector![1.0, -2.0, 3.0];
        let s = &v * v.transpose();
        let f = symmetric_square_root_factor(&s).unwrap();
        approx::assert_relative_eq!(&f * f.transpose(), s, epsilon = 1e-12);
    }
}
