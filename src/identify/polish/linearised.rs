//! The linearised problem: steps and covariance in the singular directions of the Jacobian, confined to the
//! boundary of the stability radius where it is active.

use nalgebra::{DMatrix, DVector};

use crate::covariance::ParameterLayout;
use crate::linalg::{LinalgError, eigen, multiply_nt, multiply_tn, qr_r, qr_thin, svd_thin};
use crate::model::StateSpace;

/// Singular values of the Jacobian below this share of the largest are not determined by the data.
const DETERMINED: f64 = 1e-13;

/// The linearised problem in the singular directions of its Jacobian: minimum-norm Gauss-Newton and damped
/// steps, and the pseudo-inverse of the information, all of the rank that the input-output behaviour
/// determines.
pub(super) struct Linearised {
    /// Right singular vectors, one column a direction.
    directions: DMatrix<f64>,
    /// Singular values.
    values: Vec<f64>,
    /// Residual along the left singular vectors.
    projected: Vec<f64>,
}

impl Linearised {
    fn new(jacobian: &DMatrix<f64>, residual: &[f64], rank: usize) -> Result<Self, LinalgError> {
        // The triangular factor with the residual as a last column holds Q' r as well: Q is never formed.
        let parameters = jacobian.ncols();
        let mut augmented = jacobian.clone().insert_column(parameters, 0.0);
        augmented.column_mut(parameters).copy_from_slice(residual);
        let r = qr_r(&augmented);
        let rows = r.nrows().min(parameters);
        let svd = svd_thin(&r.view((0, 0), (rows, parameters)).into_owned())?;
        let rank = rank.min(svd.values.len());
        let rotated = r.view((0, parameters), (rows, 1)).into_owned();
        let projected = multiply_tn(&svd.u, &rotated);
        Ok(Self {
            directions: svd.v.columns(0, rank).into_owned(),
            values: svd.values.iter().take(rank).copied().collect(),
            projected: projected.iter().take(rank).copied().collect(),
        })
    }

    fn largest(&self) -> f64 {
        self.values.first().copied().unwrap_or(0.0)
    }

    /// Decrease of the cost that a full step promises.
    pub(super) fn decrease(&self) -> f64 {
        let determined = DETERMINED * self.largest();
        self.values
            .iter()
            .zip(&self.projected)
            .filter(|(value, _)| **value > determined)
            .map(|(_, p)| p * p)
            .sum()
    }

    /// Step with Levenberg-Marquardt damping `damping` (relative to the largest singular value; zero is
    /// Gauss-Newton).
    pub(super) fn step(&self, damping: f64) -> DVector<f64> {
        let largest = self.largest();
        let coefficients = DVector::from_iterator(
            self.values.len(),
            self.values.iter().zip(&self.projected).map(|(&value, &p)| {
                if value > DETERMINED * largest {
                    p * value / (value * value + (damping * largest).powi(2))
                } else {
                    0.0
                }
            }),
        );
        &self.directions * coefficients
    }

    /// Pseudo-inverse of the information.
    pub(super) fn covariance(&self) -> DMatrix<f64> {
        let mut scaled = self.directions.clone();
        for (i, &value) in self.values.iter().enumerate() {
            let inverse = if value > DETERMINED * self.largest() {
                1.0 / value
            } else {
                0.0
            };
            scaled.column_mut(i).scale_mut(inverse);
        }
        multiply_nt(&scaled, &scaled)
    }
}

/// Derivative of the modulus of each eigenvalue of `A` that sits on the circle of `radius`, with respect to
/// the parameters: `d|lambda| = Re(conj(lambda) / |lambda| w dA v)`. One row an eigenvalue, of a complex pair
/// only one.
pub(super) fn boundary_gradient(
    system: &StateSpace,
    layout: &ParameterLayout,
    radius: f64,
) -> Result<DMatrix<f64>, LinalgError> {
    let decomposition = eigen(&system.a)?;
    let n = system.states();
    let on_boundary: Vec<usize> = (0..n)
        .filter(|&i| {
            let value = decomposition.values[i];
            value.im >= 0.0 && value.norm() > radius * (1.0 - 1e-9)
        })
        .collect();
    Ok(DMatrix::from_fn(
        on_boundary.len(),
        layout.len(),
        |row, p| {
            if p >= n * n {
                return 0.0;
            }
            let i = on_boundary[row];
            let value = decomposition.values[i];
            let change = decomposition.left[(i, p % n)] * decomposition.right[(p / n, i)];
            (value.conj() / value.norm() * change).re
        },
    ))
}

