//! Tests of `zero_uncertainty`.

use super::*;
use crate::covariance::test_covariances::{self, assert_close};

#[test]
fn equals_central_differences() {
    for feedthrough in [false, true] {
        let (system, covariance) = test_covariances::square(feedthrough);
        let found = zero_uncertainties(&system, &covariance).unwrap();
        assert_eq!(found.len(), if feedthrough { 3 } else { 1 });
        for (i, uncertainty) in found.iter().enumerate() {
            let numeric = test_covariances::numeric_covariance(&system, &covariance, |s| {
                let zero = s.zeros().unwrap()[i];
                vec![zero.value.re, zero.value.im, zero.natural_frequency]
            });
            let c = uncertainty.covariance.unwrap();
            let place = numeric.view((0, 0), (2, 2)).into_owned();
            assert_close(c.as_flattened(), place.as_slice(), 1e-6);
            let std = uncertainty.natural_frequency_std.unwrap();
            assert!((std - numeric[(2, 2)].sqrt()).abs() < 1e-6 * std);
        }
    }
}

#[test]
fn does_not_depend_on_the_state_basis() {
    let (system, covariance) = test_covariances::square(true);
    let (other, moved) = test_covariances::in_another_basis(&system, &covariance);
    let a = zero_uncertainties(&system, &covariance).unwrap();
    let b = zero_uncertainties(&other, &moved).unwrap();
    for (x, y) in a.iter().zip(&b) {
        let (x, y) = (x.covariance.unwrap(), y.covariance.unwrap());
        assert_close(x.as_flattened(), y.as_flattened(), 1e-9);
    }
}

#[test]
fn units_of_the_channels_do_not_matter() {
    let (system, covariance) = test_covariances::square(true);
    let a = zero_uncertainties(&system, &covariance).unwrap();
    let (mut scaled, mut moved) = (system.clone(), covariance.clone());
    // Inputs in units a million times smaller: B and D scale, and so does their covariance.
    scaled.b *= 1e-6;
    scaled.d *= 1e-6;
    let layout = covariance.layout;
    let is_input = |p: usize| (layout.b()..layout.k()).contains(&p) || p >= layout.d();
    for i in 0..layout.len() {
        for j in 0..layout.len() {
            for p in [i, j] {
                if is_input(p) {
                    moved.matrix[(i, j)] *= 1e-6;
                }
            }
        }
    }
    let b = zero_uncertainties(&scaled, &moved).unwrap();
    for (x, y) in a.iter().zip(&b) {
        let (x, y) = (x.covariance.unwrap(), y.covariance.unwrap());
        assert_close(x.as_flattened(), y.as_flattened(), 1e-8);
    }
}

#[test]
fn more_outputs_than_inputs_have_no_zero() {
    let (system, covariance) = test_covariances::two_by_three(false);
    assert!(zero_uncertainties(&system, &covariance).unwrap().is_empty());
}
