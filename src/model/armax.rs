//! The polynomials of a single-input single-output model.

use num_complex::Complex64;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::ModelError;
use super::state_space::StateSpace;
use crate::linalg::eigenvalues;

/// `a(q) y = b(q) u + c(q) e`, polynomials in the delay `q^-1`, coefficients from lag 0 on, each of
/// length `n + 1`: `a = [1, a1, ..., an]`, `b = [D, b1, ..., bn]`, `c = [1, c1, ..., cn]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Armax {
    /// Denominator, monic: characteristic polynomial of `A`.
    pub a: Vec<f64>,
    /// Numerator from the input.
    pub b: Vec<f64>,
    /// Numerator from the innovation, monic: characteristic polynomial of `A - K C`.
    pub c: Vec<f64>,
}

impl StateSpace {
    /// ARMAX polynomials of a model with one input and one output, `None` for any other.
    ///
    /// `a` is the characteristic polynomial of `A`. By the matrix determinant lemma
    /// `det(zI - A + K C) = det(zI - A) (1 + C (zI - A)^-1 K)`, so `c` is that of `A - K C`. Likewise
    /// `b = charpoly(A - B C) + (D - 1) a`, which is computed as the first `n + 1` coefficients of `a`
    /// times the impulse response: this has no cancellation when `B C` is small against `A`, and the
    /// coefficients beyond vanish by Cayley-Hamilton.
    ///
    /// # Errors
    /// [`ModelError::Linalg`] when the eigenvalues cannot be computed.
    pub fn armax(&self) -> Result<Option<Armax>, ModelError> {
        if (self.inputs(), self.outputs()) != (1, 1) {
            return Ok(None);
        }
        let a = monic_polynomial(&eigenvalues(&self.a)?);
        let c = monic_polynomial(&eigenvalues(&self.predictor_matrix())?);
        let impulse = self.impulse_response(a.len());
        let b = (0..a.len())
            .map(|k| (0..=k).map(|i| a[i] * impulse[k - i][(0, 0)]).sum())
            .collect();
        Ok(Some(Armax { a, b, c }))
    }
}

/// Coefficients, highest power first, of the monic polynomial with these roots (closed under
/// conjugation).
fn monic_polynomial(roots: &[Complex64]) -> Vec<f64> {
    let mut coefficients = vec![Complex64::new(1.0, 0.0)];
    for root in roots {
        coefficients.push(Complex64::default());
        for i in (1..coefficients.len()).rev() {
            let before = coefficients[i - 1];
            coefficients[i] -= root * before;
        }
    }
    coefficients.iter().map(|c| c.re).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, dmatrix};

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
}
