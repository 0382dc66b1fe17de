//! Tests of `initial_state`.

use super::*;
use nalgebra::{dmatrix, dvector};

fn system(gain: f64) -> StateSpace {
    StateSpace::new(
        dmatrix![0.95, 0.2; -0.2, 0.9],
        dmatrix![1.0; 0.4],
        dmatrix![1.0, 0.2; 0.3, 1.0],
        dmatrix![0.0; 0.0],
        dmatrix![0.4, 0.1; 0.0, 0.3] * gain,
        1.0,
    )
    .unwrap()
}

fn column(seed: usize, samples: usize) -> Vec<f64> {
    (0..samples)
        .map(|k| ((k * 29 + seed * 53) % 31) as f64 / 15.0 - 1.0)
        .collect()
}

#[test]
fn exact_without_noise() {
    for gain in [0.0, 1.0] {
        let s = system(gain);
        let u = column(1, 5000);
        let x0 = dvector![3.0, -2.0];
        let y = s.simulate(&[&u], Some(&x0)).unwrap();
        let found = estimate_initial_state(&s, &[&u], &[&y[0], &y[1]], None).unwrap();
        assert!((found - &x0).norm() < 1e-9, "gain {gain}");
    }
}

#[test]
fn satisfies_the_normal_equations_of_the_weighted_problem() {
    let s = system(1.0);
    let (u, e1, e2) = (column(1, 300), column(2, 300), column(7, 300));
    let y = s
        .simulate_with_noise(&[&u], &[&e1, &e2], Some(&dvector![1.0, 1.0]))
        .unwrap();
    let lambda = dmatrix![1.0, 0.3; 0.3, 0.5];
    let cost = |x0: &DVector<f64>| {
        let p = s.one_step(&[&u], &[&y[0], &y[1]], Some(x0)).unwrap();
        let inverse = lambda.clone().try_inverse().unwrap();
        (0..300)
            .map(|k| {
                let e = dvector![p.innovations[0][k], p.innovations[1][k]];
                e.dot(&(&inverse * &e))
            })
            .sum::<f64>()
    };
    let found = estimate_initial_state(&s, &[&u], &[&y[0], &y[1]], Some(&lambda)).unwrap();
    let best = cost(&found);
    for direction in [dvector![1e-3, 0.0], dvector![0.0, 1e-3]] {
        assert!(cost(&(&found + &direction)) > best);
        assert!(cost(&(&found - &direction)) > best);
    }
}

#[test]
fn what_the_outputs_do_not_show_stays_zero() {
    let s = StateSpace::deterministic(
        dmatrix![0.9, 0.0; 0.0, 0.5],
        dmatrix![1.0; 1.0],
        dmatrix![1.0, 0.0],
        dmatrix![0.0],
        1.0,
    )
    .unwrap();
    let u = column(1, 50);
    let y = s.simulate(&[&u], Some(&dvector![2.0, 5.0])).unwrap();
    let found = estimate_initial_state(&s, &[&u], &[&y[0]], None).unwrap();
    assert!((found - dvector![2.0, 0.0]).norm() < 1e-10);
}

#[test]
fn integrators_use_the_whole_record_and_unstable_models_do_not_overflow() {
    for pole in [1.0, 1.2] {
        let s = StateSpace::deterministic(
            dmatrix![pole],
            dmatrix![1.0],
            dmatrix![1.0],
            dmatrix![0.0],
            1.0,
        )
        .unwrap();
        let u = vec![0.0; 6000];
        let y = s.simulate(&[&u], Some(&dvector![2.5])).unwrap();
        let keep = if pole > 1.0 { 200 } else { 6000 };
        let found = estimate_initial_state(&s, &[&u[..keep]], &[&y[0][..keep]], None).unwrap();
        assert!((found[0] - 2.5).abs() < 1e-9);
    }
}

#[test]
fn short_and_unfit_data() {
    let s = system(1.0);
    let found = estimate_initial_state(&s, &[&[]], &[&[], &[]], None).unwrap();
    assert_eq!(found, dvector![0.0, 0.0]);
    assert!(estimate_initial_state(&s, &[&[0.0]], &[&[0.0]], None).is_err());
    let bad = estimate_initial_state(&s, &[&[0.0]], &[&[f64::NAN], &[0.0]], None);
    assert!(matches!(bad, Err(ModelError::Linalg(_))));
    let lambda = DMatrix::identity(3, 3);
    let shape = estimate_initial_state(&s, &[&[0.0]], &[&[0.0], &[0.0]], Some(&lambda));
    assert!(matches!(shape, Err(ModelError::Shape { .. })));
}
