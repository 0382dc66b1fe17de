//! The covariance of the parameters, and what follows from it.
//!
//! Everything that is reported is carried over from the parameters to first order (the delta method), with
//! gradients in closed form; where that is not to be trusted, models are drawn instead.
//!
//! The methods bring their covariance along (`identify::variance`); here is what holds for all of them.
//!
//! | file | what it holds |
//! |---|---|
//! | `parameters` | [`ParameterCovariance`] and the order of the parameters |
//! | `jackknife` | the covariance from blocks of the data, for any method |
//! | `delta_method` | gradients, and the uncertainty of each invariant that follows from them |
//! | `quantile` | from standard deviations to intervals, from covariances to ellipses |
//! | `bands` | confidence bands of magnitude and phase |
//! | `draws` | models drawn from the covariance |
//! | `invariants_document`, `invariants` | all of it for a JSON document |
//! | `residual_budget` | how much of a record the effect on residuals is averaged over |
//! | `covariance_error` | [`CovarianceError`] |

mod bands;
mod covariance_error;
mod delta_method;
mod draws;
mod invariants;
mod invariants_document;
mod jackknife;
mod parameters;
mod quantile;
mod residual_budget;
#[cfg(test)]
mod test_covariances;

pub(crate) use bands::linear_band;
pub use bands::{BandMethod, ResponseBand, response_bands};
pub use covariance_error::CovarianceError;
pub use delta_method::{
    Covariance2, Path, PoleUncertainty, frequency_response_covariance, impulse_response_std,
    noise_response_covariance, pole_uncertainties, static_gain_std, step_response_std,
    zero_uncertainties,
};
pub(crate) use delta_method::{DEFECTIVE, continuous_stds, projected_variance};
pub use invariants::invariants;
pub(crate) use invariants::response_point;
pub use invariants_document::{Invariants, ResponsePoint, Root, StaticGain, StepResponse};
pub(crate) use jackknife::jackknife_covariance;
pub use parameters::{ParameterCovariance, ParameterLayout};
pub use quantile::{ellipse_quantile, interval_quantile};
pub(crate) use residual_budget::{MOST_LAGS, numbers_of_tests, samples_followed};
