//! Dense linear algebra: the only place that names [`faer`].
//!
//! Every function takes and returns `nalgebra::DMatrix<f64>`, the exchange type of the crate, and hides
//! faer's generics behind a non-generic function, so that they are compiled once, here. All
//! factorisations run on the calling thread: parallelism belongs outside, over panels, frequencies,
//! candidates or Monte Carlo runs, where it does not multiply the work.
//!
//! | file | what it holds |
//! |---|---|
//! | `product` | matrix products |
//! | `triangular` | solves with, and the condition of, a triangular factor |
//! | `cholesky` | upper triangular factor of a Gram matrix |
//! | `qr` | orthogonal factorisation and least squares |
//! | `rows` | a matrix in a document, as an array of rows |
//! | `singular` | thin singular value decomposition, pseudo-inverse |
//! | `eigen` | ordinary, symmetric and generalised eigenvalue problems |
//! | `finite` | whether numbers are numbers |
//! | `logarithm` | logarithm and exponential of small matrices |
//! | `lyapunov` | discrete Lyapunov equation, stabilising observer gain |
//! | `riccati` | stationary Kalman filter |

mod cholesky;
mod eigen;
mod error;
mod exchange;
mod finite;
mod logarithm;
mod lyapunov;
mod product;
mod qr;
mod riccati;
mod rows;
mod singular;
mod triangular;

pub use cholesky::{cholesky_upper, symmetric_square_root_factor};
pub use eigen::{
    Eigen, SymmetricEigen, eigen, eigenvalues, generalised_eigenvalues, spectral_radius,
    symmetric_eigen,
};
pub use error::LinalgError;
pub use finite::all_finite;
pub use logarithm::{exponential, logarithm};
pub use lyapunov::{discrete_lyapunov, stabilising_observer_gain};
pub use product::{multiply, multiply_nt, multiply_tn};
pub use qr::{least_squares, qr_r, qr_thin};
pub use riccati::{StationaryFilter, stationary_filter};
pub use rows::Rows;
pub use singular::{Svd, pseudo_inverse, svd_thin};
pub use triangular::{
    reciprocal_condition_upper, solve_upper, solve_upper_right, solve_upper_transposed,
};
