//! Plants in equations.

use innovant::internal::report::{Style, plant_estimate_text, plant_text, plant_validation_text};
use innovant::internal::report::{frequency_grid, plant_fits, text_alone};
use innovant::log::Channel;
use innovant::physics::estimate::{
    EstimateError, EstimateOptions, Form, Held, PlantRecording, estimate, evaluate,
    start_by_least_squares,
};
use innovant::physics::{
    Excitation, Hold, OperatingPoint, Plant as Core, Point, VariableId, diagnose, render_all,
};
use innovant::report::{
    LinearisationDocument, PlantDocument, Uncertain, judge_plant, plant_page, to_json,
};
use numpy::PyArray2;
use pyo3::prelude::*;

use crate::arrays::{Samples, columns, matrix, samples, slices, sparse_recordings};
use crate::errors::{check_level, raise};

/// A plant in equations.
#[pyclass(frozen)]
pub struct Plant {
    pub core: Core,
    pub point: Point,
    /// What was estimated.
    document: Option<PlantDocument>,
}

/// How inputs behave between samples, by name.
pub fn hold(name: &str) -> PyResult<Hold> {
    match name {
        "zero" => Ok(Hold::Zero),
        "linear" => Ok(Hold::Linear),
        other => Err(raise(format!("hold is `zero` or `linear`, not `{other}`"))),
    }
}

impl Plant {
    fn names(&self, of: Vec<VariableId>) -> Vec<String> {
        of.into_iter()
            .map(|v| self.core.spec.variable(v).column().to_owned())
            .collect()
    }

    /// How inputs behave between samples: as asked, as in the estimation, or held.
    pub fn hold(&self, asked: Option<&str>) -> PyResult<Hold> {
        match asked {
            Some(name) => hold(name),
            None => Ok(self
                .document
                .as_ref()
                .map_or(Hold::Zero, PlantDocument::hold)),
        }
    }

    fn check_inputs(&self, inputs: &[f64]) -> PyResult<()> {
        let expected = self.inputs().len();
        if inputs.len() == expected {
            return Ok(());
        }
        let given = inputs.len();
        Err(raise(format!(
            "{given} inputs were given; the plant has {expected}"
        )))
    }

    /// The point with parameters and initial states by name.
    fn at(&self, parameters: &[(String, f64)], start: &[(String, f64)]) -> PyResult<Point> {
        let mut point = self.point.clone();
        let place = |what: &str, names: Vec<String>, name: &String| {
            names.iter().position(|n| n == name).ok_or_else(|| {
                raise(format!(
                    "the plant has no {what} `{name}`; it has {}",
                    names.join(", ")
                ))
            })
        };
        for (name, value) in parameters {
            point.parameters[place("parameter", self.names(self.core.spec.parameters()), name)?] =
                *value;
        }
        for (name, value) in start {
            point.start[place("state", self.names(self.core.spec.states()), name)?] = Some(*value);
        }
        Ok(point)
    }
}

#[pymethods]
impl Plant {
    /// From a Modelica text, or from what `identify --structure` writes.
    #[new]
    fn new(name: &str, text: &str) -> PyResult<Self> {
        if text.trim_start().starts_with('{') {
            let document = PlantDocument::parse(name, text).map_err(raise)?;
            let (core, point) = document.plant().map_err(raise)?;
            return Ok(Self {
                core,
                point,
                document: Some(document),
            });
        }
        let spec = diagnose(text).map_err(|errors| raise(render_all(&errors, name, text)))?;
        let core = Core::new(spec);
        Ok(Self {
            point: core.nominal(),
            core,
            document: None,
        })
    }

    fn text(&self) -> String {
        plant_text(&self.core)
    }

    fn name(&self) -> String {
        self.core.spec.name.clone()
    }

