//! Tests of `armax`.

use super::*;
use nalgebra::dmatrix;

#[test]
fn polynomials_give_the_frequency_responses() {
    let s = StateSpace::new(
        dmatrix![0.6, 0.5, 0.1; -0.5, 0.6, 0.3; 0.0, 0.2, -0.4],
        dmatrix![1e-6; 2e-6; -1e-6],
        dmatrix![1.0, 0.3, 0.0],
        dmatrix![2e-7],
        dmatrix![0.3; 0.1; 0.5],
        0.1,
    )
    .unwrap();
    let p = s.armax().unwrap().unwrap();
    assert_eq!((p.a[0], p.b[0], p.c[0]), (1.0, 2e-7, 1.0));
    let at = |p: &[f64], z: Complex64| {
        p.iter()
            .enumerate()
            .map(|(i, v)| z.powi(-(i as i32)) * *v)
            .sum::<Complex64>()
    };
    for w in [0.1, 3.0, 20.0] {
        let z = s.unit_circle(w);
        let g = at(&p.b, z) / at(&p.a, z);
        let h = at(&p.c, z) / at(&p.a, z);
        assert!((g - s.frequency_response(w)[(0, 0)]).norm() < 1e-13 * g.norm());
        assert!((h - s.noise_response(w)[(0, 0)]).norm() < 1e-13 * h.norm());
    }
}

#[test]
fn observer_form_and_back() {
    let p = Armax {
        a: vec![1.0, -1.5, 0.9, -0.2],
        b: vec![0.4, 0.1, -0.3, 0.05],
        c: vec![1.0, 0.3, -0.1, 0.02],
    };
    let s = p.state_space(0.5);
    assert_eq!((s.states(), s.sample_time), (3, 0.5));
    let back = s.armax().unwrap().unwrap();
    for (given, found) in [(&p.a, &back.a), (&p.b, &back.b), (&p.c, &back.c)] {
        assert_eq!(given.len(), found.len());
        for (g, f) in given.iter().zip(found) {
            assert!((g - f).abs() < 1e-13, "{g} {f}");
        }
    }
    // Another basis has the same polynomials.
    let t = dmatrix![1.0, 0.4, -0.2; 0.3, 2.0, 0.1; -0.5, 0.2, 1.5];
    let moved = s.transformed(&t).unwrap().armax().unwrap().unwrap();
    for (g, f) in p.c.iter().zip(&moved.c) {
        assert!((g - f).abs() < 1e-12);
    }
}

#[test]
fn short_polynomials_are_filled_with_zeros() {
    let p = Armax {
        a: vec![1.0, -0.5],
        b: vec![0.0, 0.2, 0.1],
        c: vec![1.0],
    };
    let back = p.state_space(1.0).armax().unwrap().unwrap();
    let expected = [[1.0, -0.5, 0.0], [0.0, 0.2, 0.1], [1.0, 0.0, 0.0]];
    for (found, expected) in [&back.a, &back.b, &back.c].iter().zip(expected) {
        for (f, e) in found.iter().zip(expected) {
            assert!((f - e).abs() < 1e-13);
        }
    }
}

#[test]
fn only_for_one_input_and_one_output() {
    let s = StateSpace::deterministic(
        DMatrix::zeros(1, 1),
        DMatrix::zeros(1, 2),
        DMatrix::zeros(1, 1),
        DMatrix::zeros(1, 2),
        1.0,
    )
    .unwrap();
    assert_eq!(s.armax().unwrap(), None);
}
