//! Tests of `response`.

use super::*;
use nalgebra::dmatrix;

fn system() -> StateSpace {
    StateSpace::deterministic(
        dmatrix![0.5, 0.3; -0.3, 0.4],
        dmatrix![1.0, 0.0; 0.5, 1.0],
        dmatrix![1.0, 2.0],
        dmatrix![0.0, 0.5],
        0.2,
    )
    .unwrap()
}

#[test]
fn responses_equal_simulations() {
    let s = system();
    let zero = [0.0; 30];
    let mut pulse = [0.0; 30];
    pulse[0] = 1.0;
    let impulse = s.impulse_response(30);
    let step = s.step_response(30);
    let simulated = s.simulate(&[&zero, &pulse], None).unwrap();
    let stepped = s.simulate(&[&[1.0; 30], &zero], None).unwrap();
    for k in 0..30 {
        assert!((impulse[k][(0, 1)] - simulated[0][k]).abs() < 1e-14);
        assert!((step[k][(0, 0)] - stepped[0][k]).abs() < 1e-13);
    }
}

#[test]
fn step_settles_at_the_static_gain() {
    let s = system();
    let last = s.step_response(200).pop().unwrap();
    approx::assert_relative_eq!(last, s.static_gain().unwrap(), epsilon = 1e-12);
    let integrator = StateSpace::deterministic(
        dmatrix![1.0],
        dmatrix![1.0],
        dmatrix![1.0],
        dmatrix![0.0],
        1.0,
    )
    .unwrap();
    assert_eq!(integrator.static_gain(), None);
    assert_eq!(integrator.settling_samples(500).unwrap(), 20);
}

#[test]
fn settling_follows_the_slowest_pole() {
    let mut s = system();
    s.a = dmatrix![0.9, 0.0; 0.0, 0.5];
    // 5 / -ln(0.9) = 47.5
    assert_eq!(s.settling_samples(1000).unwrap(), 48);
    assert_eq!(s.settling_samples(30).unwrap(), 30);
}
