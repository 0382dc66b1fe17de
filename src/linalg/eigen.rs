//! Eigenvalue problems.

use faer::Side;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;

use super::error::LinalgError;
use super::exchange::{owned, view};

/// Eigenvalues of a real matrix with right and left eigenvectors.
#[derive(Debug, Clone)]
pub struct Eigen {
    /// Eigenvalues.
    pub values: Vec<Complex64>,
    /// Right eigenvectors as columns: `A v = lambda v`.
    pub right: DMatrix<Complex64>,
    /// Left eigenvectors as rows, scaled so that `w v = 1`: `w A = lambda w`.
    pub left: DMatrix<Complex64>,
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
    if matrix.iter().all(|v| v.is_finite()) {
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
pub fn eigenvalues(matrix: &DMatrix<f64>) -> Result<Vec<Complex64>, LinalgError> {
    check_finite(matrix, "eigenvalues")?;
    if matrix.is_empty() {
        return Ok(Vec::new());
    }
    let values = view(matrix)
        .eigenvalues()
        .map_err(|_| no_convergence(matrix))?;
    Ok(values.iter().map(|v| Complex64::new(v.re, v.im)).collect())
}

/// Largest modulus of the eigenvalues (0 for an empty matrix).
///
/// # Errors
/// As [`eigenvalues`].
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
pub fn eigen(matrix: &DMatrix<f64>) -> Result<Eigen, LinalgError> {
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
        values: (0..n)
            .map(|i| Complex64::new(values[i].re, values[i].im))
            .collect(),
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

/// Generalised eigenvalues of the pencil `A - lambda B`, as pairs `(alpha, beta)` with
/// `lambda = alpha / beta`; `beta = 0` stands for an eigenvalue at infinity. The columns of the matrix
/// are the right eigenvectors.
///
/// # Errors
/// [`LinalgError::NotFinite`] or [`LinalgError::NoConvergence`].
pub fn generalised_eigen(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
) -> Result<(Vec<(Complex64, Complex64)>, DMatrix<Complex64>), LinalgError> {
    check_finite(a, "generalised eigenvalues")?;
    check_finite(b, "generalised eigenvalues")?;
    let n = a.nrows();
    let decomposition = view(a)
        .generalized_eigen(view(b))
        .map_err(|_| no_convergence(a))?;
    let alpha = decomposition.S_a().column_vector();
    let beta = decomposition.S_b().column_vector();
    let vectors = decomposition.U();
    let convert = |v: &faer::c64| Complex64::new(v.re, v.im);
    Ok((
        (0..n)
            .map(|i| (convert(&alpha[i]), convert(&beta[i])))
            .collect(),
        DMatrix::from_fn(n, n, |i, j| convert(&vectors[(i, j)])),
    ))
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
    fn generalised_pairs_solve_the_pencil() {
        let a = DMatrix::from_row_slice(2, 2, &[1.0, 2.0, 3.0, 4.0]);
        let b = DMatrix::from_row_slice(2, 2, &[1.0, 0.5, 0.0, 0.0]);
        let (pairs, vectors) = generalised_eigen(&a, &b).unwrap();
        assert!(pairs.iter().any(|(_, beta)| beta.norm() < 1e-12));
        for (j, (alpha, beta)) in pairs.iter().enumerate() {
            let v = vectors.column(j);
            let residual = complexify(&a) * v * *beta - complexify(&b) * v * *alpha;
            assert!(residual.norm() < 1e-10);
        }
    }
}
