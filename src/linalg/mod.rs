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
//! | `factorisation` | Cholesky, QR and least squares, singular values, eigenvalues, solves with a triangular factor |
//! | `rows` | a matrix in a document, as an array of rows |
//! | `finite` | whether numbers are numbers |
//! | `logarithm` | logarithm and exponential of small matrices |
//! | `lyapunov` | discrete Lyapunov equation, stabilising observer gain |
//! | `riccati` | stationary Kalman filter |

mod exchange;
mod factorisation;
mod finite;
mod linalg_error;
mod logarithm;
mod lyapunov;
mod product;
mod riccati;
mod rows;

pub use factorisation::{
    Eigen, Svd, SymmetricEigen, cholesky_upper, eigen, eigenvalues, generalised_eigenvalues,
    least_squares, pseudo_inverse, qr_r, qr_thin, reciprocal_condition_upper, solve_upper,
    solve_upper_right, solve_upper_transposed, spectral_radius, svd_thin, symmetric_eigen,
    symmetric_square_root_factor,
};
pub use finite::all_finite;
pub use linalg_error::LinalgError;
pub use logarithm::{exponential, logarithm};
pub use lyapunov::{discrete_lyapunov, stabilising_observer_gain};
pub use product::{multiply, multiply_nt, multiply_tn};
pub use riccati::{StationaryFilter, stationary_filter};
pub use rows::Rows;
