//! An estimated parameter in the documents of plants.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// An estimated parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ParameterDocument {
    /// As declared.
    pub name: String,
    /// Unit as declared.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// Value in the text, or the one that was given with an external simulator.
    #[serde(default)]
    pub text_value: Option<f64>,
    /// Estimate.
    pub value: f64,
    /// Standard deviation; null where the recordings do not determine it.
    #[serde(default)]
    pub std: Option<f64>,
    /// 95 % interval, by the profile of the likelihood where that is not a parabola; null where it is open.
    #[serde(default)]
    pub interval_95: Option<[Option<f64>; 2]>,
    /// Whether it lies at one of its bounds.
    #[serde(default)]
    pub at_bound: bool,
}
