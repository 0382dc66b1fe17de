//! Systems and covariances for the tests of this folder.

use nalgebra::{DMatrix, dmatrix};

use super::parameters::{ParameterCovariance, ParameterLayout};
use crate::model::StateSpace;

/// A positive definite matrix without structure, entries of size `scale`.
pub(crate) fn positive_definite(order: usize, scale: f64) -> DMatrix<f64> {
    let factor = DMatrix::from_fn(order, order, |i, j| {
        (((i * 37 + j * 61 + i * j * 13) % 29) as f64 - 14.0) / 14.0
    });
    (&factor * factor.transpose() + DMatrix::identity(order, order) * 0.1)
        * (scale * scale / order as f64)
}

fn with_covariance(
    system: StateSpace,
    feedthrough: bool,
    scale: f64,
) -> (StateSpace, ParameterCovariance) {
    let layout = ParameterLayout::of(&system, feedthrough);
    let matrix = positive_definite(layout.len(), scale);
    let covariance = ParameterCovariance::new(layout, matrix, None).unwrap();
    (system, covariance)
}

/// No state: `y = 2 u`, the gain with the given variance.
pub(crate) fn static_gain(variance: f64) -> (StateSpace, ParameterCovariance) {
    let system = StateSpace::deterministic(
        DMatrix::zeros(0, 0),
        DMatrix::zeros(0, 1),
        DMatrix::zeros(1, 0),
        dmatrix![2.0],
        1.0,
    )
    .unwrap();
    let layout = ParameterLayout::of(&system, true);
    let covariance = ParameterCovariance::new(layout, dmatrix![variance], None).unwrap();
    (system, covariance)
}

/// One input, one output, a lightly damped pair; `D` not estimated.
pub(crate) fn oscillator() -> (StateSpace, ParameterCovariance) {
    let system = StateSpace::new(
        dmatrix![0.9, 0.35; -0.3, 0.85],
        dmatrix![1.0; 0.4],
        dmatrix![1.0, 0.2],
        dmatrix![0.0],
        dmatrix![0.3; 0.1],
        0.1,
    )
    .unwrap();
    with_covariance(system, false, 1e-3)
}

/// Three outputs, two inputs, a pair and a negative real pole.
pub(crate) fn two_by_three(feedthrough: bool) -> (StateSpace, ParameterCovariance) {
    let system = StateSpace::new(
        dmatrix![0.6, 0.5, 0.1; -0.5, 0.6, 0.3; 0.0, 0.2, -0.4],
        dmatrix![1.0, 0.2; 0.0, -0.5; 0.3, 0.3],
        dmatrix![1.0, 0.0, 0.5; 0.2, 1.0, 0.0; 0.0, -0.3, 0.7],
        dmatrix![0.1, 0.0; 0.0, 0.2; 0.4, 0.0],
        dmatrix![0.3, 0.0, 0.1; 0.1, 0.2, 0.0; 0.0, 0.1, -0.2],
        0.5,
    )
    .unwrap();
    with_covariance(system, feedthrough, 1e-3)
}

/// Two inputs, two outputs, with zeros; the number of states is three.
pub(crate) fn square(feedthrough: bool) -> (StateSpace, ParameterCovariance) {
    let (mut system, _) = two_by_three(feedthrough);
    system.c = system.c.rows(0, 2).into_owned();
    system.d = if feedthrough {
        dmatrix![1.0, 0.3; -0.2, 0.8]
    } else {
        DMatrix::zeros(2, 2)
    };
    system.k = system.k.columns(0, 2).into_owned();
    with_covariance(system, feedthrough, 1e-3)
}

/// Gradient of every component of `f` in `theta`, by central differences.
pub(crate) fn central_differences(
    system: &StateSpace,
    layout: &ParameterLayout,
    f: impl Fn(&StateSpace) -> Vec<f64>,
) -> Vec<Vec<f64>> {
    let theta = layout.pack(system);
    let step = 1e-6;
    let mut gradients = vec![vec![0.0; theta.len()]; f(system).len()];
    for p in 0..theta.len() {
        let moved = |by: f64| {
            let mut theta = theta.clone();
            theta[p] += by;
            f(&layout.unpack(&theta, system))
        };
        for (gradient, (up, down)) in gradients
            .iter_mut()
            .zip(moved(step).into_iter().zip(moved(-step)))
        {
            gradient[p] = (up - down) / (2.0 * step);
        }
    }
    gradients
}

/// Covariance of `f` from differences: `J Cov J'`.
pub(crate) fn numeric_covariance(
    system: &StateSpace,
    covariance: &ParameterCovariance,
    f: impl Fn(&StateSpace) -> Vec<f64>,
) -> DMatrix<f64> {
    let rows = central_differences(system, &covariance.layout, f);
    let jacobian = DMatrix::from_fn(rows.len(), covariance.layout.len(), |i, j| rows[i][j]);
    &jacobian * &covariance.matrix * jacobian.transpose()
}

/// The same model and covariance in another state basis: `theta` changes linearly with `T` fixed.
pub(crate) fn in_another_basis(
    system: &StateSpace,
    covariance: &ParameterCovariance,
) -> (StateSpace, ParameterCovariance) {
    let n = system.states();
    let t = DMatrix::from_fn(n, n, |i, j| {
        if i == j {
            1.5
        } else {
            ((i * 3 + j * 5) % 4) as f64 * 0.2 - 0.3
        }
    });
    let layout = covariance.layout;
    let size = layout.len();
    let mut map = DMatrix::zeros(size, size);
    for p in 0..size {
        let mut unit = vec![0.0; size];
        unit[p] = 1.0;
        let moved = layout.unpack(&unit, system).transformed(&t).unwrap();
        map.set_column(p, &nalgebra::DVector::from_vec(layout.pack(&moved)));
    }
    let matrix = &map * &covariance.matrix * map.transpose();
    (
        system.transformed(&t).unwrap(),
        ParameterCovariance::new(layout, matrix, covariance.degrees_of_freedom).unwrap(),
    )
}

/// Equal to a relative tolerance of the largest entry.
pub(crate) fn assert_close(a: &[f64], b: &[f64], tolerance: f64) {
    assert_eq!(a.len(), b.len());
    let size = b.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    for (x, y) in a.iter().zip(b) {
        assert!((x - y).abs() <= tolerance * size, "{a:?} against {b:?}");
    }
}
