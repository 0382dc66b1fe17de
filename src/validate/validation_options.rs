//! What is judged, on which data, and how strictly.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// One experiment: columns of inputs and outputs as deviations from the operating point of the model.
#[derive(Debug, Clone, Copy)]
pub struct RecordView<'a> {
    /// One slice an input (`r`).
    pub inputs: &'a [&'a [f64]],
    /// One slice an output (`l`), as long as the inputs.
    pub outputs: &'a [&'a [f64]],
}

impl RecordView<'_> {
    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.outputs.first().map_or(0, |column| column.len())
    }
}

/// What the records have to do with the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Relation {
    /// The model was estimated from these records: its parameters have already explained part of what the
    /// tests look at.
    Estimation,
    /// The model has not seen these records: the errors of its parameters show in the residuals.
    Fresh,
}

/// Options of [`validate`](super::validate()).
#[derive(Debug, Clone, PartialEq)]
pub struct ValidationOptions {
    /// Probability that a right model is rejected by any of the tests of the verdict.
    pub level: f64,
    /// Number of lags `M` tested; `None` is `min(25, N / (10 q))`, at least 1.
    pub lags: Option<usize>,
    /// Names of the inputs; missing ones are `u1`, `u2`, ...
    pub input_names: Vec<String>,
    /// Names of the outputs; missing ones are `y1`, `y2`, ...
    pub output_names: Vec<String>,
}

impl Default for ValidationOptions {
    fn default() -> Self {
        Self {
            level: 0.01,
            lags: None,
            input_names: Vec::new(),
            output_names: Vec::new(),
        }
    }
}

impl ValidationOptions {
    /// Name of an input, counted from 0.
    pub(super) fn input(&self, index: usize) -> String {
        named(&self.input_names, index, 'u')
    }

    /// Name of an output, counted from 0.
    pub(super) fn output(&self, index: usize) -> String {
        named(&self.output_names, index, 'y')
    }
}

fn named(names: &[String], index: usize, letter: char) -> String {
    names
        .get(index)
        .cloned()
        .unwrap_or_else(|| format!("{letter}{}", index + 1))
}
