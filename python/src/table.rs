//! Columns of data frames, found by the rules of the command line.

use innovant::internal::log::{TableRoles, time_base_of};
use innovant::log::{RoleNeed, Roles};
use pyo3::prelude::*;

use crate::errors::raise;

/// What messages call a data frame.
const FRAME: &str = "frame";

/// Indices of the input columns, of the output columns, and of the time column.
#[pyfunction]
#[pyo3(signature = (headers, inputs, outputs, time, dt, need))]
pub fn find_columns(
    headers: Vec<String>,
    inputs: Option<Vec<String>>,
    outputs: Option<Vec<String>>,
    time: Option<String>,
    dt: Option<f64>,
    need: &str,
) -> PyResult<(Vec<usize>, Vec<usize>, Option<usize>)> {
    let roles = Roles {
        inputs,
        outputs,
        time,
        sample_time: dt,
        ..Roles::default()
    };
    let need = match need {
        "inputs" => RoleNeed::InputsOnly,
        "outputs" => RoleNeed::OutputsOnly,
        _ => RoleNeed::Identify,
    };
    let found = TableRoles::find(FRAME, &headers, &roles, need).map_err(raise)?;
    Ok((found.inputs, found.outputs, found.time))
}

/// Sample time in seconds of the uniform time stamps of a column.
#[pyfunction]
pub fn time_base(column: &str, stamps: Vec<f64>) -> PyResult<f64> {
    let (dt, _) = time_base_of(FRAME, column, &stamps).map_err(raise)?;
    Ok(dt)
}
