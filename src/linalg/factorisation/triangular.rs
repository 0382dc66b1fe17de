//! Solves with an upper triangular factor, and its condition.

use faer::linalg::triangular_solve::{
    solve_lower_triangular_in_place, solve_upper_triangular_in_place,
};
use faer::{MatMut, Par};
use nalgebra::{DMatrix, DVector};

use crate::linalg::exchange::view;

/// `R^-1 B` for upper triangular `R` (what lies below its diagonal is not read).
pub(crate) fn solve_upper(r: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let mut x = b.clone();
    let (rows, columns) = x.shape();
    solve_upper_triangular_in_place(
        view(r),
        MatMut::from_column_major_slice_mut(x.as_mut_slice(), rows, columns),
        Par::Seq,
    );
    x
}

/// `R'^-1 B` for upper triangular `R`.
pub fn solve_upper_transposed(r: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let mut x = b.clone();
    let (rows, columns) = x.shape();
    solve_lower_triangular_in_place(
        view(r).transpose(),
        MatMut::from_column_major_slice_mut(x.as_mut_slice(), rows, columns),
        Par::Seq,
    );
    x
}

/// `B R^-1` for upper triangular `R`.
pub(crate) fn solve_upper_right(b: &DMatrix<f64>, r: &DMatrix<f64>) -> DMatrix<f64> {
    solve_upper_transposed(r, &b.transpose()).transpose()
}

/// Estimate of `1 / (|R|_1 |R^-1|_1)`, zero when the diagonal has a zero.
///
/// The norm of the inverse is estimated from a few solves (Hager 1984, Higham 1988), which is what
/// LAPACK's `dtrcon` reports; the estimate is a lower bound of the norm, almost always within a factor
/// of three.
pub(crate) fn reciprocal_condition_upper(r: &DMatrix<f64>) -> f64 {
    let n = r.nrows();
    if n == 0 {
        return 1.0;
    }
    if (0..n).any(|i| r[(i, i)] == 0.0 || !r[(i, i)].is_finite()) {
        return 0.0;
    }
    let norm = (0..n)
        .map(|j| r.column(j).iter().take(j + 1).map(|v| v.abs()).sum::<f64>())
        .fold(0.0, f64::max);
    let mut x = DMatrix::from_element(n, 1, 1.0 / n as f64);
    let mut estimate = 0.0;
    let mut last = usize::MAX;
    for _ in 0..5 {
        let y = solve_upper(r, &x);
        let size: f64 = y.iter().map(|v| v.abs()).sum();
        if !size.is_finite() {
            return 0.0;
        }
        if size <= estimate {
            break;
        }
        estimate = size;
        let sign = y.map(|v| if v >= 0.0 { 1.0 } else { -1.0 });
        let z = solve_upper_transposed(r, &sign);
        let index = DVector::from_column_slice(z.as_slice()).icamax();
        if index == last {
            break;
        }
        last = index;
        x.fill(0.0);
        x[(index, 0)] = 1.0;
    }
    1.0 / (norm * estimate)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn factor() -> DMatrix<f64> {
        DMatrix::from_row_slice(3, 3, &[2.0, -1.0, 0.5, 0.0, 1e-3, 3.0, 0.0, 0.0, -4.0])
    }

    #[test]
    fn solves_invert_products() {
        let r = factor();
        let b = DMatrix::from_fn(3, 2, |i, j| (i + 2 * j) as f64 - 1.0);
        approx::assert_relative_eq!(&r * solve_upper(&r, &b), b, epsilon = 1e-9);
        approx::assert_relative_eq!(
            r.transpose() * solve_upper_transposed(&r, &b),
            b,
            epsilon = 1e-9
        );
        let c = b.transpose();
        approx::assert_relative_eq!(solve_upper_right(&c, &r) * &r, c, epsilon = 1e-9);
    }

    #[test]
    fn condition_is_that_of_the_explicit_inverse() {
        let r = factor();
        let one_norm = |m: &DMatrix<f64>| {
            m.column_iter()
                .map(|c| c.iter().map(|v| v.abs()).sum::<f64>())
                .fold(0.0, f64::max)
        };
        let inverse = r.clone().try_inverse().unwrap();
        let exact = 1.0 / (one_norm(&r) * one_norm(&inverse));
        approx::assert_relative_eq!(reciprocal_condition_upper(&r), exact, max_relative = 1e-9);
    }
}
