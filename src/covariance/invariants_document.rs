//! The part of a model document that does not depend on the state basis.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::bands::BandMethod;
use super::delta_method::Covariance2;
use crate::model::Armax;

/// Everything about a model that does not depend on the state basis, with its uncertainty.
///
/// What has no value is `null`: uncertainties of a model without covariance, the time constant of an
/// integrator, a response at a pole. No number is ever NaN or infinite.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Invariants {
    /// Poles, slowest first.
    pub poles: Vec<Root>,
    /// Invariant zeros from inputs to outputs, largest modulus first.
    pub zeros: Vec<Root>,
    /// Response from each input to each output at each frequency.
    pub frequency_response: Vec<ResponsePoint>,
    /// Response from each innovation to each output at each frequency; empty for a model without noise model
    /// (`K = 0` and no covariance), where it is one on the diagonal. The innovation of output `y` is called
    /// `e(y)`.
    pub noise_response: Vec<ResponsePoint>,
    /// Polynomials of a model with one input and one output.
    pub armax: Option<Armax>,
    /// Static gain from each input to each output.
    pub static_gain: Vec<StaticGain>,
    /// Step response from each input to each output, until it has settled.
    pub step_response: Vec<StepResponse>,
}

/// A pole or a zero in the `z` plane; of a plant in equations, which has no sample time, in the `s` plane.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Root {
    /// Real part.
    pub real: f64,
    /// Imaginary part.
    pub imag: f64,
    /// Covariance of real and imaginary part; null for a multiple root.
    pub covariance: Option<Covariance2>,
    /// Natural frequency in hertz; null for a pure delay.
    pub natural_frequency_hz: Option<f64>,
    /// Its standard deviation in hertz.
    pub natural_frequency_std: Option<f64>,
    /// Damping ratio; null for an integrator.
    pub damping: Option<f64>,
    /// Its standard deviation.
    pub damping_std: Option<f64>,
    /// Time constant in seconds, negative for an unstable one; null at the limit of stability.
    pub time_constant_s: Option<f64>,
    /// Its standard deviation in seconds.
    pub time_constant_std: Option<f64>,
}

/// One entry of a frequency response.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ResponsePoint {
    /// Frequency in rad/s.
    pub rad_s: f64,
    /// Frequency in hertz.
    pub hz: f64,
    /// Name of the output.
    pub output: String,
    /// Name of the input.
    pub input: String,
    /// Real part.
    pub real: Option<f64>,
    /// Imaginary part.
    pub imag: Option<f64>,
    /// Covariance of real and imaginary part, first order.
    pub covariance: Option<Covariance2>,
    /// Magnitude.
    pub magnitude: Option<f64>,
    /// 95% band of the magnitude.
    pub magnitude_95: Option<[f64; 2]>,
    /// 99% band of the magnitude.
    pub magnitude_99: Option<[f64; 2]>,
    /// Phase in rad, between `-pi` and `pi`.
    pub phase_rad: Option<f64>,
    /// 95% band of the phase; may pass `+-pi`, and is the full circle where the phase is not determined.
    pub phase_95: Option<[f64; 2]>,
    /// 99% band of the phase, likewise; absent in documents of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub phase_99: Option<[f64; 2]>,
    /// How the bands were found.
    pub method: Option<BandMethod>,
}

/// Static gain between two channels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StaticGain {
    /// Name of the output.
    pub output: String,
    /// Name of the input.
    pub input: String,
    /// The gain; null with an integrator.
    pub value: Option<f64>,
    /// Its standard deviation.
    pub standard_deviation: Option<f64>,
    /// Its 95% interval.
    pub interval_95: Option<[f64; 2]>,
}

/// Step response between two channels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StepResponse {
    /// Name of the output.
    pub output: String,
    /// Name of the input.
    pub input: String,
    /// Times in seconds.
    pub time_s: Vec<f64>,
    /// Response to a unit step at time zero, at these times; null where an unstable model has overflowed.
    pub value: Vec<Option<f64>>,
    /// Standard deviation at these times.
    pub standard_deviation: Option<Vec<Option<f64>>>,
}
