//! Whether numbers are numbers.

use nalgebra::DMatrix;

/// Entries that are looked at together: long enough to be vectorised, short enough to stop early.
const TOGETHER: usize = 256;

/// Whether no entry is NaN or infinite.
pub(crate) fn all_finite(matrix: &DMatrix<f64>) -> bool {
    matrix
        .as_slice()
        .chunks(TOGETHER)
        .all(|part| part.iter().fold(true, |all, v| all & v.is_finite()))
}

#[cfg(test)]
#[path = "tests/finite_tests.rs"]
mod tests;
