//! What can go wrong in a factorisation, with the numbers that tell why.

/// Failure of a factorisation or of an equation solver.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LinalgError {
    /// The matrix handed to Cholesky is not positive definite to working precision.
    #[error("matrix of order {order} is not positive definite (pivot {index})")]
    NotPositiveDefinite {
        /// Order of the matrix.
        order: usize,
        /// Index of the first pivot that was not positive.
        index: usize,
    },
    /// An iteration inside the factorisation did not converge.
    #[error("{what} of a {rows} x {columns} matrix did not converge")]
    NoConvergence {
        /// Name of the factorisation.
        what: &'static str,
        /// Rows of the matrix.
        rows: usize,
        /// Columns of the matrix.
        columns: usize,
    },
    /// The matrix holds a NaN or an infinity.
    #[error("{what}: the matrix holds a value that is not finite")]
    NotFinite {
        /// Name of the operation.
        what: &'static str,
    },
    /// A Lyapunov equation was asked of a matrix that is not stable.
    #[error(
        "a discrete Lyapunov equation needs a stable matrix; its spectral radius is {spectral_radius:.6}"
    )]
    NotStable {
        /// Largest modulus of the eigenvalues.
        spectral_radius: f64,
    },
    /// A matrix that has to be inverted is singular to working precision.
    #[error("{what}: matrix is singular to working precision")]
    Singular {
        /// Name of the operation.
        what: &'static str,
    },
}
