//! What an identification reports beside its matrices.

use serde::{Deserialize, Serialize};

use super::options::{CovarianceKind, Polish};
use super::order::OrderEvidence;
use super::pbsid_opt::Weight;
use super::records::Recording;
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

/// How the model came about.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Summary {
    /// Algorithm.
    pub method: String,
    /// Weight of the singular value decomposition.
    pub weight: Weight,
    /// Whether the final numbers are those of the polish.
    pub polished: bool,
    /// What was asked.
    pub polish: Polish,
    /// Kind of covariance.
    pub covariance_kind: CovarianceKind,
    /// Past window `p`.
    pub past: usize,
    /// Future window `f`.
    pub future: usize,
    /// Order `n`.
    pub order: usize,
    /// Whether the order was chosen here.
    pub order_chosen: bool,
    /// Whether the past window was chosen here.
    pub past_chosen: bool,
    /// One sentence each on how order and windows were chosen.
    pub explanation: Vec<String>,
    /// What was removed from the channels.
    pub detrend: Detrend,
    /// Samples of all experiments (after alignment of known delays).
    pub samples: usize,
    /// Windows in the regression, `Nc`.
    pub columns: usize,
    /// Degrees of freedom of the innovation covariance, for each output.
    pub degrees_of_freedom: usize,
    /// Route of the factorisation.
    pub route: Route,
    /// Reciprocal condition of the data factor.
    pub reciprocal_condition: f64,
    /// Truncation measure eta of the past window.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub truncation: Option<f64>,
    /// Largest singular values of the weighted product.
    pub singular_values: Vec<f64>,
    /// Test of order and window.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub order_test: Option<OrderTest>,
    /// Evidence on every order that was looked at.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub orders: Vec<OrderEvidence>,
    /// Evidence on the past windows.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub past_windows: Vec<PastEvidence>,
    /// Spectral radius of `A`.
    pub spectral_radius: f64,
    /// Spectral radius of `A - K C`.
    pub predictor_radius: f64,
    /// What `--stable` cost.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stability: Option<StabilityCost>,
    /// Blocks of the jackknife.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub jackknife_blocks: Option<usize>,
    /// The recordings.
    pub recordings: Vec<Recording>,
    /// What a user should know before trusting the model, in plain words.
    pub warnings: Vec<String>,
}
