//! How closely a simulation follows a recording, and what it leaves.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Fit figures of one set of samples.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FitFigure {
    /// Root mean square error, in the unit of the output.
    pub rmse: f64,
    /// `100 (1 - |error|/|output - mean|)`.
    pub fit_percent: f64,
}

impl FitFigure {
    /// What the run leaves of the variance, as a part of it.
    pub(crate) fn left(&self) -> f64 {
        (1.0 - 0.01 * self.fit_percent).powi(2)
    }

    /// Whether that is half of it or more.
    pub(crate) fn leaves_half(&self) -> bool {
        self.left() >= 0.5
    }
}

/// Fit figures step by step, of the output that the effect shows most.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FitSteps {
    /// The simulation as it was given.
    pub simulation: FitFigure,
    /// With other parameters and initial states only.
    pub parameters_only: FitFigure,
    /// With what was found.
    pub augmented: FitFigure,
    /// The noise that no model could foresee in simulation.
    pub noise_floor: FitFigure,
    /// 95 % interval of the decrease of the error, parameters only to augmented (paired block bootstrap).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub improvement_95: Option<[f64; 2]>,
}

/// Fit on what was fitted, and on what never was.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FitTable {
    /// The output that the figures are of.
    pub output: String,
    /// Samples that were fitted.
    pub train: FitSteps,
    /// Blocks that were never fitted: models fitted again without them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heldout: Option<FitSteps>,
    /// The blocks, `[from s, to s]`.
    pub heldout_blocks: Vec<[f64; 2]>,
    /// The same of every output of a plant in equations, worst first; empty where it has one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub outputs: Vec<OutputFit>,
}

/// Fit figures of one of several outputs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct OutputFit {
    /// The output.
    pub output: String,
    /// Samples that were fitted.
    pub train: FitSteps,
    /// Blocks that were never fitted: models fitted again without them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heldout: Option<FitSteps>,
}

/// Wald's test: whether estimates differ from the text as a whole.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct JointTest {
    /// The squared shift from the text, weighed by the inverse of its covariance.
    pub chi_square: f64,
    /// Parameters that the recording determines.
    pub degrees_of_freedom: usize,
    /// Probability of as large a shift by chance.
    pub p_value: f64,
    /// The largest correlation of two estimates, without its sign.
    pub largest_correlation: f64,
}

/// A property of the simulation that the recording contradicts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ParameterChange {
    /// What: `natural frequency`, `time constant 2`, `static gain y1/u1`.
    pub name: String,
    /// In the simulation.
    pub simulation: f64,
    /// In the recording.
    pub recording: f64,
    /// Standard deviation of what the recording says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub std: Option<f64>,
    /// Unit.
    pub unit: String,
}

/// What is left.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Remaining {
    /// Whether what is left can be noise (or too little to matter).
    pub adequate: bool,
    /// Probability of as much structure by chance.
    pub p_value: f64,
    /// Share of the residual's variance that flexible features explain.
    pub share: f64,
    /// The same structure over what the named physics removes from the error; absent without a name.
    #[serde(default)]
    pub share_of_removed: Option<f64>,
    /// Flexible features that were tried.
    pub features: usize,
    /// In words.
    pub sentence: String,
}

/// Three numbers beside the test.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EffectSize {
    /// Share of the output's variance that the linear model explains.
    pub linear_share: f64,
    /// Share of the remaining error's variance that the effect removes.
    pub removed_share: f64,
    /// Decrease of the root mean square error on blocks that were not fitted, in the unit of the output.
    pub heldout_gain: f64,
}

/// The smallest size at which an effect would have been seen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Detectable {
    /// Id.
    pub effect: String,
    /// The channel.
    pub signal: String,
    /// Size in the output, root mean square, as a share of its standard deviation.
    pub share_of_output: f64,
}

/// The noise of one output.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NoiseFound {
    /// The output.
    pub output: String,
    /// Autoregression `v[k] = -a1 v[k-1] - ... + e[k]`.
    pub autoregression: Vec<f64>,
    /// `c1, c2, ...` of `v[k] + a1 v[k-1] + ... = e[k] + c1 e[k-1] + ...`: slow and white noise together have one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub moving_average: Vec<f64>,
    /// Scale of `e`.
    pub innovation_std: f64,
    /// Degrees of freedom of its distribution; absent for a Gaussian.
    pub degrees_of_freedom: Option<f64>,
}
