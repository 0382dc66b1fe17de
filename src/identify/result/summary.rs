//! What an identification reports beside its matrices.

use serde::{Deserialize, Serialize};

use super::resolution::CoarseChannel;
use crate::identify::algorithms::{Method, Stochastic};
use crate::identify::order::{FreeRunRest, OrderEvidence};
use crate::identify::subspace::Weight;
use crate::identify::{CovarianceKind, Polish};
use crate::moments::{Detrend, Route};

/// Akaike's criterion of one past window.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct PastEvidence {
    /// Past window.
    pub past: usize,
    /// Corrected Akaike criterion of the vector ARX model; smallest is best.
    pub akaike: f64,
}

/// The chi-square test of order and window.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct OrderTest {
    /// Cost of the model against the vector ARX model.
    pub chi_square: f64,
    /// Degrees of freedom.
    pub degrees_of_freedom: usize,
    /// Probability of so large a cost when order and window are right.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub p_value: Option<f64>,
}

/// What stability cost.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct StabilityCost {
    /// Spectral radius of the unconstrained model.
    pub spectral_radius_before: f64,
    /// Increase of the chi-square cost.
    pub chi_square_increase: f64,
    /// Probability of so large an increase when the plant is stable.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub p_value: Option<f64>,
}

/// Windows of the subspace step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Horizons {
    /// Past window `p`.
    pub past: usize,
    /// Future window `f`.
    pub future: usize,
}

/// What was asked for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Asked {
    /// Whether the order was chosen by the program.
    pub order_automatic: bool,
    /// Whether the past window was chosen by the program.
    pub past_automatic: bool,
    /// Maximum-likelihood polish.
    pub polish: Polish,
    /// Kind of covariance.
    pub covariance: CovarianceKind,
    /// What was removed from the channels.
    pub detrend: Detrend,
    /// Whether `D` was estimated.
    pub feedthrough: bool,
    /// Whether a stable model was asked for.
    pub stable: bool,
    /// Seed of everything drawn.
    pub seed: u64,
}

/// Numbers that tell how far to trust the model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Diagnostics {
    /// Windows in the regression, `Nc`.
    pub windows: usize,
    /// Route of the factorisation.
    pub route: Route,
    /// Reciprocal condition of the data factor `R`.
    pub reciprocal_condition: f64,
    /// Truncation measure eta of the past window.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub truncation: Option<f64>,
    /// Largest singular values of the weighted product.
    pub singular_values: Vec<f64>,
    /// Spectral radius of `A`.
    pub spectral_radius: f64,
    /// Spectral radius of `A - K C`.
    pub predictor_radius: f64,
    /// Test of order and window.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub order_test: Option<OrderTest>,
    /// Evidence on every order that was looked at.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub orders: Vec<OrderEvidence>,
    /// What the free run on held-out blocks leaves of each output, where that decided about the order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub free_run_rest: Vec<FreeRunRest>,
    /// Evidence on the past windows.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub past_windows: Vec<PastEvidence>,
    /// Longest past window that was tried, where the length of the recording was the limit and Akaike's choice was the
    /// limit itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub past_limited_to: Option<usize>,
    /// Channels that were recorded in steps, where that may matter.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub coarse_inputs: Vec<CoarseChannel>,
    /// Likewise outputs: they only matter when a controller acted on what was not rounded.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub coarse_outputs: Vec<CoarseChannel>,
    /// What `--stable` cost.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stability: Option<StabilityCost>,
    /// Blocks of the jackknife.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub jackknife_blocks: Option<usize>,
}

/// How the model came about.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Summary {
    /// Algorithm.
    pub method: Method,
    /// Step that estimated `K` and `Lambda`; absent when it was the method's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stochastic: Option<Stochastic>,
    /// Weight of the singular value decomposition.
    pub weight: Weight,
    /// Whether the final numbers are those of the polish.
    pub polished: bool,
    /// Order `n`.
    pub order: usize,
    /// Windows.
    pub horizons: Horizons,
    /// Samples of all experiments (after alignment of known delays).
    pub samples: usize,
    /// Degrees of freedom of the innovation covariance, for each output.
    pub degrees_of_freedom: usize,
    /// What was asked for.
    pub options: Asked,
    /// Numbers that tell how far to trust the model.
    pub diagnostics: Diagnostics,
    /// One sentence each on how order and windows were chosen.
    pub explanation: Vec<String>,
    /// What a user should know before trusting the model, in plain words.
    pub warnings: Vec<String>,
}
