//! What was asked of an identification, as a part of the model's document.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::identify::Options;
use crate::log::Roles;

/// Options and column roles, to the letter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Request {
    /// Options of the identification.
    pub options: serde_json::Value,
    /// Column roles.
    pub roles: serde_json::Value,
}

impl Request {
    /// The request for a model with these options of columns with these roles.
    pub fn new(options: &Options, roles: &Roles) -> Self {
        // Plain values, which JSON always has words for.
        let value = |made: serde_json::Result<serde_json::Value>| made.unwrap_or_default();
        Self {
            options: value(serde_json::to_value(options)),
            roles: value(serde_json::to_value(roles)),
        }
    }
}
