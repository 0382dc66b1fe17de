//! The document `innovant-model/1`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::channels::{InputDocument, OutputDocument};
use super::packed::CovarianceDocument;
use super::request::Request;
use crate::covariance::{Root, StaticGain, invariants};
use crate::identify::{
    Asked, Diagnostics, Horizons, Method, Model, Recording, Stochastic, Weight, channel_names,
};
use crate::linalg::Rows;
use crate::model::Armax;
use crate::report::DocumentError;
use crate::report::json_layout::to_json;
use crate::validate::Validation;

/// Kind and version of the document.
pub const MODEL_FORMAT: &str = "innovant-model/1";

/// A model `x[k+1] = A x[k] + B u[k] + K e[k]`, `y[k] = C x[k] + D u[k] + e[k]` with its uncertainty.
///
/// `u` and `y` are deviations from the levels of the channels; a delayed input is shifted before it enters. A
/// matrix is an array of rows. Where a model is read, `{"A": .., "B": .., "C": .., "dt": ..}` is enough (`dt` is
/// `sample_time`, `D` is zero without it, a plain number is a 1 x 1 matrix), and unknown keys are ignored.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(title = "innovant-model/1")]
pub struct ModelDocument {
    /// `innovant-model/1`.
    #[serde(default = "format")]
    #[schemars(extend("const" = MODEL_FORMAT))]
    pub format: String,
    /// Sample time in seconds.
    #[serde(alias = "dt")]
    pub sample_time: f64,
    /// Inputs, in the order of the columns of `B`.
    #[serde(default)]
    #[schemars(required)]
    pub inputs: Option<Vec<InputDocument>>,
    /// Outputs, in the order of the rows of `C`.
    #[serde(default)]
    #[schemars(required)]
    pub outputs: Option<Vec<OutputDocument>>,
    /// State matrix, `n x n`.
    #[serde(rename = "A")]
    pub a: Rows,
    /// Input matrix, `n x r`.
    #[serde(rename = "B")]
    pub b: Rows,
    /// Output matrix, `l x n`.
    #[serde(rename = "C")]
    pub c: Rows,
    /// Feedthrough, `l x r`.
    #[serde(rename = "D", default)]
    #[schemars(required)]
    pub d: Option<Rows>,
    /// Observer (Kalman) gain, `n x l`; zero for a model without noise model.
    #[serde(rename = "K", default)]
    #[schemars(required)]
    pub k: Option<Rows>,
    /// Covariance of the innovations, `l x l`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub innovation_covariance: Option<Rows>,
    /// State at the first sample of the first recording.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub x0: Option<Vec<f64>>,
    /// Covariance of the entries of the matrices.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub covariance: Option<CovarianceDocument>,
    /// Algorithm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub method: Option<Method>,
    /// Step that estimated `K` and `innovation_covariance`; absent when it was the method's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stochastic: Option<Stochastic>,
    /// Weight of the singular value decomposition.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weight: Option<Weight>,
    /// Whether the final numbers are those of the maximum-likelihood polish.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub polished: Option<bool>,
    /// Order `n`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub order: Option<usize>,
    /// Windows.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub horizons: Option<Horizons>,
    /// Samples of all recordings (after alignment of known delays).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub samples: Option<usize>,
    /// Degrees of freedom of the innovation covariance, for each output.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub degrees_of_freedom: Option<usize>,
    /// What was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub options: Option<Asked>,
    /// Numbers that tell how far to trust the model.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub diagnostics: Option<DiagnosticsDocument>,
    /// How order and windows were chosen, one sentence each.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub explanation: Option<Vec<String>>,
    /// What to know before trusting the model, one sentence each.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub warnings: Option<Vec<String>>,
    /// What does not depend on the state basis, with standard deviations.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub invariants: Option<InvariantsDocument>,
    /// Where the model comes from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub provenance: Option<Provenance>,
}

fn format() -> String {
    MODEL_FORMAT.to_owned()
}

/// Numbers that tell how far to trust a model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DiagnosticsDocument {
    /// Those of the fit.
    #[serde(flatten)]
    pub fit: Diagnostics,
    /// Tests of the residuals on the recordings that the model was estimated from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub residual_tests: Option<Validation>,
}

/// What does not depend on the state basis, with standard deviations; `innovant show` adds the frequency
/// response.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct InvariantsDocument {
    /// Poles, slowest first.
    pub poles: Vec<Root>,
    /// Invariant zeros from inputs to outputs.
    pub zeros: Vec<Root>,
    /// Static gain from each input to each output.
    pub static_gain: Vec<StaticGain>,
    /// Polynomials of a model with one input and one output.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub armax: Option<Armax>,
}

/// Where a model comes from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Provenance {
    /// The program.
    #[serde(default)]
    pub tool: String,
    /// Its version.
    #[serde(default)]
    pub version: String,
    /// The recordings that the model was estimated from.
    #[serde(default)]
    pub recordings: Vec<Recording>,
    /// What was asked for, to the letter: the same request on the same recordings gives the same model.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub request: Option<Request>,
}

