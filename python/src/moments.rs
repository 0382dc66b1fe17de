//! Recordings reduced to moments, which can be sent around, joined and added.

use innovant::identify::{Records, ReducedRecords};
use pyo3::prelude::*;

use crate::arrays::{Samples, columns, recording};
use crate::errors::raise;
use crate::model::Model;
use crate::options::options;

/// Moments of recordings of one plant.
#[pyclass(module = "innovant._innovant", frozen)]
pub struct Moments {
    reduced: ReducedRecords,
}

#[pymethods]
impl Moments {
    #[new]
    #[allow(clippy::too_many_arguments, reason = "called by one Python class")]
    fn new(
        py: Python<'_>,
        u: Samples<'_>,
        y: Samples<'_>,
        dt: f64,
        names: (Vec<String>, Vec<String>),
        overlap: usize,
        keep: usize,
        json: &str,
    ) -> PyResult<Self> {
        let options = options(json)?;
        let data = (columns(&u), columns(&y));
        let log = recording("recording", dt, (&names.0, &names.1), data)?;
        let reduced = py.detach(|| ReducedRecords::new(&log, overlap, &options, keep));
        let reduced = reduced.map_err(raise)?;
        Ok(Self { reduced })
    }

    fn append(&self, next: PyRef<'_, Self>) -> PyResult<Self> {
        let reduced = self.reduced.append(&next.reduced).map_err(raise)?;
        Ok(Self { reduced })
    }

    fn add(&self, other: PyRef<'_, Self>) -> PyResult<Self> {
        let reduced = self.reduced.add(&other.reduced).map_err(raise)?;
        Ok(Self { reduced })
    }

    fn samples(&self) -> usize {
        self.reduced.samples()
    }

    fn recordings(&self) -> usize {
        self.reduced.experiments()
    }

    fn lags(&self) -> usize {
        self.reduced.lags()
    }

    fn identify(&self, py: Python<'_>, json: &str) -> PyResult<Model> {
        let options = options(json)?;
        let model = py.detach(|| Model::identified(&mut self.reduced.clone(), &options));
        model.map_err(raise)
    }

    fn to_json(&self) -> PyResult<String> {
        self.reduced.to_json().map_err(raise)
    }

    #[staticmethod]
    fn from_json(text: &str) -> PyResult<Self> {
        let reduced = ReducedRecords::from_json(text).map_err(raise)?;
        Ok(Self { reduced })
    }
}
