//! Tests of `finite`.

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
