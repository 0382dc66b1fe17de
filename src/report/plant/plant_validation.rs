//! The judgement of a plant in equations on recordings.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::plant_document::{
    InitialStateDocument, PlantDocument, TestDocument, initial_states, test_documents,
};
use crate::physics::estimate::{
    EstimateError, Evaluation, Held, HeldNoise, PlantRecording, evaluate,
};
use crate::physics::{Hold, Plant, Point};
use crate::validate::{FitMeasure, Relation, TooShort, ValidateError, fit_measure, too_short};

/// What `innovant validate` finds out about a plant in equations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PlantValidation {
    /// What the recordings have to do with the plant.
    pub relation: Relation,
    /// Samples of all recordings.
    pub samples: usize,
    /// Family-wise level of the verdict.
    pub level: f64,
    /// Fit of the prediction one sample ahead.
    pub one_step: FitMeasure,
    /// Fit of the free run from the inputs alone.
    pub free_run: Option<FitMeasure>,
    /// Initial states that fit the recordings best.
    pub initial_states: Vec<Vec<InitialStateDocument>>,
    /// Tests of the residuals.
    pub residual_tests: Vec<TestDocument>,
    /// Size of the residuals against the noise that the plant states.
    pub innovation_size: Vec<InnovationSizeDocument>,
    /// There when the recordings are too short for the tests to speak against a plant, right or wrong.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub too_short: Option<TooShort>,
    /// Whether the plant is rejected.
    pub rejected: bool,
    /// What was found and what to do about it, one sentence each.
    pub findings: Vec<String>,
}

/// Size of the residuals of an output, one sample ahead.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct InnovationSizeDocument {
    /// Output.
    pub output: String,
    /// Standard deviation that the plant states.
    pub stated_std: f64,
    /// Standard deviation found.
    pub found_std: f64,
}

/// Why a plant cannot be judged.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum JudgeError {
    /// The plant and the recordings do not fit together.
    #[error(transparent)]
    Evaluate(#[from] EstimateError),
    /// There is nothing to fit.
    #[error(transparent)]
    Fit(#[from] ValidateError),
}

impl PlantDocument {
    /// What the document knows of a plant, for recordings of it that it was (`own`) or was not estimated from.
    pub fn held<'a>(&'a self, plant: &Plant, point: &'a Point, own: bool) -> Held<'a> {
        let noise = HeldNoise {
            std: self.noise.iter().map(|n| n.innovation_std).collect(),
            autoregression: self
                .noise
                .iter()
                .map(|n| n.autoregression.clone())
                .collect(),
            moving_average: self
                .noise
                .iter()
                .map(|n| n.moving_average.clone())
                .collect(),
            degrees: self.noise_degrees_of_freedom.unwrap_or(f64::INFINITY),
        };
        let (states, outputs) = (plant.spec.states().len(), plant.spec.outputs().len());
        let gain = self.observer_gain.as_ref().map(|g| &g.0);
        Held {
            point,
            uncertainty: self.uncertainty(plant),
            hold: self.hold(),
            gain: gain.filter(|g| g.shape() == (states, outputs)),
            noise: (noise.std.len() == outputs).then_some(noise),
            own,
            starts: None,
        }
    }

    /// The same with the initial states of the document: for the recordings that it was estimated from.
    pub fn held_with_starts<'a>(&'a self, plant: &Plant, point: &'a Point) -> Held<'a> {
        let values = |s: &Vec<InitialStateDocument>| s.iter().map(|s| s.value).collect();
        Held {
            starts: Some(self.initial_states.iter().map(values).collect()),
            ..self.held(plant, point, true)
        }
    }
}

/// What is known of a plant of which there is only the text: its values are taken as certain.
pub fn text_alone(point: &Point, hold: Hold) -> Held<'_> {
    Held {
        point,
        uncertainty: None,
        hold,
        gain: None,
        noise: None,
        own: false,
        starts: None,
    }
}

/// Judges a plant on recordings.
///
/// # Errors
/// [`JudgeError`] when the plant cannot be simulated, or an output does not move.
pub fn judge_plant(
    plant: &Plant,
    records: &[PlantRecording],
    held: &Held,
    level: f64,
) -> Result<(PlantValidation, Evaluation), JudgeError> {
    let found = evaluate(plant, records, held)?;
    let spec = &plant.spec;
    let names: Vec<String> = spec
        .outputs()
        .into_iter()
        .map(|v| spec.variable(v).column().to_owned())
        .collect();
    let l = names.len();
    let fit = |predicted: &[Vec<f64>]| {
        let pairs: Vec<Vec<(&[f64], &[f64])>> = records
            .iter()
            .zip(predicted.chunks(l))
            .map(|(r, p)| {
                let both = r.outputs.iter().zip(p);
                both.map(|(y, p)| (y.as_slice(), p.as_slice())).collect()
            })
            .collect();
        fit_measure(&names, &pairs)
    };
    let one_step = fit(&found.predicted)?;
    let free_run = found.simulated.as_deref().map(fit).transpose()?;
    let residual_tests = test_documents(&found.tests, &names);
    let samples: usize = records
        .iter()
        .map(|r| r.outputs.first().map_or(0, Vec::len))
        .sum();
    let size = (spec.states().len(), spec.inputs().len(), l);
    let limit = level / residual_tests.len().max(1) as f64;
    let fails = |question: &str| {
        residual_tests
            .iter()
            .any(|t| t.question == question && t.p_value < limit)
    };
    let mut findings = Vec::new();
    if fails("inputs") || fails("products") {
        findings.push(
            "the residuals depend on the inputs or on the outputs that they cause: the equations or their values leave \
             something out; see `innovant explain`"
                .to_owned(),
        );
    } else if fails("white") {
        findings.push(
            match held.noise {
                Some(_) => "the residuals are not white: the noise differs from that of the plant",
                None => "the residuals are not white: there is slow noise, or the equations or their values leave something out",
            }
            .to_owned(),
        );
    }
    if free_run.is_none() {
        findings.push(
            "no free run: the plant cannot be simulated to the end from the inputs alone"
                .to_owned(),
        );
    }
    let innovation_size = held.noise.iter().flat_map(|noise| {
        let both = one_step.outputs.iter().zip(&noise.std);
        both.map(|(o, &stated_std)| InnovationSizeDocument {
            output: o.output.clone(),
            stated_std,
            found_std: o.rms_error,
        })
    });
    let validation = PlantValidation {
        relation: match held.own {
            true => Relation::Estimation,
            false => Relation::Fresh,
        },
        samples,
        level,
        free_run,
        initial_states: initial_states(plant, &found.points, &found.start_std),
        innovation_size: innovation_size.collect(),
        too_short: too_short(size, 0, samples),
        rejected: residual_tests.iter().any(|t| t.p_value < limit),
        residual_tests,
        one_step,
        findings,
    };
    Ok((validation, found))
}
