//! Discrete Lyapunov equation, and the observer gain that stabilises a predictor.

use nalgebra::DMatrix;

use super::factorisation::{eigen, qr_thin, spectral_radius};
use super::linalg_error::LinalgError;

/// Solves `P = A P A' + Q` for a stable `A` by squared Smith iteration (Smith 1968): `P` after `k`
/// steps holds the first `2^k` terms of `sum A^i Q A'^i`.
///
/// # Errors
/// [`LinalgError::NotStable`] when the spectral radius of `A` is not below one.
pub fn discrete_lyapunov(a: &DMatrix<f64>, q: &DMatrix<f64>) -> Result<DMatrix<f64>, LinalgError> {
    let radius = spectral_radius(a)?;
    if radius >= 1.0 {
        return Err(LinalgError::NotStable {
            spectral_radius: radius,
        });
    }
    let mut power = a.clone();
    let mut sum = q.clone();
    // 2^60 terms are beyond any radius that differs from one in double precision.
    for _ in 0..60 {
        let step = &power * &sum * power.transpose();
        sum += &step;
        if step.amax() <= 1e-17 * sum.amax() {
            break;
        }
        power = &power * &power;
    }
    Ok((&sum + sum.transpose()) * 0.5)
}

/// The gain `K'` that replaces `K` when `A - K C` has eigenvalues outside the unit circle: the
/// stabilising solution of the Riccati equation of the same innovation process, which mirrors those
/// eigenvalues and leaves the spectrum of the output (up to its scale) as it is.
///
/// With `F = A - K C` the equation has no constant term: the range of its solution is invariant under `F`, so
/// it reduces to a Lyapunov equation on the unstable invariant subspace of `F` (spectral factorisation; Anderson & Moore, *Optimal
/// Filtering*, section 9.3). Returns the gain and the new innovation covariance.
///
/// # Errors
/// [`LinalgError::Singular`] when an eigenvalue lies on the unit circle to working precision.
pub(crate) fn stabilising_observer_gain(
    a: &DMatrix<f64>,
    c: &DMatrix<f64>,
    k: &DMatrix<f64>,
    innovation_covariance: &DMatrix<f64>,
) -> Result<(DMatrix<f64>, DMatrix<f64>), LinalgError> {
    let what = "observer gain";
    let f = a - k * c;
    let n = f.nrows();
    let decomposition = eigen(&f)?;
    let mut basis: Vec<nalgebra::DVector<f64>> = Vec::new();
    for (j, value) in decomposition.values.iter().enumerate() {
        if value.norm() > 1.0 && value.im >= 0.0 {
            let v = decomposition.right.column(j);
            basis.push(v.map(|x| x.re));
            if value.im > 0.0 {
                basis.push(v.map(|x| x.im));
            }
        }
    }
    if basis.is_empty() {
        return Ok((k.clone(), innovation_covariance.clone()));
    }
    let (v, _) = qr_thin(&DMatrix::from_columns(&basis));
    let f_unstable = v.transpose() * &f * &v;
    let inverse = f_unstable
        .try_inverse()
        .ok_or(LinalgError::Singular { what })?;
    let c_unstable = c * &v;
    let weight = innovation_covariance
        .clone()
        .try_inverse()
        .ok_or(LinalgError::Singular { what })?;
    let constant = inverse.transpose() * c_unstable.transpose() * weight * &c_unstable * &inverse;
    let information = discrete_lyapunov(&inverse.transpose(), &constant)?;
    let p = information
        .try_inverse()
        .ok_or(LinalgError::Singular { what })?;
    let covariance = &v * p * v.transpose();
    let innovation = c * &covariance * c.transpose() + innovation_covariance;
    let cross = a * &covariance * c.transpose() + k * innovation_covariance;
    let inverse_innovation = innovation
        .clone()
        .try_inverse()
        .ok_or(LinalgError::Singular { what })?;
    let gain = cross * inverse_innovation;
    if gain.shape() != (n, c.nrows()) || gain.iter().any(|x| !x.is_finite()) {
        return Err(LinalgError::Singular { what });
    }
    Ok((gain, innovation))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::eigenvalues;

    #[test]
    fn lyapunov_residual_vanishes() {
        let a = DMatrix::from_row_slice(2, 2, &[0.99, 0.2, -0.1, 0.7]);
        let q = DMatrix::from_row_slice(2, 2, &[1.0, 0.3, 0.3, 2.0]);
        let p = discrete_lyapunov(&a, &q).unwrap();
        let residual = &a * &p * a.transpose() + &q - &p;
        assert!(residual.amax() < 1e-12 * p.amax());
        assert!(discrete_lyapunov(&(a * 1.2), &q).is_err());
    }

    #[test]
    fn gain_keeps_the_spectrum_at_any_order() {
        let a = DMatrix::from_row_slice(3, 3, &[0.9, 0.3, 0.0, -0.2, 0.7, 0.4, 0.1, 0.0, 0.5]);
        let c = DMatrix::from_row_slice(2, 3, &[1.0, 0.0, 0.5, 0.0, 1.0, -0.3]);
        let k = DMatrix::from_row_slice(3, 2, &[2.5, 0.4, -0.3, -1.2, 0.8, 0.6]);
        let lambda = DMatrix::from_row_slice(2, 2, &[1.0, 0.2, 0.2, 0.5]);
        assert!(spectral_radius(&(&a - &k * &c)).unwrap() > 1.0);
        let (gain, innovation) = stabilising_observer_gain(&a, &c, &k, &lambda).unwrap();
        assert!(spectral_radius(&(&a - &gain * &c)).unwrap() < 1.0);
        // H Lambda H* is the same on the unit circle.
        let spectrum = |k: &DMatrix<f64>, lambda: &DMatrix<f64>, w: f64| {
            let complex = |m: &DMatrix<f64>| m.map(|v| num_complex::Complex64::new(v, 0.0));
            let z = num_complex::Complex64::from_polar(1.0, w);
            let resolvent = (DMatrix::identity(3, 3) * z - complex(&a))
                .try_inverse()
                .unwrap();
            let h = complex(&c) * resolvent * complex(k) + DMatrix::identity(2, 2);
            &h * complex(lambda) * h.adjoint()
        };
        for w in [0.0, 0.3, 1.0, 2.0, 3.1] {
            let (old, new) = (spectrum(&k, &lambda, w), spectrum(&gain, &innovation, w));
            assert!((&old - &new).norm() < 1e-10 * old.norm(), "w = {w}");
        }
    }

    #[test]
    fn gain_mirrors_unstable_predictor_and_keeps_the_spectrum() {
        // y = (1 + 2 q^-1) / (1 - 0.5 q^-1) e: the zero at -2 moves to -0.5, the variance grows by 4.
        let a = DMatrix::from_element(1, 1, 0.5);
        let c = DMatrix::from_element(1, 1, 1.0);
        let k = DMatrix::from_element(1, 1, 2.5);
        let lambda = DMatrix::from_element(1, 1, 1.0);
        let (gain, innovation) = stabilising_observer_gain(&a, &c, &k, &lambda).unwrap();
        approx::assert_relative_eq!(gain[(0, 0)], 1.0, epsilon = 1e-12);
        approx::assert_relative_eq!(innovation[(0, 0)], 4.0, epsilon = 1e-12);
        let closed = &a - &gain * &c;
        assert!((eigenvalues(&closed).unwrap()[0].re + 0.5).abs() < 1e-12);
    }
}