/// The linearised problem, confined to the boundary of the stability radius where a free step would leave
/// it (an active set: an eigenvalue that the step would take inward is let go).
pub(super) fn linearise(
    jacobian: DMatrix<f64>,
    residual: &[f64],
    rank: usize,
    boundary: &DMatrix<f64>,
) -> Result<Linearised, LinalgError> {
    let free = Linearised::new(&jacobian, residual, rank)?;
    let outward = boundary * free.step(0.0);
    let active: Vec<usize> = (0..boundary.nrows())
        .filter(|&i| outward[i] > 0.0)
        .collect();
    if active.is_empty() {
        return Ok(free);
    }
    let (normal, _) = qr_thin(&boundary.select_rows(&active).transpose());
    let confined = &jacobian - (&jacobian * &normal) * normal.transpose();
    Linearised::new(&confined, residual, rank - active.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Parameters in units a trillion times as large move a trillionth as far, and gain the same.
    #[test]
    fn steps_know_no_units() {
        let jacobian = DMatrix::from_fn(9, 3, |i, j| ((i * 3 + j * j + i * j) as f64).sin());
        let residual: Vec<f64> = (0..9).map(|i| f64::from(i).cos()).collect();
        let free = DMatrix::zeros(0, 3);
        let at = |unit: f64| linearise(&jacobian * unit, &residual, 3, &free).unwrap();
        let (one, small) = (at(1.0), at(1e-14));
        assert!((small.decrease() / one.decrease() - 1.0).abs() < 1e-9);
        for damping in [0.0, 0.1, 3.0] {
            let (a, b) = (one.step(damping), small.step(damping) * 1e-14);
            assert!((&a - &b).norm() < 1e-9 * a.norm(), "{damping}: {a} {b}");
        }
    }

    /// The minimum of `|J d - r|^2 + (damping s_1)^2 |d|^2`, by its normal equations.
    #[test]
    fn steps_are_damped_least_squares() {
        let jacobian = DMatrix::from_fn(9, 3, |i, j| ((i * 3 + j * j + i * j) as f64).sin());
        let residual: Vec<f64> = (0..9).map(|i| f64::from(i).cos()).collect();
        let found = linearise(jacobian.clone(), &residual, 3, &DMatrix::zeros(0, 3)).unwrap();
        let gram = jacobian.tr_mul(&jacobian);
        let right = jacobian.tr_mul(&DVector::from_column_slice(&residual));
        let largest = gram.symmetric_eigenvalues().max();
        for damping in [0.0, 0.1, 3.0] {
            let damped = &gram + DMatrix::identity(3, 3) * (damping * damping * largest);
            let wanted = damped.cholesky().unwrap().solve(&right);
            let step = found.step(damping);
            assert!(
                (&step - &wanted).norm() < 1e-10 * wanted.norm(),
                "{damping}"
            );
        }
        let full = gram.clone().cholesky().unwrap();
        assert!((found.decrease() - right.dot(&full.solve(&right))).abs() < 1e-10);
        assert!((found.covariance() - full.inverse()).norm() < 1e-10);
    }

    #[test]
    fn moduli_on_the_boundary_change_as_by_differences() {
        // A pair at a modulus of 0.9, and a real eigenvalue further inside; in no special basis.
        let (re, im) = (0.9 * 0.7_f64.cos(), 0.9 * 0.7_f64.sin());
        let inner = DMatrix::from_row_slice(3, 3, &[re, im, 0.0, -im, re, 0.0, 0.0, 0.0, 0.85]);
        let basis = DMatrix::from_row_slice(3, 3, &[1.0, 0.4, -0.2, 0.3, 1.5, 0.6, -0.7, 0.1, 0.8]);
        let a = basis.clone().try_inverse().unwrap() * inner * basis;
        let system = |a: DMatrix<f64>| StateSpace {
            a,
            b: DMatrix::from_element(3, 1, 1.0),
            c: DMatrix::from_element(1, 3, 1.0),
            d: DMatrix::zeros(1, 1),
            k: DMatrix::zeros(3, 1),
            sample_time: 1.0,
        };
        let whole = system(a.clone());
        let layout = ParameterLayout::of(&whole, false);
        let gradient = boundary_gradient(&whole, &layout, 0.9).unwrap();
        assert_eq!(gradient.shape(), (1, layout.len()));
        let modulus = |a: &DMatrix<f64>| {
            a.complex_eigenvalues()
                .iter()
                .map(|v| v.norm())
                .fold(0.0, f64::max)
        };
        for p in 0..9 {
            let h = 1e-6;
            let moved = |by: f64| {
                let mut moved = a.clone();
                moved[p] += by;
                modulus(&moved)
            };
            let difference = (moved(h) - moved(-h)) / (2.0 * h);
            assert!((gradient[(0, p)] - difference).abs() < 1e-7, "{p}");
        }
        assert!(
            gradient
                .columns(9, layout.len() - 9)
                .iter()
                .all(|v| *v == 0.0)
        );
        // Both are beyond a smaller radius, none beyond a larger one.
        let rows = |radius: f64| boundary_gradient(&whole, &layout, radius).unwrap().nrows();
        assert_eq!((rows(0.85), rows(0.91)), (2, 0));
    }
}
