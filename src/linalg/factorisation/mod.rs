//! Factorisations: Cholesky, QR, singular values, eigenvalues; and solves with a triangular factor.

mod cholesky;
mod eigen;
mod qr;
mod singular;
mod triangular;

pub use cholesky::{cholesky_upper, symmetric_square_root_factor};
pub use eigen::{
    Eigen, SymmetricEigen, eigen, eigenvalues, generalised_eigenvalues, spectral_radius,
    symmetric_eigen,
};
pub use qr::{least_squares, qr_r, qr_thin};
pub use singular::{Svd, pseudo_inverse, svd_thin};
pub use triangular::{
    reciprocal_condition_upper, solve_upper, solve_upper_right, solve_upper_transposed,
};
