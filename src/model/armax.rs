//! The polynomials of a single-input single-output model.

use nalgebra::DMatrix;
use num_complex::Complex64;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::model_error::ModelError;
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

impl Armax {
    /// The system in observer form: with coefficients `a_i`, `b_i`, `c_i` in the columns `a`, `b`, `c`,
    /// `A = [-a [I; 0]]`, `B = b - a b0`, `K = c - a`, `C = [1 0 .. 0]`, `D = b0` (Knudsen 2001, (41) read backwards).
    ///
    /// Coefficients that are missing at the end of a polynomial count as zero.
    pub fn state_space(&self, sample_time: f64) -> StateSpace {
        let longest = self.a.len().max(self.b.len()).max(self.c.len());
        let n = longest.max(1) - 1;
        let at = |polynomial: &[f64], i: usize| polynomial.get(i).copied().unwrap_or(0.0);
        let direct = at(&self.b, 0);
        StateSpace {
            a: DMatrix::from_fn(n, n, |i, j| {
                let shift = if j == i + 1 { 1.0 } else { 0.0 };
                if j == 0 {
                    shift - at(&self.a, i + 1)
                } else {
                    shift
                }
            }),
            b: DMatrix::from_fn(n, 1, |i, _| {
                at(&self.b, i + 1) - at(&self.a, i + 1) * direct
            }),
            c: DMatrix::from_fn(1, n, |_, j| if j == 0 { 1.0 } else { 0.0 }),
            d: DMatrix::from_element(1, 1, direct),
            k: DMatrix::from_fn(n, 1, |i, _| at(&self.c, i + 1) - at(&self.a, i + 1)),
            sample_time,
        }
    }
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
#[path = "tests/armax_tests.rs"]
mod tests;
