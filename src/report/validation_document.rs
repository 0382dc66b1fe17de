//! The documents `innovant-validation/1` and `innovant-plant-validation/1`.

use schemars::JsonSchema;
use serde::Serialize;

use crate::identify::Recording;

/// What `innovant validate` writes of a linear model.
pub const VALIDATION_FORMAT: &str = "innovant-validation/1";
/// What `innovant validate` writes of a plant in equations.
pub const PLANT_VALIDATION_FORMAT: &str = "innovant-plant-validation/1";

/// A validation, with what was validated on which recordings.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct ValidationDocument<V> {
    /// [`VALIDATION_FORMAT`] or [`PLANT_VALIDATION_FORMAT`].
    pub format: &'static str,
    /// File of the model or plant.
    pub model: String,
    /// The recordings it was judged on.
    pub recordings: Vec<Recording>,
    /// What was found.
    #[serde(flatten)]
    pub validation: V,
}
