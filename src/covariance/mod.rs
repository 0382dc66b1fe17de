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
//! | `gradient` | the one form that all gradients have |
//! | `frequency_response`, `poles`, `zeros`, `response` | uncertainty of each invariant |
//! | `quantile` | from standard deviations to intervals, from covariances to ellipses |
//! | `bands` | confidence bands of magnitude and phase |
//! | `draws` | models drawn from the covariance |
//! | `document`, `invariants` | all of it for a JSON document |
//! | `residual_budget` | how much of a record the effect on residuals is averaged over |
//! | `error` | [`CovarianceError`] |

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
mod parameters;
mod poles;
mod quantile;
mod residual_budget;
mod response;
mod zeros;

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
pub use parameters::{ParameterCovariance, ParameterLayout};
pub(crate) use poles::{DEFECTIVE, continuous_stds};
pub use poles::{PoleUncertainty, pole_uncertainties};
pub use quantile::{ellipse_quantile, interval_quantile};
pub(crate) use residual_budget::{MOST_LAGS, numbers_of_tests, samples_followed};
pub use response::{impulse_response_std, static_gain_std, step_response_std};
pub use zeros::zero_uncertainties;
