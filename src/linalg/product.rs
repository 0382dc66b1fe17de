//! Matrix products.

use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};
use nalgebra::DMatrix;

use super::exchange::view;

fn product(a: MatRef<'_, f64>, b: MatRef<'_, f64>) -> DMatrix<f64> {
    let (rows, columns) = (a.nrows(), b.ncols());
    let mut out = DMatrix::zeros(rows, columns);
    matmul(
        MatMut::from_column_major_slice_mut(out.as_mut_slice(), rows, columns),
        Accum::Replace,
        a,
        b,
        1.0,
        Par::Seq,
    );
    out
}

/// `A B`.
pub(crate) fn multiply(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    product(view(a), view(b))
}

/// `A' B`.
pub(crate) fn multiply_tn(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    product(view(a).transpose(), view(b))
}

/// `A B'`.
pub(crate) fn multiply_nt(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    product(view(a), view(b).transpose())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_agree_with_nalgebra() {
        let a = DMatrix::from_fn(5, 3, |i, j| (i * 3 + j) as f64 - 4.0);
        let b = DMatrix::from_fn(3, 4, |i, j| (i as f64 - j as f64) * 0.5);
        approx::assert_relative_eq!(multiply(&a, &b), &a * &b);
        approx::assert_relative_eq!(multiply_tn(&a, &a), a.transpose() * &a);
        approx::assert_relative_eq!(multiply_nt(&a, &a), &a * a.transpose());
    }
}
