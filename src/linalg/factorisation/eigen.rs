//! Eigenvalue problems.

use faer::Side;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;

use crate::linalg::LinalgError;
use crate::linalg::exchange::{owned, view};
use crate::linalg::finite::all_finite;

/// Eigenvalues of a real matrix with right and left eigenvectors.
#[derive(Debug, Clone)]
pub(crate) struct Eigen {
    /// Eigenvalues.
    pub(crate) values: Vec<Complex64>,
    /// Right eigenvectors as columns: `A v = lambda v`.
    pub(crate) right: DMatrix<Complex64>,
    /// Left eigenvectors as rows, scaled so that `w v = 1`: `w A = lambda w`.
    pub(crate) left: DMatrix<Complex64>,
}

/// Eigenvalues and orthonormal eigenvectors of a symmetric matrix, values in increasing order.
#[derive(Debug, Clone)]
pub struct SymmetricEigen {
    /// Eigenvalues, increasing.
    pub values: DVector<f64>,
    /// Eigenvectors as columns.
    pub vectors: DMatrix<f64>,
}

fn check_finite(matrix: &DMatrix<f64>, what: &'static str) -> Result<(), LinalgError> {
    if all_finite(matrix) {
        Ok(())
    } else {
        Err(LinalgError::NotFinite { what })
    }
}

fn no_convergence(matrix: &DMatrix<f64>) -> LinalgError {
    LinalgError::NoConvergence {
        what: "eigenvalue decomposition",
        rows: matrix.nrows(),
        columns: matrix.ncols(),
    }
}

/// Eigenvalues of a real square matrix.
///
/// # Errors
/// [`LinalgError::NotFinite`] or [`LinalgError::NoConvergence`].
pub(crate) fn eigenvalues(matrix: &DMatrix<f64>) -> Result<Vec<Complex64>, LinalgError> {
    check_finite(matrix, "eigenvalues")?;
    if matrix.is_empty() {
        return Ok(Vec::new());
    }
    let values = view(matrix)
        .eigenvalues()
        .map_err(|_| no_convergence(matrix))?;
    numbers(matrix, values.iter().map(|v| Complex64::new(v.re, v.im)))
}

/// Eigenvalues, unless entries far apart in size took them out of the range of numbers.
fn numbers(
    matrix: &DMatrix<f64>,
    values: impl Iterator<Item = Complex64>,
) -> Result<Vec<Complex64>, LinalgError> {
    let values: Vec<Complex64> = values.collect();
    if values.iter().all(|v| v.is_finite()) {
        Ok(values)
    } else {
        Err(no_convergence(matrix))
    }
}

/// Largest modulus of the eigenvalues (0 for an empty matrix).
///
/// # Errors
/// As `eigenvalues`.
pub fn spectral_radius(matrix: &DMatrix<f64>) -> Result<f64, LinalgError> {
    Ok(eigenvalues(matrix)?
        .iter()
        .map(|v| v.norm())
        .fold(0.0, f64::max))
}

/// Eigenvalues with right and left eigenvectors of a real square matrix.
///
/// # Errors
/// [`LinalgError::Singular`] when the matrix is defective to working precision (a multiple eigenvalue
/// without its own eigenvectors), [`LinalgError::NotFinite`] or [`LinalgError::NoConvergence`].
pub(crate) fn eigen(matrix: &DMatrix<f64>) -> Result<Eigen, LinalgError> {
    check_finite(matrix, "eigenvectors")?;
    let n = matrix.nrows();
    if n == 0 {
        return Ok(Eigen {
            values: Vec::new(),
            right: DMatrix::zeros(0, 0),
            left: DMatrix::zeros(0, 0),
        });
    }
    let decomposition = view(matrix).eigen().map_err(|_| no_convergence(matrix))?;
    let values = decomposition.S().column_vector();
    let vectors = decomposition.U();
    let right = DMatrix::from_fn(n, n, |i, j| {
        Complex64::new(vectors[(i, j)].re, vectors[(i, j)].im)
    });
    let left = right.clone().try_inverse().ok_or(LinalgError::Singular {
        what: "eigenvectors of a defective matrix",
    })?;
    Ok(Eigen {
        values: numbers(
            matrix,
            (0..n).map(|i| Complex64::new(values[i].re, values[i].im)),
        )?,
        right,
        left,
    })
}

