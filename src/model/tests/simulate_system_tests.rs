//! Tests of `simulate_system`.

use super::*;
use nalgebra::{dmatrix, dvector};

fn system() -> StateSpace {
    StateSpace::new(
        dmatrix![0.7, 0.2, 0.0; -0.3, 0.5, 0.1; 0.0, 0.4, -0.6],
        dmatrix![1.0, 0.2; 0.0, -0.5; 0.3, 0.3],
        dmatrix![1.0, 0.0, 0.5; 0.2, 1.0, 0.0],
        dmatrix![0.0, 0.1; 0.05, 0.0],
        dmatrix![0.3, 0.0; 0.1, 0.2; 0.0, 0.1],
        0.5,
    )
    .unwrap()
}

fn column(seed: usize, samples: usize) -> Vec<f64> {
    (0..samples)
        .map(|k| ((k * 37 + seed * 101) % 23) as f64 / 11.0 - 1.0)
        .collect()
}

#[test]
fn run_equals_the_defining_equations() {
    let s = system();
    let (u1, u2, e1, e2) = (column(1, 40), column(2, 40), column(3, 40), column(4, 40));
    let x0 = dvector![1.0, -2.0, 0.5];
    let quiet = s.simulate(&[&u1, &u2], Some(&x0)).unwrap();
    let noisy = s
        .simulate_with_noise(&[&u1, &u2], &[&e1, &e2], Some(&x0))
        .unwrap();
    let (mut x, mut xe) = (x0.clone(), x0);
    for k in 0..40 {
        let (u, e) = (dvector![u1[k], u2[k]], dvector![e1[k], e2[k]]);
        let y = &s.c * &x + &s.d * &u;
        let ye = &s.c * &xe + &s.d * &u + &e;
        for o in 0..2 {
            assert!((quiet[o][k] - y[o]).abs() < 1e-13);
            assert!((noisy[o][k] - ye[o]).abs() < 1e-13);
        }
        x = &s.a * &x + &s.b * &u;
        xe = &s.a * &xe + &s.b * &u + &s.k * &e;
    }
}

#[test]
fn blocks_equal_one_run_bit_for_bit() {
    let s = system();
    let (u1, u2) = (column(5, 50), column(6, 50));
    let whole = s.simulate(&[&u1, &u2], None).unwrap();
    let mut simulator = Simulator::new(&s, None).unwrap();
    let mut parts = simulator.step(&[&u1[..17], &u2[..17]]).unwrap();
    for (part, more) in parts
        .iter_mut()
        .zip(simulator.step(&[&u1[17..], &u2[17..]]).unwrap())
    {
        part.extend(more);
    }
    assert_eq!(whole, parts);
}

#[test]
fn static_and_autonomous_models_run() {
    let gain = StateSpace::deterministic(
        DMatrix::zeros(0, 0),
        DMatrix::zeros(0, 1),
        DMatrix::zeros(2, 0),
        dmatrix![2.0; -1.0],
        1.0,
    )
    .unwrap();
    assert_eq!(
        gain.simulate(&[&[1.0, 3.0]], None).unwrap(),
        [[2.0, 6.0], [-1.0, -3.0]]
    );
    let free = StateSpace::new(
        dmatrix![0.5],
        DMatrix::zeros(1, 0),
        dmatrix![1.0],
        DMatrix::zeros(1, 0),
        dmatrix![1.0],
        1.0,
    )
    .unwrap();
    let y = free
        .simulate_with_noise(&[], &[&[1.0, 0.0, 0.0]], None)
        .unwrap();
    assert_eq!(y, [[1.0, 1.0, 0.5]]);
    assert_eq!(free.simulate(&[], None).unwrap(), [[0.0; 0]]);
}

#[test]
fn a_state_left_alone_reaches_zero() {
    let s = StateSpace::deterministic(
        dmatrix![0.9],
        dmatrix![1.0],
        dmatrix![1.0],
        dmatrix![0.0],
        1.0,
    )
    .unwrap();
    let y = s
        .simulate(&[&vec![0.0; 10_000]], Some(&dvector![1.0]))
        .unwrap();
    assert_eq!(y[0][9_999], 0.0);
    assert!((y[0][100] - 0.9_f64.powi(100)).abs() < 1e-15);
}

#[test]
fn an_unstable_model_overflows_quietly() {
    let s = StateSpace::deterministic(
        dmatrix![2.0],
        dmatrix![1.0],
        dmatrix![1.0],
        dmatrix![0.0],
        1.0,
    )
    .unwrap();
    let y = s.simulate(&[&vec![1.0; 2000]], None).unwrap();
    assert!(y[0][1999].is_infinite());
}

#[test]
fn data_that_do_not_fit_are_refused() {
    let s = system();
    let u = [0.0; 5];
    assert_eq!(
        s.simulate(&[&u], None).unwrap_err().to_string(),
        "the model has 2 inputs, but the data have 1"
    );
    assert!(matches!(
        s.simulate(&[&u, &u[..3]], None),
        Err(ModelError::Length { channel: 2, .. })
    ));
    assert!(s.simulate(&[&u, &u], Some(&dvector![1.0])).is_err());
    assert!(
        s.simulate_with_noise(&[&u, &u], &[&u[..4], &u[..4]], None)
            .is_err()
    );
}
