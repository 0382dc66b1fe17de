//! Views and copies between `nalgebra` (what users see) and `faer` (what computes).

use faer::MatRef;
use nalgebra::DMatrix;

/// Column-major view, no copy.
pub(super) fn view(matrix: &DMatrix<f64>) -> MatRef<'_, f64> {
    MatRef::from_column_major_slice(matrix.as_slice(), matrix.nrows(), matrix.ncols())
}

/// Copy back.
pub(super) fn owned(matrix: MatRef<'_, f64>) -> DMatrix<f64> {
    DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| matrix[(i, j)])
}
