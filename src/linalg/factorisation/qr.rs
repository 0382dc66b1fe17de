//! Orthogonal factorisation and least squares.

use nalgebra::DMatrix;

use super::triangular::{reciprocal_condition_upper, solve_upper};
use crate::linalg::LinalgError;
use crate::linalg::exchange::{owned, view};
use crate::linalg::product::multiply_tn;

/// The `min(m, n) x n` upper triangular factor of an `m x n` matrix, rows signed so that the diagonal
/// is not negative (which makes it the Cholesky factor of the Gram matrix).
pub(crate) fn qr_r(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let factorisation = view(matrix).qr();
    let mut r = owned(factorisation.thin_R());
    for i in 0..r.nrows() {
        if r[(i, i)] < 0.0 {
            r.row_mut(i).neg_mut();
        }
        for j in 0..i {
            r[(i, j)] = 0.0;
        }
    }
    r
}

/// Thin `Q` (`m x k`) and `R` (`k x n`), `k = min(m, n)`.
pub(crate) fn qr_thin(matrix: &DMatrix<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
    let factorisation = view(matrix).qr();
    let mut r = owned(factorisation.thin_R());
    for i in 0..r.nrows() {
        for j in 0..i.min(r.ncols()) {
            r[(i, j)] = 0.0;
        }
    }
    (owned(factorisation.compute_thin_Q().as_ref()), r)
}

/// Minimises `|A X - B|` in the Frobenius norm for a tall `A` of full column rank.
///
/// # Errors
/// [`LinalgError::Singular`] when the columns of `A` are dependent to working precision.
pub(crate) fn least_squares(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
) -> Result<DMatrix<f64>, LinalgError> {
    let (q, r) = qr_thin(a);
    if r.nrows() < r.ncols() || reciprocal_condition_upper(&r) < f64::EPSILON {
        return Err(LinalgError::Singular {
            what: "least squares",
        });
    }
    Ok(solve_upper(&r, &multiply_tn(&q, b)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tall() -> DMatrix<f64> {
        DMatrix::from_fn(9, 3, |i, j| ((i * i + 3 * j * i + j) % 11) as f64 - 5.0)
    }

    #[test]
    fn r_is_the_cholesky_factor() {
        let a = tall();
        let r = qr_r(&a);
        let c = crate::linalg::cholesky_upper(&(a.transpose() * &a)).unwrap();
        approx::assert_relative_eq!(r, c, epsilon = 1e-12);
    }

    #[test]
    fn thin_factors_multiply_back() {
        let a = tall();
        let (q, r) = qr_thin(&a);
        approx::assert_relative_eq!(&q * &r, a, epsilon = 1e-12);
        approx::assert_relative_eq!(q.transpose() * &q, DMatrix::identity(3, 3), epsilon = 1e-12);
    }

    #[test]
    fn least_squares_residual_is_orthogonal() {
        let a = tall();
        let b = DMatrix::from_fn(9, 2, |i, j| (i as f64).sin() + j as f64);
        let x = least_squares(&a, &b).unwrap();
        let residual = &a * x - b;
        assert!((a.transpose() * residual).amax() < 1e-10);
    }

    #[test]
    fn dependent_columns_are_refused() {
        let mut a = tall();
        let copy = a.column(0).into_owned();
        a.set_column(2, &copy);
        assert!(least_squares(&a, &DMatrix::zeros(9, 1)).is_err());
    }
}
