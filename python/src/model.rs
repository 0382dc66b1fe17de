//! The model: matrices, what it foresees, whether it holds, and its document.

use std::mem;
use std::path::PathBuf;
use std::sync::{Mutex, OnceLock, PoisonError};

use innovant::Options;
use innovant::identify::Detrend;
use innovant::identify::{IdentifyError, Records, identify_records};
use innovant::internal::log::write_file_atomically;
use innovant::internal::report::{ModelText, Style, model_text, validation_text, verdict};
use innovant::internal::validate::test_residuals;
use innovant::internal::validate::{Deviations, Zero, judge};
use innovant::report::{ModelDocument, identification_page, parse_model, to_json};
use innovant::validate::{Relation, TestedModel};
use nalgebra::DVector;
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, ToPyArray};
use pyo3::prelude::*;

use crate::arrays::{Samples, columns, matrix, recordings, samples, slices};
use crate::errors::{check_level, raise};
use crate::options::options;
use crate::records::ArrayRecords;

/// A model; the tests of its residuals are made when they are first asked for.
#[pyclass(module = "innovant._innovant", frozen)]
pub struct Model {
    pub model: innovant::Model,
    /// What the tests look at, until they have been made.
    pending: Mutex<Vec<Deviations>>,
    tested: OnceLock<TestedModel>,
}

impl Model {
    /// Identifies a model and keeps what its tests will look at.
    pub fn identified(records: &mut dyn Records, options: &Options) -> Result<Self, IdentifyError> {
        let model = identify_records(records, options)?;
        let deviations = Deviations::of_records(records, &model)?;
        Ok(Self {
            model,
            pending: Mutex::new(deviations),
            tested: OnceLock::new(),
        })
    }

    /// The model with what its tests have to say.
    fn tested(&self, py: Python<'_>) -> &TestedModel {
        py.detach(|| {
            self.tested.get_or_init(|| {
                let mut pending = self.pending.lock().unwrap_or_else(PoisonError::into_inner);
                test_residuals(self.model.clone(), &mem::take(&mut *pending))
            })
        })
    }
}

/// A matrix of a model by its letter.
type Matrix<'py> = Bound<'py, PyArray2<f64>>;

