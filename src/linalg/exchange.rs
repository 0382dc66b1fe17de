//! Views and copies between `nalgebra` (what users see) and `faer` (what computes).

use faer::MatRef;
use nalgebra::DMatrix;

/// Column-major view, no copy.
pub(super) fn view(matrix: &DMatrix<f64>) -> MatRef<'_, f64> {
    MatRef::from_column_major_slice(matrix.as_slice(), matrix.nrows(), matrix.ncols())
}

/// Copy back.
pub(super) fn owned(matrix: MatRef<'_, f64>) -> DMatrix<f64> {
    let mut values = Vec::with_capacity(matrix.nrows() * matrix.ncols());
    for j in 0..matrix.ncols() {
        values.extend(matrix.col(j).iter().copied());
    }
    DMatrix::from_vec(matrix.nrows(), matrix.ncols(), values)
}