    /// How inputs behave between samples, by name.
    fn hold_name(&self) -> PyResult<&'static str> {
        Ok(match self.hold(None)? {
            Hold::Linear => "linear",
            Hold::Zero => "zero",
        })
    }

    fn inputs(&self) -> Vec<String> {
        self.names(self.core.spec.inputs())
    }

    fn outputs(&self) -> Vec<String> {
        self.names(self.core.spec.outputs())
    }

    /// Headers of the inputs, of the outputs: names with units.
    fn headers(&self) -> (Vec<String>, Vec<String>) {
        let of = |variables: Vec<VariableId>| {
            let declared = variables.into_iter().map(|v| self.core.spec.variable(v));
            declared
                .map(|v| {
                    Channel {
                        name: v.column().to_owned(),
                        unit: v.unit_text.clone(),
                    }
                    .to_string()
                })
                .collect()
        };
        (of(self.core.spec.inputs()), of(self.core.spec.outputs()))
    }

    fn states(&self) -> Vec<String> {
        self.names(self.core.spec.states())
    }

    /// Names and values of the parameters that may be changed.
    fn parameters(&self) -> Vec<(String, f64)> {
        self.names(self.core.spec.parameters())
            .into_iter()
            .zip(self.point.parameters.iter().copied())
            .collect()
    }

    #[allow(clippy::too_many_arguments)]
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        u: Samples<'py>,
        dt: f64,
        start_time: f64,
        parameters: Vec<(String, f64)>,
        start: Vec<(String, f64)>,
        hold: &str,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let point = self.at(&parameters, &start)?;
        let (length, hold) = (u.as_array().nrows(), self::hold(hold)?);
        let u = columns(&u);
        let run = py.detach(|| {
            let inputs = slices(&u);
            let excitation = Excitation {
                inputs: &inputs,
                length,
                sample_time: dt,
                start_time,
                hold,
            };
            self.core.simulate(&point, &excitation, None)
        });
        Ok(samples(py, &run.map_err(raise)?.outputs))
    }

    /// Estimates the parameters; gives the document and what is said of it.
    #[allow(clippy::too_many_arguments)]
    fn fit(
        &self,
        py: Python<'_>,
        u: Vec<Samples<'_>>,
        y: Vec<Samples<'_>>,
        dt: f64,
        fix: Vec<String>,
        hold: &str,
        form: Option<&str>,
        least_squares: bool,
    ) -> PyResult<(String, String)> {
        let names = self.names(self.core.spec.parameters());
        if let Some(unknown) = fix.iter().find(|f| !names.contains(f)) {
            return Err(raise(format!(
                "fix: the plant has no parameter `{unknown}`; it has {}",
                names.join(", ")
            )));
        }
        let options = EstimateOptions {
            free: names.iter().map(|n| !fix.contains(n)).collect(),
            hold: self::hold(hold)?,
            form: match form {
                None => None,
                Some("free run") => Some(Form::FreeRun),
                Some("innovation") => Some(Form::Innovation),
                Some(other) => {
                    return Err(raise(format!(
                        "form is `free run` or `innovation`, not `{other}`"
                    )));
                }
            },
            least_squares,
        };
        let logs = sparse_recordings(&u, &y, dt, &self.inputs(), &self.outputs())?;
        let records = logs.iter().map(PlantRecording::from).collect::<Vec<_>>();
        let start = self.core.with_values(&self.point.parameters);
        py.detach(|| {
            let found = estimate(&start, &records, &options).map_err(raise)?;
            let mut document = PlantDocument::new(&start, &found, options.hold);
            document.fit = plant_fits(&start, &records, &logs, &found, options.hold);
            document.sample_time = Some(dt);
            let samples: usize = logs.iter().map(|l| l.samples()).sum();
            let title = format!("{} from {samples} samples", start.spec.name);
            let text = plant_estimate_text(&document, &title, Style::UNICODE);
            Ok((document.to_json().map_err(raise)?, text))
        })
    }

    /// Initial states of a recording that fit its outputs best in free run.
    fn initial_state(
        &self,
        py: Python<'_>,
        u: Samples<'_>,
        y: Samples<'_>,
        dt: f64,
        hold: Option<&str>,
    ) -> PyResult<Vec<(String, f64)>> {
        let hold = self.hold(hold)?;
        let logs = sparse_recordings(&[u], &[y], dt, &self.inputs(), &self.outputs())?;
        let plant = self.core.with_values(&self.point.parameters);
        let recording = (logs.first()).map(PlantRecording::from);
        let recording = recording.ok_or_else(|| raise(EstimateError::Empty))?;
        let start = py.detach(|| {
            let start = start_by_least_squares(&plant, &recording, hold).map_err(raise)?;
            let at = Point {
                parameters: self.point.parameters.clone(),
                start,
            };
            Ok::<_, PyErr>(plant.start(&at))
        })?;
        Ok(self.states().into_iter().zip(start).collect())
    }

    /// Judges the plant on recordings that it was (`own`) or was not estimated from: the document as JSON and as text, the
    /// free run of each recording and its predictions one sample ahead.
    #[allow(clippy::too_many_arguments, clippy::type_complexity)]
    fn validate<'py>(
        &self,
        py: Python<'py>,
        u: Vec<Samples<'_>>,
        y: Vec<Samples<'_>>,
        dt: f64,
        hold: Option<&str>,
        level: f64,
        own: bool,
    ) -> PyResult<(
        String,
        String,
        Option<Vec<Bound<'py, PyArray2<f64>>>>,
        Vec<Bound<'py, PyArray2<f64>>>,
    )> {
        check_level(level)?;
        let logs = sparse_recordings(&u, &y, dt, &self.inputs(), &self.outputs())?;
        let held = match &self.document {
            None => text_alone(&self.point, self.hold(hold)?),
            Some(document) => {
                let held = match own {
                    true => document.held_with_starts(&self.core, &self.point),
                    false => document.held(&self.core, &self.point, false),
                };
                Held {
                    hold: self.hold(hold)?,
                    ..held
                }
            }
        };
        let (validation, found) = py.detach(|| {
            let records: Vec<PlantRecording> = logs.iter().map(PlantRecording::from).collect();
            judge_plant(&self.core, &records, &held, level).map_err(raise)
        })?;
        let outputs = self.outputs().len();
        let arrays = |series: &[Vec<f64>]| {
            let each = series.chunks(outputs.max(1));
            each.map(|columns| samples(py, columns)).collect::<Vec<_>>()
        };
        Ok((
            to_json(&validation).map_err(raise)?,
            plant_validation_text(&validation, Style::UNICODE),
            found.simulated.as_deref().map(arrays),
            arrays(&found.predicted),
        ))
    }

    /// Continuous-time `A, B, C, D` at a state and inputs.
    #[allow(clippy::type_complexity)]
    fn linearise<'py>(
        &self,
        py: Python<'py>,
        state: Vec<(String, f64)>,
        inputs: Vec<f64>,
    ) -> PyResult<(
        Bound<'py, PyArray2<f64>>,
        Bound<'py, PyArray2<f64>>,
        Bound<'py, PyArray2<f64>>,
        Bound<'py, PyArray2<f64>>,
    )> {
        self.check_inputs(&inputs)?;
        let point = self.at(&[], &state)?;
        let linear = self
            .core
            .linearise(&point, &self.core.start(&point), &inputs, 0.0);
        Ok((
            matrix(py, &linear.a),
            matrix(py, &linear.b),
            matrix(py, &linear.c),
            matrix(py, &linear.d),
        ))
    }

    /// The plant linearised at a state (none: the equilibrium), as the document `innovant-linearisation/1`.
    fn linearisation(
        &self,
        state: Option<Vec<(String, f64)>>,
        inputs: Vec<f64>,
        frequencies: Vec<f64>,
    ) -> PyResult<String> {
        self.check_inputs(&inputs)?;
        let (operating, words) = match &state {
            None => (
                OperatingPoint::Equilibrium(self.core.start(&self.point)),
                "the equilibrium",
            ),
            Some(state) => {
                let point = self.at(&[], state)?;
                let state = self.core.start(&point);
                (OperatingPoint::State(state), "the given state")
            }
        };
        let document = self.document.as_ref();
        let uncertainty = document.and_then(|d| d.uncertainty(&self.core));
        let uncertain = uncertainty.as_ref().map_or(&[][..], |(places, _)| places);
        let at = self
            .core
            .at_operating_point(&self.point, &inputs, &operating, uncertain)
            .map_err(raise)?;
        let of = Uncertain {
            plant: &self.core,
            operating: &at,
            covariance: uncertainty.as_ref().map(|(_, covariance)| *covariance),
        };
        let frequencies = match frequencies.is_empty() {
            true => frequency_grid(&at, document.and_then(|d| d.sample_time)).map_err(raise)?,
            false => frequencies,
        };
        let found = LinearisationDocument::new(&of, words.to_owned(), &frequencies);
        to_json(&found.map_err(raise)?).map_err(raise)
    }

    /// The equations with the values of the parameters.
    fn modelica(&self) -> String {
        self.core.text_at(&self.point)
    }

    /// The page of an estimated plant, on the recordings that it was estimated from.
    fn page(
        &self,
        py: Python<'_>,
        u: Vec<Samples<'_>>,
        y: Vec<Samples<'_>>,
        dt: f64,
    ) -> PyResult<String> {
        let Some(document) = &self.document else {
            return Err(raise("a plant that was not estimated has no page"));
        };
        let logs = sparse_recordings(&u, &y, dt, &self.inputs(), &self.outputs())?;
        py.detach(|| {
            let records = logs.iter().map(PlantRecording::from).collect::<Vec<_>>();
            let held = document.held_with_starts(&self.core, &self.point);
            let found = evaluate(&self.core, &records, &held).map_err(raise)?;
            plant_page(&self.core, document, &records, &found).map_err(raise)
        })
    }
}
