//! The answer that goes with a case.

use std::collections::BTreeMap;

use serde::Serialize;

use super::linear::Discrete;

/// A discrete linear model as JSON.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Model {
    /// State matrix, by rows.
    #[serde(rename = "A")]
    pub a: Vec<Vec<f64>>,
    /// Input matrix, by rows.
    #[serde(rename = "B")]
    pub b: Vec<Vec<f64>>,
    /// Output matrix, by rows.
    #[serde(rename = "C")]
    pub c: Vec<Vec<f64>>,
    /// Feedthrough, by rows.
    #[serde(rename = "D")]
    pub d: Vec<Vec<f64>>,
    /// Sample time in seconds.
    pub dt: f64,
}

impl From<&Discrete> for Model {
    fn from(system: &Discrete) -> Self {
        Self {
            a: system.a.to_rows(),
            b: system.b.to_rows(),
            c: system.c.to_rows(),
            d: system.d.to_rows(),
            dt: system.dt,
        }
    }
}

/// The truth about a case. Errors are of the first output, as the score's.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Truth {
    /// Number of the case in its folder.
    pub case: usize,
    /// The concealed effects; empty for a null.
    pub effects: Vec<String>,
    /// Effects the simulation has too.
    pub known_to_simulation: Vec<String>,
    /// The plant.
    pub plant: String,
    /// The excitation of the recording.
    pub excitation: String,
    /// Whether it was recorded under feedback.
    pub closed_loop: bool,
    /// RMS of the effects in the output that shows them most, over that output's deviation.
    pub effect_ratio: f64,
    /// The ratio that was asked for.
    pub effect_ratio_wanted: f64,
    /// Deviation of the noise; that of each linear output is 1.
    pub noise_ratio: f64,
    /// Its correlation from sample to sample.
    pub noise_colour: f64,
    /// `gaussian` or `student_t4`.
    pub noise_tail: String,
    /// Whether drawn from the hard ranges.
    pub hard: bool,
    /// Relative error of each physical parameter of the simulation.
    pub parameter_error: f64,
    /// Strength of each effect: force laws in units of the force of a unit input at unit (deviation) motion,
    /// `end_stop` the gap in deviations, delays, lags and rates per sample, inputs and outputs in their units.
    pub strengths: BTreeMap<String, f64>,
    /// The site (in words), input or output of each effect.
    pub places: BTreeMap<String, String>,
    /// Physical parameters, scales and what else was drawn.
    pub par: BTreeMap<String, f64>,
    /// Sample time in seconds.
    pub dt: f64,
    /// `model` or `simulated output`.
    pub given: String,
    /// RMS error of the simulation on the recording.
    pub rmse_sim: f64,
    /// RMS of the noise.
    pub rmse_noise: f64,
    /// RMS error of the simulation on the fresh input.
    pub rmse_fresh_sim: f64,
    /// Deviation of the noise-free recorded output.
    pub y_std: f64,
    /// When the effect acts, seconds, if not throughout.
    pub window: Option<[f64; 2]>,
    /// The linear part of the simulation.
    pub baseline: Model,
}
