//! The document `innovant-plant/1`: a plant in equations with its estimated parameters.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::parameter_document::ParameterDocument;
use super::simulator_document::SimulatorDocument;
use crate::identify::Recording;
use crate::linalg::Rows;
use crate::physics::estimate::{Form, PlantEstimate, Question, ResidualTest};
use crate::physics::{Hold, Plant, Point, Simulated, parse};
use crate::report::document_error::{DocumentError, repeated};
use crate::report::json_layout::to_json;
use crate::report::json_location::position_of;
use crate::report::model::{broken, no_document};

/// Kind and version of the document.
pub const PLANT_FORMAT: &str = "innovant-plant/1";

/// A plant in equations: the text, and what was estimated from recordings of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(title = "innovant-plant/1")]
pub struct PlantDocument {
    /// `innovant-plant/1`.
    #[schemars(extend("const" = PLANT_FORMAT))]
    pub format: String,
    /// The equations, in flat Modelica; empty for an external simulator.
    #[serde(default)]
    pub text: String,
    /// The external simulator, where the plant has no equations.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub simulator: Option<SimulatorDocument>,
    /// How inputs behave between samples: `zero` holds them, `linear` joins them.
    #[serde(default)]
    pub hold: String,
    /// The parameters that were estimated.
    pub parameters: Vec<ParameterDocument>,
    /// Covariance of their estimates, in their order.
    #[serde(default)]
    pub covariance: Option<Rows>,
    /// `free run` or `innovation`.
    #[serde(default)]
    pub form: String,
    /// Gain of the observer in the innovation form: `x += K (y - yhat)` after each sample, states by outputs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub observer_gain: Option<Rows>,
    /// Initial states, one list a recording (a recording with gaps counts as several).
    #[serde(default)]
    pub initial_states: Vec<Vec<InitialStateDocument>>,
    /// Noise of each output.
    #[serde(default)]
    pub noise: Vec<NoiseDocument>,
    /// Degrees of freedom of Student's t of the noise; null for Gaussian.
    #[serde(default)]
    pub noise_degrees_of_freedom: Option<f64>,
    /// Fit of the free run to each output.
    #[serde(default)]
    pub fit: Vec<FitDocument>,
    /// Tests of the residuals.
    #[serde(default)]
    pub residual_tests: Vec<TestDocument>,
    /// What the recordings do not determine, in words.
    #[serde(default)]
    pub undetermined: Vec<String>,
    /// Schwarz's criterion of the form that was taken, and of the other where it was fitted.
    #[serde(default)]
    pub criterion: Option<f64>,
    /// The same of the other form.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub other_form_criterion: Option<f64>,
    /// Sample time of the recordings in seconds.
    #[serde(default)]
    pub sample_time: Option<f64>,
    /// Recordings it was estimated from.
    #[serde(default)]
    pub recordings: Vec<Recording>,
    /// Version of the program.
    #[serde(default)]
    pub version: String,
}

/// An initial state.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct InitialStateDocument {
    /// State.
    pub name: String,
    /// Estimate.
    pub value: f64,
    /// Standard deviation; 0 for a start that is certain.
    #[serde(default)]
    pub std: Option<f64>,
}

/// Noise of an output: `a(q) v = c(q) e`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NoiseDocument {
    /// Output.
    pub output: String,
    /// Standard deviation of `e`.
    pub innovation_std: f64,
    /// Coefficients of `a` behind the leading 1.
    pub autoregression: Vec<f64>,
    /// Coefficients of `c` behind the leading 1.
    pub moving_average: Vec<f64>,
}

/// Fit of an output in free run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FitDocument {
    /// Output.
    pub output: String,
    /// `100 (1 - |y - simulated| / |y - mean|)` of the estimated plant.
    pub free_run_percent: f64,
    /// Root mean square of the error.
    pub rms_error: f64,
    /// The same percentage on the last third of each recording, of parameters and initial states that were estimated from the
    /// first two thirds; null where these are too short.
    #[serde(default)]
    pub held_out_percent: Option<f64>,
    /// The same percentage with the values of the text.
    #[serde(default)]
    pub text_percent: Option<f64>,
    /// The same percentage of the best linear model of the recordings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub linear_model_percent: Option<f64>,
    /// Order of that model.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub linear_model_order: Option<usize>,
}

/// A test of residuals.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TestDocument {
    /// Output.
    pub output: String,
    /// `white`, `inputs` or `products`.
    pub question: String,
    /// Chi-square statistic.
    pub statistic: f64,
    /// Degrees of freedom.
    pub degrees: usize,
    /// Its probability under noise.
    pub p_value: f64,
}

fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

/// Initial states of each recording.
pub(crate) fn initial_states(
    plant: &dyn Simulated,
    points: &[Point],
    stds: &[Vec<f64>],
) -> Vec<Vec<InitialStateDocument>> {
    let spec = plant.spec();
    let states = spec.states();
    let of_point = |(point, stds): (&Point, &Vec<f64>)| {
        let start = plant.start(point);
        let each = states.iter().zip(start).zip(stds);
        each.map(|((&v, value), &std)| InitialStateDocument {
            name: spec.variable(v).column().to_owned(),
            value,
            std: finite(std),
        })
        .collect()
    };
    points.iter().zip(stds).map(of_point).collect()
}

/// Tests of the residuals of outputs with these names.
pub(super) fn test_documents(tests: &[ResidualTest], outputs: &[String]) -> Vec<TestDocument> {
    let question = |question| match question {
        Question::White => "white",
        Question::Inputs => "inputs",
        Question::Products => "products",
    };
    tests
        .iter()
        .map(|t| TestDocument {
            output: outputs[t.output].clone(),
            question: question(t.question).to_owned(),
            statistic: t.statistic,
            degrees: t.degrees,
            p_value: t.p_value,
        })
        .collect()
}

