//! Tests of `cholesky`.

use super::*;

#[test]
fn factor_reproduces_gram() {
    let a = DMatrix::from_fn(7, 4, |i, j| ((i * 5 + j * 3) % 7) as f64 - 2.5);
    let gram = a.transpose() * &a;
    let r = cholesky_upper(&gram).unwrap();
    approx::assert_relative_eq!(r.transpose() * &r, gram, epsilon = 1e-12);
    assert!((0..4).all(|i| r[(i, i)] > 0.0));
}

#[test]
fn indefinite_matrix_names_its_pivot() {
    let gram = DMatrix::from_diagonal(&nalgebra::dvector![1.0, 2.0, -1.0]);
    assert_eq!(
        cholesky_upper(&gram),
        Err(LinalgError::NotPositiveDefinite { order: 3, index: 2 })
    );
}

#[test]
fn square_root_of_singular_matrix() {
    let v = nalgebra::dvector![1.0, -2.0, 3.0];
    let s = &v * v.transpose();
    let f = symmetric_square_root_factor(&s).unwrap();
    approx::assert_relative_eq!(&f * f.transpose(), s, epsilon = 1e-12);
}
