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

pub(crate) use factorisation::{
    Svd, eigen, eigenvalues, generalised_eigenvalues, least_squares, qr_r, qr_thin,
    reciprocal_condition_upper, solve_upper, solve_upper_right, svd_thin,
};
pub use factorisation::{
    cholesky_upper, pseudo_inverse, solve_upper_transposed, spectral_radius, symmetric_eigen,
    symmetric_square_root_factor,
};
pub(crate) use finite::all_finite;
pub use linalg_error::LinalgError;
pub(crate) use logarithm::{exponential, logarithm};
pub use lyapunov::discrete_lyapunov;
pub(crate) use lyapunov::stabilising_observer_gain;
pub(crate) use product::{multiply, multiply_nt, multiply_tn};
pub(crate) use riccati::stationary_filter;
pub use rows::Rows;
