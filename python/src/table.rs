//! Columns of data frames, found by the rules of the command line.

use innovant::log::{RoleNeed, Roles, TableRoles};
use pyo3::prelude::*;

use crate::errors::raise;

fn find(
    headers: &[String],
    inputs: Option<Vec<String>>,
    outputs: Option<Vec<String>>,
    time: Option<String>,
    dt: Option<f64>,
    need: &str,
) -> PyResult<TableRoles> {
    let roles = Roles {
        inputs,
        outputs,
        time,
        sample_time: dt,
    };
    let need = match need {
        "inputs" => RoleNeed::InputsOnly,
        "outputs" => RoleNeed::OutputsOnly,
        _ => RoleNeed::Identify,
    };
    TableRoles::find("frame", headers, &roles, need).map_err(raise)
}

/// Indices of the input columns, of the output columns, and of the time column.
#[pyfunction]
#[pyo3(signature = (headers, inputs, outputs, time, dt, need))]
#[allow(clippy::needless_pass_by_value)]
pub fn find_columns(
    headers: Vec<String>,
    inputs: Option<Vec<String>>,
    outputs: Option<Vec<String>>,
    time: Option<String>,
    dt: Option<f64>,
    need: &str,
) -> PyResult<(Vec<usize>, Vec<usize>, Option<usize>)> {
    let found = find(&headers, inputs, outputs, time, dt, need)?;
    Ok((
        found.inputs().to_vec(),
        found.outputs().to_vec(),
        found.time(),
    ))
}

/// Sample time in seconds of uniform time stamps in the column `time`.
#[pyfunction]
#[allow(clippy::needless_pass_by_value)]
pub fn time_base(headers: Vec<String>, time: String, stamps: Vec<f64>) -> PyResult<f64> {
    let none = Some(Vec::new());
    let found = find(&headers, none.clone(), none, Some(time), None, "either");
    found?.time_base(&stamps).map(|(dt, _)| dt).map_err(raise)
}
