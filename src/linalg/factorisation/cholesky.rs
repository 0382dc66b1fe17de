//! Upper triangular factor of a symmetric matrix.

use faer::Side;
use faer::linalg::cholesky::llt::factor::LltError;
use nalgebra::DMatrix;

use super::eigen::symmetric_eigen;
use crate::linalg::LinalgError;
use crate::linalg::exchange::view;

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
#[path = "tests/cholesky_tests.rs"]
mod tests;
