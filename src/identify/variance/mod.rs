//! The covariance of an estimate in closed form: what the methods of this folder's parent do to the noise, to first order.
//!
//! Of PBSID_opt it is van Wingerden's (41), written without any matrix as long as the record and checked against
//! the literal form to 1e-13. The terms beta of his Appendix B carry a **plus**: the residual is
//! `Ehat = E - E Pi_Z`, so its error is `-E Pi_Z`, and the printed minus of (B.2) and (B.4) is wrong. With a
//! predictor that is exactly nilpotent the propagation is an identity, which settles the sign
//! (`tests/library/literal_covariance.rs`).
//!
//! | file | what it holds |
//! |---|---|
//! | `subspace` | PBSID_opt |
//! | `nested_errors` | whitening filter and innovation estimation |
//! | `asymptotic` | the same for a known plant, noise and controller, for studies |
//! | `propagation` | errors as a linear function of white noise, which a stochastic step builds on |
//!
//! What follows from a covariance, whatever method it comes from, is [`covariance`](crate::covariance).

mod asymptotic;
mod nested_errors;
mod propagation;
mod subspace;

pub use asymptotic::{AsymptoticMethod, asymptotic_covariance};
pub(crate) use nested_errors::NestedErrors;
pub(super) use nested_errors::newest_first;
pub(crate) use propagation::Propagation;
#[cfg(feature = "cli")]
pub(crate) use subspace::jacobian_with_sign;
pub(crate) use subspace::subspace_propagation;
pub use subspace::{subspace_covariance, subspace_jacobian};
