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

/// A right linear model of the motion about the middle, with a sensor or an actuator that is not linear: white residuals
/// are not enough.
#[test]
fn a_plant_that_is_not_linear() {
    let plant = two_by_two();
    let bends: [fn(f64) -> f64; 3] = [
        |v| v + 0.1 * v * v,
        |v| v.clamp(-1.0, 1.0),
        |v| v.signum() * (v.abs() - 0.3).max(0.0),
    ];
    for bend in bends {
        let studies = study(20, |s| {
            let mut log = plant.record(3000, s);
            // What is recorded is what the command was; the plant has seen something else.
            let seen = log.input_data.clone();
            let mut bent = plant.clone();
            bent.innovation_covariance *= 0.05;
            for (column, seen) in log.input_data.iter_mut().zip(&seen) {
                *column = seen.iter().map(|v| bend(*v)).collect();
            }
            let inputs: Vec<&[f64]> = log.input_data.iter().map(Vec::as_slice).collect();
            let run = bent.system.simulate(&inputs, None).unwrap();
            let noise = bent.record(3000, s + 50);
            for (o, column) in log.output_data.iter_mut().enumerate() {
                for (k, y) in column.iter_mut().enumerate() {
                    *y = run[o][k] + 0.02 * noise.output_data[o][k];
                }
            }
            log.input_data = seen;
            judged_fit(&identified(&log, 3), &log, Estimation)
        });
        let found = studies
            .iter()
            .filter(|v| v.rejected && v.linearity.as_ref().is_some_and(|t| t.p_value < 1e-4));
        assert_eq!(found.count(), 20);
        assert!(studies[0].findings.iter().any(|f| f.contains("not linear")));
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
