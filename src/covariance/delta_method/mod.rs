//! First-order propagation: gradients, and the uncertainty of responses, poles and zeros that follows.

mod frequency_response;
mod gradient;
mod pole_uncertainty;
mod response_std;
mod zero_uncertainty;

pub(crate) use frequency_response::path_covariance;
pub use frequency_response::{Path, frequency_response_covariance, noise_response_covariance};
pub use gradient::Covariance2;
pub(crate) use gradient::{longest_axis, projected_variance};
pub(crate) use pole_uncertainty::{DEFECTIVE, continuous_stds};
pub use pole_uncertainty::{PoleUncertainty, pole_uncertainties};
pub(crate) use response_std::step_response_std_at;
pub use response_std::{impulse_response_std, static_gain_std, step_response_std};
pub use zero_uncertainty::zero_uncertainties;
