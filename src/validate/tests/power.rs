//! A wrong model is rejected.

use super::support::*;
use crate::systems::{two_by_two, van_wingerden_one};
use crate::validate::Relation::{Estimation, Fresh};
use nalgebra::DMatrix;

#[test]
fn an_order_too_low() {
    let plant = van_wingerden_one();
    let studies = study(20, |s| {
        let log = plant.record(1000, s);
        judged_fit(&identified(&log, 2), &log, Estimation)
    });
    for v in &studies {
        assert!(v.rejected);
        assert!(v.findings[0].contains("--order"), "{:?}", v.findings);
        assert!(
            v.past_inputs
                .as_ref()
                .is_some_and(|t| t.explained_share > 0.05)
        );
    }
}

#[test]
fn a_gain_off_by_a_fifth() {
    for plant in [van_wingerden_one(), steady_servo(), two_by_two()] {
        for k in [1.0, 0.0] {
            let mut wrong = plant.system.clone();
            wrong.b *= 1.2;
            wrong.k *= k;
            let studies = study(20, |s| {
                judged(&wrong, None, None, &plant.record(2000, s), &[], Fresh)
            });
            let found = studies
                .iter()
                .filter(|v| v.past_inputs.as_ref().is_some_and(|t| t.p_value < 1e-4) && v.rejected);
            assert_eq!(found.count(), 20);
        }
    }
}

/// A missing delay of one input shows at the lag and the pair where it is.
#[test]
fn the_strongest_correlation_names_the_place() {
    let plant = two_by_two();
    let mut wrong = plant.system.clone();
    wrong.b.column_mut(1).fill(0.0);
    let v = judged(&wrong, None, None, &plant.record(2000, 1), &[], Fresh);
    let strongest = v.past_inputs.unwrap().strongest.unwrap();
    assert_eq!((strongest.from.as_str(), strongest.lag), ("u2", 1));
    assert!(strongest.correlation.abs() > strongest.bound_99);
}

#[test]
fn noise_twice_as_large_as_stated() {
    let plant = van_wingerden_one();
    let fit = identified(&plant.record(1000, 1), 4);
    let mut loud = plant.clone();
    loud.innovation_covariance *= 2.0;
    for seed in 0..10 {
        let v = judged_fit(&fit, &loud.record(1000, 50 + seed), Fresh);
        let size = v.innovation_size.unwrap();
        assert!(v.rejected && size.p_value < 1e-6);
        assert!(size.outputs.iter().all(|o| (1.5..2.6).contains(&o.ratio)));
        assert!(v.findings.iter().any(|f| f.contains("times the variance")));
    }
}

/// Direct feedthrough that the model leaves out, and the same taken into account.
#[test]
fn feedthrough() {
    let mut plant = two_by_two();
    plant.system.d = DMatrix::from_row_slice(2, 2, &[0.3, 0.0, 0.0, 0.2]);
    let log = plant.record(1500, 4);
    let right = judged(&plant.system, None, None, &log, &[], Fresh);
    assert!(!right.rejected && right.same_sample.is_none());
    assert_eq!(right.cross_correlation[0].lags[0], 0);
    let mut without = plant.system.clone();
    without.d.fill(0.0);
    let v = judged(&without, None, None, &log, &[], Fresh);
    assert!(v.findings.iter().any(|f| f.contains("--feedthrough")));
    let mut wrong = plant.system.clone();
    wrong.d *= 0.5;
    assert!(judged(&wrong, None, None, &log, &[], Fresh).rejected);
}
