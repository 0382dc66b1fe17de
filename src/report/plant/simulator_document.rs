//! The external simulator of `innovant-plant/1`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::parameter_document::ParameterDocument;
use crate::physics::Simulated;
use crate::physics::estimate::PlantEstimate;
use crate::physics::external::ExternalPlant;

/// An external simulator: how it was run, and all its parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SimulatorDocument {
    /// The command, as it was given; null for a function.
    #[serde(default)]
    pub command: Option<String>,
    /// Inputs that it takes.
    #[serde(default)]
    pub inputs: Vec<String>,
    /// Outputs that it gives.
    #[serde(default)]
    pub outputs: Vec<String>,
    /// All its parameters, also those that were not estimated.
    pub parameters: Vec<SimulatorParameterDocument>,
    /// How often it was run.
    #[serde(default)]
    pub runs: usize,
    /// How many of these runs gave no answer.
    #[serde(default)]
    pub failed_runs: usize,
}

/// A parameter of an external simulator.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SimulatorParameterDocument {
    /// Name.
    pub name: String,
    /// Estimate, or the value that was given.
    pub value: f64,
    /// Lower bound; null where there is none.
    #[serde(default)]
    pub min: Option<f64>,
    /// Upper bound; null where there is none.
    #[serde(default)]
    pub max: Option<f64>,
    /// Unit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// In words.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub description: String,
}

impl SimulatorDocument {
    /// The simulator with what was estimated.
    pub fn new(command: Option<String>, plant: &ExternalPlant, estimate: &PlantEstimate) -> Self {
        let spec = plant.spec();
        let names = |ids: Vec<_>| {
            ids.into_iter()
                .map(|v| spec.variable(v).name.clone())
                .collect()
        };
        let mut values = plant.nominal().parameters;
        for p in &estimate.parameters {
            values[p.index] = p.value;
        }
        let count = plant.count();
        Self {
            command,
            inputs: names(spec.inputs()),
            outputs: names(spec.outputs()),
            parameters: spec
                .parameters()
                .into_iter()
                .zip(values)
                .map(|(v, value)| {
                    let v = spec.variable(v);
                    SimulatorParameterDocument {
                        name: v.name.clone(),
                        value,
                        min: v.min.is_finite().then_some(v.min),
                        max: v.max.is_finite().then_some(v.max),
                        unit: v.unit_text.clone(),
                        description: v.description.clone(),
                    }
                })
                .collect(),
            runs: count.runs,
            failed_runs: count.failed,
        }
    }

    /// Whether what was estimated are parameters of the simulator.
    pub(crate) fn check(&self, estimated: &[ParameterDocument]) -> Result<(), String> {
        let unknown = estimated
            .iter()
            .find(|p| !self.parameters.iter().any(|own| own.name == p.name));
        match unknown {
            Some(p) => Err(format!("`{}` is no parameter of the simulator", p.name)),
            None => Ok(()),
        }
    }

    /// Why it cannot be simulated here.
    pub(super) fn has_no_equations(&self) -> String {
        match &self.command {
            Some(command) => format!(
                "it holds no equations: it was estimated with an external simulator, which simulates; run `{command}`"
            ),
            None => "it holds no equations: it was estimated with an external simulator, which simulates".to_owned(),
        }
    }

    /// How often it was run, in words.
    pub(crate) fn said(&self) -> String {
        let failed = match self.failed_runs {
            0 => String::new(),
            n => format!(", {n} of them without an answer"),
        };
        format!("The simulator was run {} times{failed}.", self.runs)
    }
}
