//! Python functions that simulate, and the estimation of their parameters.

use std::sync::{Arc, Mutex, PoisonError};

use innovant::internal::report::plant_fits;
use innovant::internal::report::{Style, plant_estimate_text};
use innovant::physics::estimate::{EstimateOptions, Form, PlantRecording, estimate};
use innovant::physics::external::{ExternalParameter, ExternalPlant, ExternalSimulator, Failure};
use innovant::physics::{Excitation, Hold};
use innovant::report::{PlantDocument, SimulatorDocument};
use numpy::IntoPyArray;
use numpy::ndarray::Array2;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{Samples, columns, sparse_recordings};
use crate::errors::raise;

/// What the function raised, kept to be raised again.
type Raised = Arc<Mutex<Option<PyErr>>>;

/// A Python function of inputs (samples x channels) and a dictionary of parameters.
struct Function {
    function: Py<PyAny>,
    raised: Raised,
}

impl ExternalSimulator for Function {
    fn simulate(
        &self,
        excitation: &Excitation,
        parameters: &[(String, f64)],
    ) -> Result<Vec<Vec<f64>>, Failure> {
        Python::attach(|py| {
            let call = || -> PyResult<Vec<Vec<f64>>> {
                let shape = (excitation.length, excitation.inputs.len());
                // A new array for each call: the function may write into it.
                let u = Array2::from_shape_fn(shape, |(k, c)| excitation.inputs[c][k]);
                let values = PyDict::new(py);
                for (name, value) in parameters {
                    values.set_item(name, value)?;
                }
                let y = self.function.bind(py).call1((u.into_pyarray(py), values))?;
                Ok(columns(&y.extract::<Samples>()?))
            };
            call().map_err(|error| {
                let said = error.to_string();
                let mut raised = self.raised.lock().unwrap_or_else(PoisonError::into_inner);
                raised.get_or_insert(error);
                Failure::Raised(said)
            })
        })
    }

    /// Python runs one function at a time, and it may be one that cannot be entered twice.
    fn parallel(&self) -> bool {
        false
    }
}

/// Estimates the parameters (name, value, min, max) of a function; gives the document and what is said of it.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
pub fn estimate_simulator(
    py: Python<'_>,
    function: Py<PyAny>,
    name: &str,
    inputs: Vec<String>,
    outputs: Vec<String>,
    parameters: Vec<(String, f64, f64, f64)>,
    u: Vec<Samples<'_>>,
    y: Vec<Samples<'_>>,
    dt: f64,
    fix: Vec<String>,
    least_squares: bool,
) -> PyResult<(String, String)> {
    let names: Vec<&str> = parameters.iter().map(|p| p.0.as_str()).collect();
    if let Some(unknown) = fix.iter().find(|f| !names.contains(&f.as_str())) {
        return Err(raise(format!(
            "fix: the simulator has no parameter `{unknown}`; it has {}",
            names.join(", ")
        )));
    }
    let options = EstimateOptions {
        free: parameters.iter().map(|p| !fix.contains(&p.0)).collect(),
        hold: Hold::Zero,
        form: Some(Form::FreeRun),
        least_squares,
    };
    let parameters: Vec<ExternalParameter> = parameters
        .into_iter()
        .map(|(name, value, min, max)| ExternalParameter {
            name,
            value,
            min,
            max,
            unit: None,
            description: String::new(),
        })
        .collect();
    let logs = sparse_recordings(&u, &y, dt, &inputs, &outputs)?;
    let records: Vec<PlantRecording> = logs.iter().map(PlantRecording::from).collect();
    let raised = Raised::default();
    let function = Function {
        function,
        raised: raised.clone(),
    };
    let plant = ExternalPlant::new(name, &inputs, &outputs, &parameters, Arc::new(function));
    py.detach(|| {
        let found = estimate(&plant, &records, &options).map_err(|error| {
            let mut raised = raised.lock().unwrap_or_else(PoisonError::into_inner);
            // As it was raised, with its traceback.
            raised.take().unwrap_or_else(|| raise(error))
        })?;
        let mut document = PlantDocument::new(&plant, &found, options.hold);
        document.fit = plant_fits(&plant, &records, &logs, &found, options.hold);
        document.simulator = Some(SimulatorDocument::new(None, &plant, &found));
        document.sample_time = Some(dt);
        let samples: usize = logs.iter().map(|l| l.samples()).sum();
        let title = format!("{name} from {samples} samples");
        let text = plant_estimate_text(&document, &title, Style::UNICODE);
        Ok((document.to_json().map_err(raise)?, text))
    })
}
