//! Gradients of invariants, and the covariances that follow from them.
//!
//! Every invariant that is reported has a differential of the form
//!
//! `df = alpha^T dA rho + alpha^T dB beta + alpha^T dK kappa + gamma^T dC rho + gamma^T dD beta`
//!
//! (`pbsid-opt.md` section 2): frequency responses, poles, zeros, the static gain. So its gradient in
//! `theta = [vec A; vec B; vec K; vec C; vec D]` is written once, here.

use std::ops::Mul;

use nalgebra::DMatrix;
use num_complex::Complex64;

use crate::covariance::{CovarianceError, ParameterCovariance, ParameterLayout};
use crate::linalg::{all_finite, multiply};
use crate::model::StateSpace;

/// The vectors of the differential above; an empty one stands for zero.
#[derive(Debug, Clone, Default)]
pub(crate) struct Differential<T> {
    /// `alpha` (`n`), left of `dA`, `dB`, `dK`.
    pub(crate) alpha: Vec<T>,
    /// `rho` (`n`), right of `dA`, `dC`.
    pub(crate) rho: Vec<T>,
    /// `beta` (`r`), right of `dB`, `dD`.
    pub(crate) beta: Vec<T>,
    /// `kappa` (`l`), right of `dK`.
    pub(crate) kappa: Vec<T>,
    /// `gamma` (`l`), left of `dC`, `dD`.
    pub(crate) gamma: Vec<T>,
}

impl<T: Copy + Default + Mul<Output = T>> Differential<T> {
    /// The gradient, one entry per parameter.
    pub(crate) fn gradient(&self, layout: &ParameterLayout) -> Vec<T> {
        let mut gradient = vec![T::default(); layout.len()];
        let mut outer = |from: usize, left: &[T], right: &[T]| {
            let rows = left.len();
            for (column, &r) in right.iter().enumerate() {
                for (row, &l) in left.iter().enumerate() {
                    gradient[from + column * rows + row] = l * r;
                }
            }
        };
        outer(0, &self.alpha, &self.rho);
        outer(layout.b(), &self.alpha, &self.beta);
        outer(layout.k(), &self.alpha, &self.kappa);
        outer(layout.c(), &self.gamma, &self.rho);
        if layout.feedthrough {
            outer(layout.d(), &self.gamma, &self.beta);
        }
        gradient
    }
}

/// Covariance of the real and the imaginary part of a complex quantity.
pub type Covariance2 = [[f64; 2]; 2];

impl ParameterCovariance {
    /// A covariance after a check of its size: `matrix` is square with a row per parameter of `layout`.
    ///
    /// # Errors
    /// [`CovarianceError::Size`] or [`CovarianceError::NotFinite`].
    pub fn new(
        layout: ParameterLayout,
        matrix: DMatrix<f64>,
        degrees_of_freedom: Option<f64>,
    ) -> Result<Self, CovarianceError> {
        let covariance = Self {
            layout,
            matrix,
            degrees_of_freedom,
        };
        covariance.check_matrix()?;
        Ok(covariance)
    }

    fn check_matrix(&self) -> Result<(), CovarianceError> {
        let parameters = self.layout.len();
        let (rows, columns) = self.matrix.shape();
        if (rows, columns) != (parameters, parameters) {
            return Err(CovarianceError::Size {
                rows,
                columns,
                parameters,
            });
        }
        if !all_finite(&self.matrix) {
            return Err(CovarianceError::NotFinite);
        }
        Ok(())
    }

    /// Checks that this is the covariance of a system of these sizes.
    ///
    /// # Errors
    /// [`CovarianceError::Layout`], [`CovarianceError::Size`] or [`CovarianceError::NotFinite`].
    pub fn check(&self, system: &StateSpace) -> Result<(), CovarianceError> {
        let layout = &self.layout;
        let model = (system.states(), system.inputs(), system.outputs());
        if (layout.states, layout.inputs, layout.outputs) != model {
            return Err(CovarianceError::Layout {
                states: layout.states,
                inputs: layout.inputs,
                outputs: layout.outputs,
                model_states: model.0,
                model_inputs: model.1,
                model_outputs: model.2,
            });
        }
        self.check_matrix()
    }

