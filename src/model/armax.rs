//! The polynomials of a single-input single-output model.

use nalgebra::DMatrix;
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
mod tests {
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
}