#[pymethods]
impl Model {
    fn a<'py>(&self, py: Python<'py>) -> Matrix<'py> {
        matrix(py, &self.model.system.a)
    }

    fn b<'py>(&self, py: Python<'py>) -> Matrix<'py> {
        matrix(py, &self.model.system.b)
    }

    fn c<'py>(&self, py: Python<'py>) -> Matrix<'py> {
        matrix(py, &self.model.system.c)
    }

    fn d<'py>(&self, py: Python<'py>) -> Matrix<'py> {
        matrix(py, &self.model.system.d)
    }

    fn k<'py>(&self, py: Python<'py>) -> Matrix<'py> {
        matrix(py, &self.model.system.k)
    }

    fn innovation_covariance<'py>(&self, py: Python<'py>) -> Option<Matrix<'py>> {
        let covariance = self.model.innovation_covariance.as_ref()?;
        Some(matrix(py, covariance))
    }

    fn covariance<'py>(&self, py: Python<'py>) -> Option<Matrix<'py>> {
        let covariance = self.model.covariance.as_ref()?;
        Some(matrix(py, &covariance.matrix))
    }

    fn x0<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.model.initial_state.as_slice().to_pyarray(py)
    }

    fn dt(&self) -> f64 {
        self.model.system.sample_time
    }

    /// Headers of the inputs, of the outputs.
    fn names(&self) -> (Vec<String>, Vec<String>) {
        let of = |channels: &[innovant::identify::IdentifiedChannel]| {
            channels.iter().map(|c| c.channel.to_string()).collect()
        };
        (of(&self.model.inputs), of(&self.model.outputs))
    }

    /// Levels of the inputs, of the outputs.
    fn levels(&self) -> (Vec<f64>, Vec<f64>) {
        let of = |channels: &[innovant::identify::IdentifiedChannel]| {
            channels.iter().map(|c| c.level).collect()
        };
        (of(&self.model.inputs), of(&self.model.outputs))
    }

    fn delays(&self) -> Vec<usize> {
        self.model.inputs.iter().map(|c| c.delay).collect()
    }

    fn warnings(&self, py: Python<'_>) -> Vec<String> {
        let summary = self.tested(py).model.summary.as_ref();
        summary.map_or_else(Vec::new, |s| s.warnings.clone())
    }

    fn verdict(&self, py: Python<'_>) -> String {
        let TestedModel { model, tests } = self.tested(py);
        verdict(model, tests.as_ref())
    }

    /// The table that the command line prints.
    fn text(&self, py: Python<'_>) -> String {
        let TestedModel { model, tests } = self.tested(py);
        model_text(&ModelText {
            model,
            tests: tests.as_ref(),
            orders: &[],
            style: Style::UNICODE,
        })
    }

    /// The tests of the residuals as JSON.
    fn residual_tests(&self, py: Python<'_>) -> PyResult<Option<String>> {
        let tests = self.tested(py).tests.as_ref();
        tests.map(to_json).transpose().map_err(raise)
    }

    /// Free run on inputs of samples x channels.
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        u: Samples<'py>,
        x0: Option<PyReadonlyArray1<'py, f64>>,
    ) -> PyResult<Matrix<'py>> {
        let (inputs, start) = (columns(&u), state(x0.as_ref()));
        let outputs = py.detach(|| {
            let outputs = self.model.simulate(&slices(&inputs), start.as_ref())?;
            self.model.check_finite(&outputs, 0.0)?;
            Ok::<_, innovant::model::ModelError>(outputs)
        });
        Ok(samples(py, &outputs.map_err(raise)?))
    }

    /// One-step predictions, from the initial state that fits best unless one is given.
    fn predict<'py>(
        &self,
        py: Python<'py>,
        u: Samples<'py>,
        y: Samples<'py>,
        x0: Option<PyReadonlyArray1<'py, f64>>,
    ) -> PyResult<Matrix<'py>> {
        let (inputs, outputs, start) = (columns(&u), columns(&y), state(x0.as_ref()));
        let predicted = py.detach(|| {
            let (inputs, outputs) = (slices(&inputs), slices(&outputs));
            let start = match start {
                Some(start) => start,
                None => self.model.initial_state_of(&inputs, &outputs)?,
            };
            self.model.predict(&inputs, &outputs, Some(&start))
        });
        Ok(samples(py, &predicted.map_err(raise)?.predicted))
    }

    /// The state at the first sample that fits a recording best.
    fn initial_state<'py>(
        &self,
        py: Python<'py>,
        u: Samples<'py>,
        y: Samples<'py>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (inputs, outputs) = (columns(&u), columns(&y));
        let state = py.detach(|| {
            self.model
                .initial_state_of(&slices(&inputs), &slices(&outputs))
        });
        Ok(state.map_err(raise)?.as_slice().to_pyarray(py))
    }

    /// Fit and residual tests on recordings, as JSON and as text.
    fn validate(
        &self,
        py: Python<'_>,
        u: Vec<Samples<'_>>,
        y: Vec<Samples<'_>>,
        level: f64,
        detrend: Option<&str>,
        fresh: bool,
    ) -> PyResult<(String, String)> {
        check_level(level)?;
        let (inputs, outputs) = self.names();
        let logs = recordings(&u, &y, self.dt(), &inputs, &outputs)?;
        let (relation, zero) = match (detrend, fresh) {
            (None, true) => (Relation::Fresh, Zero::Levels),
            (None, false) => (Relation::Estimation, Zero::of_estimation(&self.model)),
            (Some(word), _) => {
                let relation = if fresh {
                    Relation::Fresh
                } else {
                    Relation::Estimation
                };
                (relation, zero(word)?)
            }
        };
        let tests = py.detach(|| {
            let records: Vec<Deviations> = logs
                .iter()
                .map(|log| Deviations::of_log(log, &self.model, zero))
                .collect();
            judge(&self.model, &records, relation, Some(level))
        });
        let tests = tests.map_err(raise)?;
        Ok((to_json(&tests).map_err(raise)?, validation_text(&tests)))
    }

    /// The document that the command line writes.
    fn to_json(&self, py: Python<'_>) -> PyResult<String> {
        let TestedModel { model, tests } = self.tested(py);
        ModelDocument::new(model)
            .and_then(|document| document.with_residual_tests(tests.clone()).to_json())
            .map_err(raise)
    }

    /// Writes the page; the file appears whole or not at all.
    fn report(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let TestedModel { model, tests } = self.tested(py);
        py.detach(|| {
            let page = identification_page(model, tests.as_ref(), None).map_err(raise)?;
            write_file_atomically(&path, page.as_bytes()).map_err(raise)
        })
    }

    #[staticmethod]
    fn from_json(name: &str, text: &str) -> PyResult<Self> {
        let read = parse_model(name, text).map_err(raise)?;
        let tests = read.document.residual_tests().cloned();
        Ok(Self {
            model: read.model.clone(),
            pending: Mutex::default(),
            tested: OnceLock::from(TestedModel {
                model: read.model,
                tests,
            }),
        })
    }
}

fn zero(word: &str) -> PyResult<Zero> {
    match word {
        "level" => Ok(Zero::Levels),
        "mean" => Ok(Zero::Own(Detrend::Mean)),
        "linear" => Ok(Zero::Own(Detrend::Linear)),
        _ => Err(raise(format!(
            "detrend = {word:?}: expected one of level, mean, linear"
        ))),
    }
}

fn state(x0: Option<&PyReadonlyArray1<'_, f64>>) -> Option<DVector<f64>> {
    x0.map(|x0| DVector::from_iterator(x0.as_array().len(), x0.as_array().iter().copied()))
}

/// Identifies a model from recordings, one pair of arrays an experiment.
#[pyfunction]
pub fn identify(
    py: Python<'_>,
    u: Vec<Samples<'_>>,
    y: Vec<Samples<'_>>,
    dt: f64,
    inputs: Vec<String>,
    outputs: Vec<String>,
    json: &str,
) -> PyResult<Model> {
    let options = options(json)?;
    let mut records = ArrayRecords::new(&u, &y, dt, &inputs, &outputs).map_err(raise)?;
    let model = py.detach(|| Model::identified(&mut records, &options));
    model.map_err(raise)
}
