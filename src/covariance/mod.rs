//! The covariance of the parameters, where it comes from and what follows from it.
//!
//! Everything that is reported is carried over from the parameters to first order (the delta method), with
//! gradients in closed form; where that is not to be trusted, models are drawn instead.
//!
//! Of PBSID_opt it is van Wingerden's (41), written without any matrix as long as the record and checked against
//! the literal form to 1e-13. The terms beta of his Appendix B carry a **plus**: the residual is
//! `Ehat = E - E Pi_Z`, so its error is `-E Pi_Z`, and the printed minus of (B.2) and (B.4) is wrong. With a
//! predictor that is exactly nilpotent the propagation is an identity, which settles the sign
//! (`tests/library/literal_covariance.rs`).
//!
//! | file | what it holds |
//! |---|---|
//! | `parameters` | [`ParameterCovariance`] and the order of the parameters |
//! | `subspace`, `nested`, `jackknife` | where the covariance comes from: the model (PBSID_opt; whitening filter and innovation estimation), or blocks of the data |
//! | `asymptotic` | the same for a known plant, noise and controller, for studies |
//! | `gradient` | the one form that all gradients have |
//! | `frequency_response`, `poles`, `zeros`, `response` | uncertainty of each invariant |
//! | `quantile` | from standard deviations to intervals, from covariances to ellipses |
//! | `bands` | confidence bands of magnitude and phase |
//! | `draws` | models drawn from the covariance |
//! | `document`, `invariants` | all of it for a JSON document |
//! | `error` | [`CovarianceError`] |

mod asymptotic;
mod bands;
mod document;
mod draws;
mod error;
#[cfg(test)]
mod fixtures;
mod frequency_response;
mod gradient;
mod invariants;
mod jackknife;
mod nested;
mod parameters;
mod poles;
mod quantile;
mod response;
mod subspace;
mod zeros;

pub use asymptotic::{AsymptoticMethod, asymptotic_covariance};
pub(crate) use bands::linear_band;
pub use bands::{
    BandMethod, DRAWS, LARGEST_RELATIVE_STD, ResponseBand, SMALLEST_POLE_DISTANCE, response_bands,
};
pub use document::{Invariants, ResponsePoint, Root, StaticGain, StepResponse};
pub use draws::draw_parameters;
pub use error::CovarianceError;
pub use frequency_response::{Path, frequency_response_covariance, noise_response_covariance};
pub use gradient::Covariance2;
pub(crate) use gradient::projected_variance;
pub use invariants::invariants;
pub(crate) use invariants::response_point;
pub use jackknife::jackknife_covariance;
pub use nested::NestedErrors;
pub(crate) use nested::newest_first;
pub use parameters::{ParameterCovariance, ParameterLayout};
pub(crate) use poles::{DEFECTIVE, continuous_stds};
pub use poles::{PoleUncertainty, pole_uncertainties};
pub use quantile::{ellipse_quantile, interval_quantile};
pub use response::{impulse_response_std, static_gain_std, step_response_std};
pub(crate) use subspace::jacobian_with_sign;
pub use subspace::{subspace_covariance, subspace_jacobian, subspace_propagation};
pub use zeros::zero_uncertainties;
