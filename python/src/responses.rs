//! Poles, zeros, frequency and step response with their uncertainty, as arrays.

use innovant::covariance::{
    Path, PoleUncertainty, pole_uncertainties, response_bands, static_gain_std, step_response_std,
    zero_uncertainties,
};
use innovant::model::Pole;
use nalgebra::DMatrix;
use num_complex::Complex64;
use numpy::ndarray::{Array1, Array3, Array4, Array5};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3, PyArray4, PyArray5, PyReadonlyArray1};
use pyo3::prelude::*;

use crate::arrays::matrix;
use crate::errors::raise;
use crate::model::Model;

/// Value, covariance of (Re, Im), natural frequency, damping and time constant, each with its standard deviation.
/// What is not known is NaN.
type Roots<'py> = (
    Bound<'py, PyArray1<Complex64>>,
    Bound<'py, PyArray3<f64>>,
    Vec<Bound<'py, PyArray1<f64>>>,
);

/// Response, covariance, bands of the magnitude at 95 and 99 %, band of the phase at 95 %.
type Response<'py> = (
    Bound<'py, PyArray3<Complex64>>,
    Option<Bound<'py, PyArray5<f64>>>,
    Option<Vec<Bound<'py, PyArray4<f64>>>>,
);

/// Frequencies that are shown where none are asked for.
const FREQUENCIES: usize = 200;

fn roots(py: Python<'_>, roots: Vec<PoleUncertainty>) -> Roots<'_> {
    let known = |value: Option<f64>| value.unwrap_or(f64::NAN);
    let column = |of: &dyn Fn(&PoleUncertainty) -> f64| {
        Array1::from_iter(roots.iter().map(of)).into_pyarray(py)
    };
    let value = Array1::from_iter(roots.iter().map(|r| r.pole.value)).into_pyarray(py);
    let covariance = Array3::from_shape_fn((roots.len(), 2, 2), |(i, a, b)| {
        roots[i].covariance.map_or(f64::NAN, |c| c[a][b])
    });
    let columns = vec![
        column(&|r| r.pole.natural_frequency),
        column(&|r| known(r.natural_frequency_std)),
        column(&|r| known(r.pole.damping)),
        column(&|r| known(r.damping_std)),
        column(&|r| known(r.pole.time_constant)),
        column(&|r| known(r.time_constant_std)),
    ];
    (value, covariance.into_pyarray(py), columns)
}

/// Poles, slowest first.
#[pyfunction]
pub fn poles<'py>(py: Python<'py>, model: &Model) -> PyResult<Roots<'py>> {
    let system = &model.model.system;
    let found = match &model.model.covariance {
        Some(covariance) => pole_uncertainties(system, covariance).map_err(raise)?,
        None => without_uncertainty(system.sample_time, system.poles().map_err(raise)?),
    };
    Ok(roots(py, found))
}

/// Invariant zeros from inputs to outputs.
#[pyfunction]
pub fn zeros<'py>(py: Python<'py>, model: &Model) -> PyResult<Roots<'py>> {
    let system = &model.model.system;
    let found = match &model.model.covariance {
        Some(covariance) => zero_uncertainties(system, covariance).map_err(raise)?,
        None => without_uncertainty(system.sample_time, system.zeros().map_err(raise)?),
    };
    Ok(roots(py, found))
}

/// Logarithmic grid up to the Nyquist frequency.
#[pyfunction]
pub fn default_frequencies<'py>(
    py: Python<'py>,
    model: &Model,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let grid = model.model.system.default_frequencies(FREQUENCIES);
    Ok(Array1::from_vec(grid.map_err(raise)?).into_pyarray(py))
}

