//! Factorisations: Cholesky, QR, singular values, eigenvalues; and solves with a triangular factor.

mod cholesky;
mod eigen;
mod qr;
mod singular;
mod triangular;

pub use cholesky::{cholesky_upper, symmetric_square_root_factor};
pub(crate) use eigen::{eigen, eigenvalues, generalised_eigenvalues};
pub use eigen::{spectral_radius, symmetric_eigen};
pub(crate) use qr::{least_squares, qr_r, qr_thin};
pub use singular::pseudo_inverse;
pub(crate) use singular::{Svd, svd_thin};
pub use triangular::solve_upper_transposed;
pub(crate) use triangular::{reciprocal_condition_upper, solve_upper, solve_upper_right};