impl PlantDocument {
    /// The document of an estimate; fits and recordings are added by the caller.
    pub fn new(plant: &dyn Simulated, estimate: &PlantEstimate, hold: Hold) -> Self {
        let spec = plant.spec();
        let parameters = spec.parameters();
        let nominal = plant.nominal();
        let name = |v| spec.variable(v).column().to_owned();
        let outputs: Vec<String> = spec.outputs().into_iter().map(name).collect();
        let (autoregressions, averages, degrees) = &estimate.noise;
        Self {
            format: PLANT_FORMAT.to_owned(),
            text: spec.text.clone(),
            simulator: None,
            hold: if hold == Hold::Linear {
                "linear"
            } else {
                "zero"
            }
            .to_owned(),
            parameters: estimate
                .parameters
                .iter()
                .map(|p| {
                    let v = spec.variable(parameters[p.index]);
                    ParameterDocument {
                        name: v.name.clone(),
                        unit: v.unit_text.clone(),
                        text_value: Some(nominal.parameters[p.index]),
                        value: p.value,
                        std: finite(p.std),
                        interval_95: Some([finite(p.interval.0), finite(p.interval.1)]),
                        at_bound: p.at_bound,
                    }
                })
                .collect(),
            covariance: estimate
                .covariance
                .iter()
                .all(|v| v.is_finite())
                .then(|| Rows::from(&estimate.covariance)),
            form: match estimate.form {
                Form::FreeRun => "free run",
                Form::Innovation => "innovation",
            }
            .to_owned(),
            observer_gain: estimate.gain.as_ref().map(Rows::from),
            initial_states: initial_states(plant, &estimate.points, &estimate.start_std),
            noise: outputs
                .iter()
                .enumerate()
                .map(|(i, output)| NoiseDocument {
                    output: output.clone(),
                    innovation_std: estimate.noise_std[i],
                    autoregression: autoregressions[i].clone(),
                    moving_average: averages[i].clone(),
                })
                .collect(),
            noise_degrees_of_freedom: finite(*degrees),
            fit: Vec::new(),
            residual_tests: test_documents(&estimate.tests, &outputs),
            undetermined: estimate
                .undetermined
                .iter()
                .map(|u| u.message.clone())
                .collect(),
            criterion: finite(estimate.criterion),
            other_form_criterion: estimate.other_criterion.and_then(finite),
            sample_time: None,
            recordings: Vec::new(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
        }
    }

    /// As JSON.
    ///
    /// # Errors
    /// [`DocumentError::Json`], which should not happen.
    pub fn to_json(&self) -> Result<String, DocumentError> {
        Ok(to_json(self)?)
    }

    /// Reads a document from text; `name` stands for the file in messages.
    ///
    /// # Errors
    /// [`DocumentError`] names file, line, column and key.
    pub fn parse(name: &str, text: &str) -> Result<Self, DocumentError> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        if !text.trim_start().starts_with('{') {
            return Err(no_document(name, text));
        }
        let document: Self =
            serde_json::from_str(text).map_err(|error| broken(name, text, &error))?;
        if document.format != PLANT_FORMAT {
            return Err(DocumentError::Format {
                name: name.to_owned(),
                found: repeated(&document.format),
                expected: PLANT_FORMAT,
                advice: "it was written by another version of innovant: update this one, or estimate the plant again",
            });
        }
        let content = |key: &str, message: String| DocumentError::Content {
            name: name.to_owned(),
            place: position_of(text, key)
                .map(|at| format!(", line {}, column {}", at.line, at.column))
                .unwrap_or_default(),
            key: key.to_owned(),
            message,
        };
        if let Some(simulator) = &document.simulator {
            simulator
                .check(&document.parameters)
                .map_err(|message| content("simulator", message))?;
            return Ok(document);
        }
        let spec =
            parse(&document.text).map_err(|e| content("text", format!("the equations: {e}")))?;
        for p in &document.parameters {
            let known = spec
                .parameters()
                .iter()
                .any(|&v| spec.variable(v).name == p.name);
            if !known || !p.value.is_finite() {
                return Err(content(
                    "parameters",
                    format!("`{}` is no parameter of the text with a number", p.name),
                ));
            }
        }
        Ok(document)
    }

    /// The plant, and its estimated parameters with no initial state of its own.
    ///
    /// # Errors
    /// When the text cannot be read, in words.
    pub fn plant(&self) -> Result<(Plant, Point), String> {
        if let Some(simulator) = &self.simulator {
            return Err(simulator.has_no_equations());
        }
        let plant = Plant::new(parse(&self.text).map_err(|e| e.to_string())?);
        let mut point = plant.nominal();
        let parameters = plant.spec.parameters();
        for p in &self.parameters {
            if let Some(i) = parameters
                .iter()
                .position(|&v| plant.spec.variable(v).name == p.name)
            {
                point.parameters[i] = p.value;
            }
        }
        Ok((plant, point))
    }

    /// How inputs behave between samples.
    pub fn hold(&self) -> Hold {
        if self.hold == "linear" {
            Hold::Linear
        } else {
            Hold::Zero
        }
    }
}

/// Whether `text` is JSON that calls itself a plant.
pub fn is_plant(text: &str) -> bool {
    #[derive(serde::Deserialize)]
    struct Probe {
        format: String,
    }
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    serde_json::from_str::<Probe>(text).is_ok_and(|p| p.format.starts_with("innovant-plant/"))
}