impl ModelDocument {
    /// The document of a model.
    ///
    /// # Errors
    /// [`DocumentError::NotFinite`] or [`DocumentError::Invariants`] for a model that holds numbers which are
    /// none.
    pub fn new(model: &Model) -> Result<Self, DocumentError> {
        let Model {
            system,
            inputs,
            outputs,
            innovation_covariance,
            initial_state,
            covariance,
            summary,
            recordings,
        } = model;
        check_finite(model)?;
        let seed = summary.as_ref().map_or(0, |s| s.options.seed);
        let described = invariants(
            system,
            covariance.as_ref(),
            &channel_names(outputs),
            &channel_names(inputs),
            &[],
            seed,
        )?;
        Ok(Self {
            format: format(),
            sample_time: system.sample_time,
            inputs: Some(inputs.iter().map(Into::into).collect()),
            outputs: Some(outputs.iter().map(Into::into).collect()),
            a: (&system.a).into(),
            b: (&system.b).into(),
            c: (&system.c).into(),
            d: Some((&system.d).into()),
            k: Some((&system.k).into()),
            innovation_covariance: innovation_covariance.as_ref().map(Into::into),
            x0: Some(initial_state.as_slice().to_vec()),
            covariance: covariance.as_ref().map(Into::into),
            method: summary.as_ref().map(|s| s.method),
            stochastic: summary.as_ref().and_then(|s| s.stochastic),
            weight: summary.as_ref().map(|s| s.weight),
            polished: summary.as_ref().map(|s| s.polished),
            order: summary.as_ref().map(|s| s.order),
            horizons: summary.as_ref().map(|s| s.horizons),
            samples: summary.as_ref().map(|s| s.samples),
            degrees_of_freedom: summary.as_ref().map(|s| s.degrees_of_freedom),
            options: summary.as_ref().map(|s| s.options.clone()),
            diagnostics: summary.as_ref().map(|s| DiagnosticsDocument {
                fit: s.diagnostics.clone(),
                residual_tests: None,
            }),
            explanation: summary.as_ref().map(|s| s.explanation.clone()),
            warnings: summary.as_ref().map(|s| s.warnings.clone()),
            invariants: Some(InvariantsDocument {
                poles: described.poles,
                zeros: described.zeros,
                static_gain: described.static_gain,
                armax: described.armax,
            }),
            provenance: Some(Provenance {
                tool: "innovant".to_owned(),
                version: env!("CARGO_PKG_VERSION").to_owned(),
                recordings: recordings.clone(),
                request: None,
            }),
        })
    }

    /// Adds the tests of the residuals on the recordings that the model was estimated from.
    #[must_use]
    pub fn with_residual_tests(mut self, tests: Option<Validation>) -> Self {
        if let Some(diagnostics) = &mut self.diagnostics {
            diagnostics.residual_tests = tests;
        }
        self
    }

    /// Adds what was asked for.
    #[must_use]
    pub fn with_request(mut self, request: Request) -> Self {
        if let Some(provenance) = &mut self.provenance {
            provenance.request = Some(request);
        }
        self
    }

    /// The tests of the residuals, when the document has them.
    pub fn residual_tests(&self) -> Option<&Validation> {
        self.diagnostics.as_ref()?.residual_tests.as_ref()
    }

    /// The text of the document; the same model gives the same bytes.
    ///
    /// # Errors
    /// [`DocumentError::Json`], which a document made by [`ModelDocument::new`] does not give.
    pub fn to_json(&self) -> Result<String, DocumentError> {
        Ok(to_json(self)?)
    }
}

fn check_finite(model: &Model) -> Result<(), DocumentError> {
    let system = &model.system;
    let matrices = [
        ("A", Some(&system.a)),
        ("B", Some(&system.b)),
        ("C", Some(&system.c)),
        ("D", Some(&system.d)),
        ("K", Some(&system.k)),
        (
            "innovation_covariance",
            model.innovation_covariance.as_ref(),
        ),
        ("covariance", model.covariance.as_ref().map(|c| &c.matrix)),
    ];
    for (key, matrix) in matrices {
        if matrix.is_some_and(|m| m.iter().any(|v| !v.is_finite())) {
            return Err(DocumentError::NotFinite { key });
        }
    }
    let vectors = [
        ("x0", model.initial_state.as_slice().to_vec()),
        ("inputs", model.inputs.iter().map(|c| c.level).collect()),
        ("outputs", model.outputs.iter().map(|c| c.level).collect()),
        ("sample_time", vec![system.sample_time]),
    ];
    for (key, vector) in vectors {
        if vector.iter().any(|v| !v.is_finite()) {
            return Err(DocumentError::NotFinite { key });
        }
    }
    Ok(())
}
