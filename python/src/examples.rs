//! Recordings of known plants, for documentation and tests.

use innovant::internal::systems::{TestSystem, servo, van_wingerden_one};
use numpy::PyArray2;
use pyo3::prelude::*;

use crate::arrays::samples;

/// Inputs, outputs and sample time of the plant called `name`.
#[pyfunction]
#[allow(clippy::type_complexity, reason = "two arrays and a number")]
pub fn example<'py>(
    py: Python<'py>,
    name: &str,
    count: usize,
    seed: u64,
) -> (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>, f64) {
    let system: TestSystem = if name == "servo" {
        servo()
    } else {
        van_wingerden_one()
    };
    let log = system.record(count, seed);
    (
        samples(py, &log.input_data),
        samples(py, &log.output_data),
        log.sample_time,
    )
}