/// Eigenvalues and vectors of a symmetric matrix (its lower triangle is read).
///
/// # Errors
/// [`LinalgError::NotFinite`] or [`LinalgError::NoConvergence`].
pub fn symmetric_eigen(matrix: &DMatrix<f64>) -> Result<SymmetricEigen, LinalgError> {
    check_finite(matrix, "symmetric eigenvalues")?;
    let decomposition = view(matrix)
        .self_adjoint_eigen(Side::Lower)
        .map_err(|_| no_convergence(matrix))?;
    let values = decomposition.S().column_vector();
    Ok(SymmetricEigen {
        values: DVector::from_fn(values.nrows(), |i, _| values[i]),
        vectors: owned(decomposition.U()),
    })
}

/// The generalised eigenvalue routine of faer 0.24 asks for too little workspace below this order, and
/// panics; smaller pencils are filled up with eigenvalues at infinity.
const SMALLEST_PENCIL: usize = 4;

/// Finite and infinite generalised eigenvalues of the pencil `A - lambda B`, as pairs `(alpha, beta)` with
/// `lambda = alpha / beta`; `beta` near zero stands for an eigenvalue at infinity.
///
/// # Errors
/// [`LinalgError::NotFinite`] or [`LinalgError::NoConvergence`].
pub(crate) fn generalised_eigenvalues(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
) -> Result<Vec<(Complex64, Complex64)>, LinalgError> {
    check_finite(a, "generalised eigenvalues")?;
    check_finite(b, "generalised eigenvalues")?;
    let n = a.nrows();
    let order = n.max(SMALLEST_PENCIL);
    let mut left = DMatrix::identity(order, order);
    left.view_mut((0, 0), (n, n)).copy_from(a);
    let right = b.clone().resize(order, order, 0.0);
    let decomposition = view(&left)
        .generalized_eigen(view(&right))
        .map_err(|_| no_convergence(a))?;
    let alpha = decomposition.S_a().column_vector();
    let beta = decomposition.S_b().column_vector();
    let convert = |v: &faer::c64| Complex64::new(v.re, v.im);
    let mut pairs: Vec<(Complex64, Complex64)> = (0..order)
        .map(|i| (convert(&alpha[i]), convert(&beta[i])))
        .collect();
    // Those that were filled in are the farthest out.
    pairs.sort_by(|x, y| (x.0.norm() * y.1.norm()).total_cmp(&(y.0.norm() * x.1.norm())));
    pairs.truncate(n);
    Ok(pairs)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn complexify(m: &DMatrix<f64>) -> DMatrix<Complex64> {
        m.map(|v| Complex64::new(v, 0.0))
    }

    #[test]
    fn left_and_right_vectors_diagonalise() {
        let a = DMatrix::from_row_slice(3, 3, &[0.6, 0.5, 0.1, -0.5, 0.6, 0.3, 0.0, 0.2, -0.4]);
        let e = eigen(&a).unwrap();
        let d = &e.left * complexify(&a) * &e.right;
        for i in 0..3 {
            for j in 0..3 {
                let expected = if i == j {
                    e.values[i]
                } else {
                    Complex64::default()
                };
                assert!((d[(i, j)] - expected).norm() < 1e-12);
            }
        }
        assert!(
            (spectral_radius(&a).unwrap() - e.values.iter().map(|v| v.norm()).fold(0.0, f64::max))
                .abs()
                < 1e-12
        );
    }

    #[test]
    fn generalised_pairs_solve_the_pencil_at_any_order() {
        for n in 1..7 {
            let a = DMatrix::from_fn(n, n, |i, j| ((i * 5 + j * 3) % 7) as f64 - 2.0);
            // One eigenvalue at infinity: the last row of B vanishes.
            let b = DMatrix::from_fn(n, n, |i, j| {
                if i + 1 == n {
                    0.0
                } else {
                    ((i * 2 + j * 7) % 5) as f64 + f64::from(i == j)
                }
            });
            let pairs = generalised_eigenvalues(&a, &b).unwrap();
            assert_eq!(pairs.len(), n);
            let infinite =
                |(alpha, beta): &(Complex64, Complex64)| beta.norm() < 1e-12 * alpha.norm();
            assert!(pairs.iter().any(infinite), "order {n}");
            for (alpha, beta) in pairs {
                let pencil = complexify(&a) * beta - complexify(&b) * alpha;
                let smallest = pencil.clone().svd(false, false).singular_values.min();
                let scale = a.norm() * beta.norm() + b.norm() * alpha.norm();
                assert!(smallest <= 1e-10 * scale, "order {n}: {smallest:e}");
            }
        }
    }
}
