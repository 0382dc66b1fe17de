//! Errors of the core as Python exceptions, with the same words.

use std::fmt::Display;

use pyo3::create_exception;
use pyo3::exceptions::PyValueError;
use pyo3::{PyErr, PyResult};

create_exception!(
    innovant,
    InnovantError,
    PyValueError,
    "What is wrong with recordings, options or documents, and what to do about it."
);

/// An error of the core.
pub fn raise(error: impl Display) -> PyErr {
    InnovantError::new_err(error.to_string())
}

/// A level of significance that a verdict can be made with.
pub fn check_level(level: f64) -> PyResult<()> {
    if level > 0.0 && level < 0.5 {
        return Ok(());
    }
    Err(raise(format!(
        "level = {level}: expected a probability between 0 and 0.5, such as 0.01"
    )))
}
