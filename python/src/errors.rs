//! Errors of the core as Python exceptions, with the same words.

use std::fmt::Display;

use pyo3::PyErr;
use pyo3::create_exception;
use pyo3::exceptions::PyValueError;

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
