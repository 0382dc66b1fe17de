//! numpy arrays to recordings, and matrices to numpy arrays.

use innovant::log::{Channel, Log};
use nalgebra::DMatrix;
use numpy::ndarray::Array2;
use numpy::{Element, IntoPyArray, PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::errors::raise;

/// An array of samples x channels, in any layout; read only.
pub type Samples<'py> = PyReadonlyArray2<'py, f64>;

/// The columns of an array.
pub fn columns(array: &Samples<'_>) -> Vec<Vec<f64>> {
    let view = array.as_array();
    view.columns().into_iter().map(|c| c.to_vec()).collect()
}

/// Columns as slices, for the functions of the core.
pub fn slices(columns: &[Vec<f64>]) -> Vec<&[f64]> {
    columns.iter().map(Vec::as_slice).collect()
}

/// Columns (channel by channel) to an array of samples x channels.
pub fn samples<'py>(py: Python<'py>, columns: &[Vec<f64>]) -> Bound<'py, PyArray2<f64>> {
    let rows = columns.first().map_or(0, Vec::len);
    Array2::from_shape_fn((rows, columns.len()), |(k, c)| columns[c][k]).into_pyarray(py)
}

/// A matrix as an array.
pub fn matrix<'py, T: Element + Copy + nalgebra::Scalar>(
    py: Python<'py>,
    matrix: &DMatrix<T>,
) -> Bound<'py, PyArray2<T>> {
    Array2::from_shape_fn(matrix.shape(), |index| matrix[index]).into_pyarray(py)
}

/// Channels by their headers: `force [N]` is `force` in `N`.
pub fn channels(headers: &[String]) -> Vec<Channel> {
    headers.iter().map(|h| Channel::parse(h)).collect()
}

/// A recording made of arrays.
pub fn recording(
    name: &str,
    dt: f64,
    (inputs, outputs): (&[String], &[String]),
    (u, y): (Vec<Vec<f64>>, Vec<Vec<f64>>),
) -> PyResult<Log> {
    Log::from_columns(name, dt, channels(inputs), channels(outputs), u, y).map_err(raise)
}

/// What messages call the recording of an experiment: `recording`, or `recording 1`, `recording 2`, ...
pub fn recording_name(index: usize, count: usize) -> String {
    if count == 1 {
        "recording".to_owned()
    } else {
        format!("recording {}", index + 1)
    }
}

/// One recording an experiment.
pub fn recordings(
    u: &[Samples<'_>],
    y: &[Samples<'_>],
    dt: f64,
    inputs: &[String],
    outputs: &[String],
) -> PyResult<Vec<Log>> {
    each(u, y, |name, (u, y)| {
        recording(name, dt, (inputs, outputs), (u, y))
    })
}

/// The same for plants in equations and simulators, which are compared with the outputs that are not NaN.
pub fn sparse_recordings(
    u: &[Samples<'_>],
    y: &[Samples<'_>],
    dt: f64,
    inputs: &[String],
    outputs: &[String],
) -> PyResult<Vec<Log>> {
    each(u, y, |name, data| {
        let named = (channels(inputs), channels(outputs));
        Log::with_missing_outputs(name, dt, named, data).map_err(raise)
    })
}

fn each(
    u: &[Samples<'_>],
    y: &[Samples<'_>],
    recording: impl Fn(&str, (Vec<Vec<f64>>, Vec<Vec<f64>>)) -> PyResult<Log>,
) -> PyResult<Vec<Log>> {
    let pairs = u.iter().zip(y).enumerate();
    pairs
        .map(|(index, (one_u, one_y))| {
            let name = recording_name(index, u.len());
            recording(&name, (columns(one_u), columns(one_y)))
        })
        .collect()
}
