//! Whether numbers are numbers.

use nalgebra::DMatrix;

/// Entries that are looked at together: long enough to be vectorised, short enough to stop early.
const TOGETHER: usize = 256;

/// Whether no entry is NaN or infinite.
pub fn all_finite(matrix: &DMatrix<f64>) -> bool {
    matrix
        .as_slice()
        .chunks(TOGETHER)
        .all(|part| part.iter().fold(true, |all, v| all & v.is_finite()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_entry_is_enough() {
        let mut matrix = DMatrix::zeros(30, 20);
        assert!(all_finite(&matrix) && all_finite(&DMatrix::zeros(0, 0)));
        for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            matrix[(29, 19)] = wrong;
            assert!(!all_finite(&matrix));
        }
    }
}