/// From the inputs, or from the innovations, at frequencies in rad/s; arrays outputs x inputs x frequencies.
#[pyfunction]
pub fn frequency_response<'py>(
    model: &Model,
    py: Python<'py>,
    omega: PyReadonlyArray1<'py, f64>,
    noise: bool,
) -> PyResult<Response<'py>> {
    let system = &model.model.system;
    let omega: Vec<f64> = omega.as_array().iter().copied().collect();
    let path = if noise { Path::Innovation } else { Path::Input };
    let columns = if noise {
        system.outputs()
    } else {
        system.inputs()
    };
    let shape = (system.outputs(), columns, omega.len());
    let seed = model.model.summary.as_ref().map_or(0, |s| s.options.seed);
    let bands = py.detach(|| match &model.model.covariance {
        Some(covariance) => response_bands(system, covariance, &omega, path, seed).map(Some),
        None => Ok(None),
    });
    let Some(bands) = bands.map_err(raise)? else {
        let at: Vec<DMatrix<Complex64>> = omega.iter().map(|w| path.response(system, *w)).collect();
        let response = Array3::from_shape_fn(shape, |(o, i, k)| at[k][(o, i)]);
        return Ok((response.into_pyarray(py), None, None));
    };
    let band = |(o, i, k): (usize, usize, usize)| &bands[k][(o, i)];
    let (l, r, m) = shape;
    let response = Array3::from_shape_fn(shape, |at| band(at).response);
    let covariance = Array5::from_shape_fn((l, r, m, 2, 2), |(o, i, k, a, b)| {
        band((o, i, k)).covariance[a][b]
    });
    let ends = |of: &dyn Fn(&innovant::covariance::ResponseBand) -> [f64; 2]| {
        Array4::from_shape_fn((l, r, m, 2), |(o, i, k, end)| of(band((o, i, k)))[end])
            .into_pyarray(py)
    };
    Ok((
        response.into_pyarray(py),
        Some(covariance.into_pyarray(py)),
        Some(vec![
            ends(&|b| b.magnitude_95),
            ends(&|b| b.magnitude_99),
            ends(&|b| b.phase_95),
        ]),
    ))
}

/// Samples after which a step has settled.
#[pyfunction]
pub fn settling_samples(model: &Model, most: usize) -> PyResult<usize> {
    model.model.system.settling_samples(most).map_err(raise)
}

/// Values and standard deviations, outputs x inputs x samples.
#[pyfunction]
#[allow(clippy::type_complexity, reason = "a pair of arrays")]
pub fn step_response<'py>(
    model: &Model,
    py: Python<'py>,
    count: usize,
) -> PyResult<(Bound<'py, PyArray3<f64>>, Option<Bound<'py, PyArray3<f64>>>)> {
    let system = &model.model.system;
    let shape = (system.outputs(), system.inputs(), count);
    let stacked = |of: &[DMatrix<f64>]| {
        Array3::from_shape_fn(shape, |(o, i, k)| of[k][(o, i)]).into_pyarray(py)
    };
    let (values, std) = py.detach(|| {
        let values = system.step_response(count);
        let covariance = model.model.covariance.as_ref();
        (
            values,
            covariance.map(|c| step_response_std(system, c, count)),
        )
    });
    let std = std.transpose().map_err(raise)?;
    Ok((stacked(&values), std.map(|std| stacked(&std))))
}

/// Static gain and its standard deviation, outputs x inputs; `None` with an integrator.
#[pyfunction]
#[allow(clippy::type_complexity, reason = "a pair of arrays")]
pub fn static_gain<'py>(
    model: &Model,
    py: Python<'py>,
) -> PyResult<Option<(Bound<'py, PyArray2<f64>>, Option<Bound<'py, PyArray2<f64>>>)>> {
    let system = &model.model.system;
    let Some(gain) = system.static_gain() else {
        return Ok(None);
    };
    let std = match &model.model.covariance {
        Some(covariance) => static_gain_std(system, covariance).map_err(raise)?,
        None => None,
    };
    Ok(Some((matrix(py, &gain), std.map(|std| matrix(py, &std)))))
}

fn without_uncertainty(dt: f64, roots: Vec<Pole>) -> Vec<PoleUncertainty> {
    roots
        .into_iter()
        .map(|root| PoleUncertainty::new(root, None, dt))
        .collect()
}