    /// Variances `g' Cov g` of real quantities with these gradients.
    pub(crate) fn variances(&self, gradients: &[Vec<f64>]) -> Vec<f64> {
        let g = rows(gradients, self.layout.len());
        let half = multiply(&g, &self.matrix);
        (0..g.nrows())
            .map(|i| half.row(i).dot(&g.row(i)).max(0.0))
            .collect()
    }

    /// Covariances of (Re, Im) of complex quantities with these gradients.
    pub(crate) fn complex_covariances(&self, gradients: &[Vec<Complex64>]) -> Vec<Covariance2> {
        let parts: Vec<Vec<f64>> = gradients
            .iter()
            .flat_map(|g| {
                [
                    g.iter().map(|v| v.re).collect(),
                    g.iter().map(|v| v.im).collect(),
                ]
            })
            .collect();
        let g = rows(&parts, self.layout.len());
        let half = multiply(&g, &self.matrix);
        (0..gradients.len())
            .map(|i| {
                let (re, im) = (2 * i, 2 * i + 1);
                let cross = (half.row(re).dot(&g.row(im)) + half.row(im).dot(&g.row(re))) / 2.0;
                [
                    [half.row(re).dot(&g.row(re)).max(0.0), cross],
                    [cross, half.row(im).dot(&g.row(im)).max(0.0)],
                ]
            })
            .collect()
    }
}

fn rows(gradients: &[Vec<f64>], columns: usize) -> DMatrix<f64> {
    DMatrix::from_fn(gradients.len(), columns, |i, j| gradients[i][j])
}

/// Variance of `a Re + b Im` for a quantity with this covariance.
pub(crate) fn projected_variance(covariance: &Covariance2, a: f64, b: f64) -> f64 {
    (a * a * covariance[0][0] + 2.0 * a * b * covariance[0][1] + b * b * covariance[1][1]).max(0.0)
}

/// Standard deviation along the longest axis of the ellipse.
pub(crate) fn longest_axis(covariance: &Covariance2) -> f64 {
    let mean = (covariance[0][0] + covariance[1][1]) / 2.0;
    let half = (covariance[0][0] - covariance[1][1]) / 2.0;
    (mean + half.hypot(covariance[0][1])).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::covariance::test_covariances;

    #[test]
    fn gradient_follows_the_layout() {
        let (system, covariance) = test_covariances::two_by_three(true);
        let layout = covariance.layout;
        let d = Differential {
            alpha: vec![1.0, -2.0, 0.5],
            rho: vec![0.3, 0.7, -1.0],
            beta: vec![2.0, -1.0],
            kappa: vec![0.1, 0.4, -0.6],
            gamma: vec![1.5, 0.2, -0.3],
        };
        let gradient = d.gradient(&layout);
        let value = |s: &StateSpace| {
            let v = |x: &[f64]| nalgebra::DVector::from_column_slice(x);
            (v(&d.alpha).transpose() * &s.a * v(&d.rho)
                + v(&d.alpha).transpose() * &s.b * v(&d.beta)
                + v(&d.alpha).transpose() * &s.k * v(&d.kappa)
                + v(&d.gamma).transpose() * &s.c * v(&d.rho)
                + v(&d.gamma).transpose() * &s.d * v(&d.beta))[(0, 0)]
        };
        let numeric = test_covariances::central_differences(&system, &layout, |s| vec![value(s)]);
        for (a, n) in gradient.iter().zip(&numeric[0]) {
            assert!((a - n).abs() < 1e-8);
        }
    }

    #[test]
    fn covariance_must_belong_to_the_model() {
        let (system, covariance) = test_covariances::two_by_three(false);
        assert!(covariance.check(&system).is_ok());
        let (other, _) = test_covariances::oscillator();
        let error = covariance.check(&other).unwrap_err();
        assert!(error.to_string().contains("3 states, 2 inputs, 3 outputs"));
        let made = ParameterCovariance::new(covariance.layout, DMatrix::zeros(2, 2), None);
        assert!(matches!(made, Err(CovarianceError::Size { rows: 2, .. })));
    }

    #[test]
    fn axes_of_an_ellipse() {
        let covariance = [[5.0, 2.0], [2.0, 2.0]];
        assert!((longest_axis(&covariance) - 6.0_f64.sqrt()).abs() < 1e-12);
        assert!((projected_variance(&covariance, 1.0, -1.0) - 3.0).abs() < 1e-12);
    }
}
