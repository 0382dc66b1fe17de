//! Python wheel over the same core: `innovant.identify(u, y, dt=...)`.

use innovant::identify::{CovarianceKind, Method, Order, Polish, Stochastic, Weight};
use innovant::log::{Channel, Log};
use innovant::moments::Detrend;
use innovant::report::ModelDocument;
use innovant::{Model, Options};
use nalgebra::DMatrix;
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray2, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// State-space model in innovation form; describes deviations from the operating point.
#[pyclass(name = "Model", module = "innovant", frozen)]
struct PyModel {
    model: Model,
}

fn array<'py>(py: Python<'py>, matrix: &DMatrix<f64>) -> Bound<'py, PyArray2<f64>> {
    Array2::from_shape_fn(matrix.shape(), |index| matrix[index]).into_pyarray(py)
}

#[pymethods]
#[allow(non_snake_case)]
impl PyModel {
    #[getter]
    fn A<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        array(py, &self.model.system.a)
    }

    #[getter]
    fn B<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        array(py, &self.model.system.b)
    }

    #[getter]
    fn C<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        array(py, &self.model.system.c)
    }

    #[getter]
    fn D<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        array(py, &self.model.system.d)
    }

    #[getter]
    fn K<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        array(py, &self.model.system.k)
    }

    #[getter]
    fn innovation_covariance<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        let covariance = self.model.innovation_covariance.as_ref()?;
        Some(array(py, covariance))
    }

    /// Covariance of `[vec A; vec B; vec K; vec C (; vec D)]` in the basis of this model.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        let covariance = self.model.covariance.as_ref()?;
        Some(array(py, &covariance.matrix))
    }

    #[getter]
    fn dt(&self) -> f64 {
        self.model.system.sample_time
    }

    #[getter]
    fn order(&self) -> usize {
        self.model.system.states()
    }

    #[getter]
    fn warnings(&self) -> Vec<String> {
        let summary = self.model.summary.as_ref();
        summary.map_or_else(Vec::new, |s| s.warnings.clone())
    }

    /// The document that the command line writes.
    fn to_json(&self) -> PyResult<String> {
        ModelDocument::new(&self.model)
            .and_then(|document| document.to_json())
            .map_err(|error| PyValueError::new_err(error.to_string()))
    }

    fn __repr__(&self) -> String {
        let system = &self.model.system;
        format!(
            "innovant.Model(order={}, inputs={}, outputs={}, dt={})",
            system.states(),
            system.inputs(),
            system.outputs(),
            system.sample_time
        )
    }
}

fn columns(array: &PyReadonlyArray2<'_, f64>) -> Vec<Vec<f64>> {
    let view = array.as_array();
    view.columns().into_iter().map(|c| c.to_vec()).collect()
}

fn channels(letter: char, count: usize) -> Vec<Channel> {
    (1..=count)
        .map(|i| Channel::new(format!("{letter}{i}")))
        .collect()
}

fn choice<T: Copy>(name: &str, value: &str, choices: &[(&str, T)]) -> PyResult<T> {
    choices
        .iter()
        .find(|(word, _)| *word == value)
        .map(|(_, choice)| *choice)
        .ok_or_else(|| {
            let words: Vec<&str> = choices.iter().map(|(word, _)| *word).collect();
            PyValueError::new_err(format!(
                "{name} = {value:?} is not one of {}",
                words.join(", ")
            ))
        })
}

/// Identifies a state-space model from arrays of samples x channels.
#[pyfunction]
#[pyo3(signature = (u, y, *, dt, method="pbsid-opt", stochastic=None, order=None, past=None, future=None, weight=None, polish="auto",
    covariance="model", detrend="mean", feedthrough=false, delay=Vec::new(), stable=false, seed=0))]
#[allow(clippy::too_many_arguments)]
fn identify(
    py: Python<'_>,
    u: PyReadonlyArray2<'_, f64>,
    y: PyReadonlyArray2<'_, f64>,
    dt: f64,
    method: &str,
    stochastic: Option<&str>,
    order: Option<usize>,
    past: Option<usize>,
    future: Option<usize>,
    weight: Option<&str>,
    polish: &str,
    covariance: &str,
    detrend: &str,
    feedthrough: bool,
    delay: Vec<usize>,
    stable: bool,
    seed: u64,
) -> PyResult<PyModel> {
    let methods: Vec<(&str, Method)> = Method::all().iter().map(|m| (m.name(), *m)).collect();
    let steps: Vec<(&str, Stochastic)> = Stochastic::all().iter().map(|s| (s.name(), *s)).collect();
    let options = Options {
        method: choice("method", method, &methods)?,
        stochastic: stochastic
            .map(|word| choice("stochastic", word, &steps))
            .transpose()?,
        order: order.map_or(Order::Auto, Order::Fixed),
        past,
        future,
        weight: weight
            .map(|word| {
                choice(
                    "weight",
                    word,
                    &[("identity", Weight::Identity), ("cva", Weight::Cva)],
                )
            })
            .transpose()?,
        polish: choice(
            "polish",
            polish,
            &[
                ("auto", Polish::Auto),
                ("always", Polish::Always),
                ("never", Polish::Never),
            ],
        )?,
        covariance: choice(
            "covariance",
            covariance,
            &[
                ("model", CovarianceKind::Model),
                ("robust", CovarianceKind::Robust),
            ],
        )?,
        detrend: choice(
            "detrend",
            detrend,
            &[
                ("mean", Detrend::Mean),
                ("linear", Detrend::Linear),
                ("none", Detrend::None),
            ],
        )?,
        feedthrough,
        input_delay: delay,
        stable,
        seed,
    };
    let (inputs, outputs) = (columns(&u), columns(&y));
    let log = Log::from_columns(
        "array",
        dt,
        channels('u', inputs.len()),
        channels('y', outputs.len()),
        inputs,
        outputs,
    )
    .map_err(|error| PyValueError::new_err(error.to_string()))?;
    let model = py
        .detach(|| innovant::identify(&[log], &options))
        .map_err(|error| PyValueError::new_err(error.to_string()))?;
    Ok(PyModel { model })
}

#[pymodule]
fn _innovant(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyModel>()?;
    module.add_function(wrap_pyfunction!(identify, module)?)?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))
}
