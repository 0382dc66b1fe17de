//! Whether data and options can be judged at all.

use nalgebra::DMatrix;

use super::validate_error::ValidateError;
use super::validation_options::{RecordView, ValidationOptions};
use crate::covariance::ParameterCovariance;
use crate::model::{ModelError, StateSpace};

/// Checks options, covariances, the shape of every record and its values.
pub(super) fn check(
    system: &StateSpace,
    innovation_covariance: Option<&DMatrix<f64>>,
    covariance: Option<&ParameterCovariance>,
    records: &[RecordView<'_>],
    options: &ValidationOptions,
) -> Result<(), ValidateError> {
    if !(options.level > 0.0 && options.level < 0.5) {
        return Err(ValidateError::Level {
            level: options.level,
        });
    }
    if options.lags == Some(0) {
        return Err(ValidateError::NoLag);
    }
    if let Some(matrix) = innovation_covariance {
        square("innovation covariance", matrix, system.outputs())?;
    }
    if let Some(covariance) = covariance {
        let layout = covariance.layout;
        square("parameter covariance", &covariance.matrix, layout.len())?;
        let of_layout = (layout.states, layout.inputs, layout.outputs);
        if of_layout != (system.states(), system.inputs(), system.outputs()) {
            let mut expected = layout;
            (expected.states, expected.inputs, expected.outputs) =
                (system.states(), system.inputs(), system.outputs());
            return Err(ValidateError::Covariance {
                what: "parameter covariance",
                rows: covariance.matrix.nrows(),
                columns: covariance.matrix.ncols(),
                expected: expected.len(),
            });
        }
    }
    if records.iter().all(|record| record.samples() == 0) {
        return Err(ValidateError::NoRecord);
    }
    for (index, record) in records.iter().enumerate() {
        shape(system, record).map_err(|source| ValidateError::Data {
            record: index + 1,
            source,
        })?;
        for (i, column) in record.inputs.iter().enumerate() {
            finite(column, index, || options.input(i))?;
        }
        for (i, column) in record.outputs.iter().enumerate() {
            finite(column, index, || options.output(i))?;
        }
    }
    Ok(())
}

fn square(what: &'static str, matrix: &DMatrix<f64>, expected: usize) -> Result<(), ValidateError> {
    if matrix.shape() != (expected, expected) {
        return Err(ValidateError::Covariance {
            what,
            rows: matrix.nrows(),
            columns: matrix.ncols(),
            expected,
        });
    }
    if matrix.iter().any(|v| !v.is_finite()) {
        return Err(crate::linalg::LinalgError::NotFinite { what }.into());
    }
    Ok(())
}

fn shape(system: &StateSpace, record: &RecordView<'_>) -> Result<(), ModelError> {
    let samples = record.samples();
    for (kind, columns, expected) in [
        ("outputs", record.outputs, system.outputs()),
        ("inputs", record.inputs, system.inputs()),
    ] {
        if columns.len() != expected {
            return Err(ModelError::Channels {
                kind,
                given: columns.len(),
                expected,
            });
        }
        if let Some(index) = columns.iter().position(|column| column.len() != samples) {
            return Err(ModelError::Length {
                kind,
                channel: index + 1,
                given: columns[index].len(),
                expected: samples,
            });
        }
    }
    Ok(())
}

fn finite(column: &[f64], record: usize, name: impl Fn() -> String) -> Result<(), ValidateError> {
    // Zero times a finite number is zero, times anything else NaN: one sum that vectorises.
    let clean = column
        .chunks(4096)
        .all(|chunk| chunk.iter().map(|v| v * 0.0).sum::<f64>() == 0.0);
    if clean {
        return Ok(());
    }
    match column.iter().position(|v| !v.is_finite()) {
        None => Ok(()),
        Some(sample) => Err(ValidateError::NotFinite {
            name: name(),
            record: record + 1,
            sample: sample + 1,
            value: column[sample],
        }),
    }
}
