//! Covariance of the frequency responses.

use nalgebra::DMatrix;
use num_complex::Complex64;

use super::gradient::{Covariance2, Differential};
use crate::covariance::{CovarianceError, ParameterCovariance};
use crate::model::{StateSpace, resolvent_products};

/// From where a response goes to the outputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Path {
    /// From the inputs: `G = C (zI - A)^-1 B + D`.
    Input,
    /// From the innovations: `H = C (zI - A)^-1 K + I`.
    Innovation,
}

impl Path {
    /// The response along this path at a frequency in rad/s.
    pub fn response(self, system: &StateSpace, w_rad_s: f64) -> DMatrix<Complex64> {
        match self {
            Self::Input => system.frequency_response(w_rad_s),
            Self::Innovation => system.noise_response(w_rad_s),
        }
    }
}

/// Covariance of (Re, Im) of every entry of `G(exp(j w Ts))` (`l x r`); `w` in rad/s. First order, with
/// `R = (zI - A)^-1`:
///
/// `dG = C R dA R B + C R dB + dC R B + dD` (`pbsid-opt.md` section 2; Chiuso & Picci section 5).
///
/// Entries are NaN where `z` is a pole exactly.
///
/// # Errors
/// [`CovarianceError::Layout`] or [`CovarianceError::Size`] for the covariance of another model.
pub fn frequency_response_covariance(
    system: &StateSpace,
    covariance: &ParameterCovariance,
    w_rad_s: f64,
) -> Result<DMatrix<Covariance2>, CovarianceError> {
    path_covariance(system, covariance, w_rad_s, Path::Input)
}

/// Covariance of (Re, Im) of every entry of `H(exp(j w Ts))` (`l x l`); `w` in rad/s. First order:
///
/// `dH = C R dA R K + C R dK + dC R K`.
///
/// # Errors
/// As [`frequency_response_covariance`].
pub fn noise_response_covariance(
    system: &StateSpace,
    covariance: &ParameterCovariance,
    w_rad_s: f64,
) -> Result<DMatrix<Covariance2>, CovarianceError> {
    path_covariance(system, covariance, w_rad_s, Path::Innovation)
}

/// The two functions above, by path.
pub(crate) fn path_covariance(
    system: &StateSpace,
    covariance: &ParameterCovariance,
    w_rad_s: f64,
    path: Path,
) -> Result<DMatrix<Covariance2>, CovarianceError> {
    covariance.check(system)?;
    let source = match path {
        Path::Input => &system.b,
        Path::Innovation => &system.k,
    };
    let (l, m) = (system.outputs(), source.ncols());
    let products = resolvent_products(system, source, system.unit_circle(w_rad_s));
    let unit = |length: usize, at: usize| {
        let mut vector = vec![Complex64::default(); length];
        vector[at] = Complex64::new(1.0, 0.0);
        vector
    };
    let mut gradients = Vec::with_capacity(l * m);
    for input in 0..m {
        for output in 0..l {
            let mut differential = Differential {
                alpha: products.left.row(output).iter().copied().collect(),
                rho: products.right.column(input).iter().copied().collect(),
                gamma: unit(l, output),
                ..Differential::default()
            };
            match path {
                Path::Input => differential.beta = unit(m, input),
                Path::Innovation => differential.kappa = unit(m, input),
            }
            gradients.push(differential.gradient(&covariance.layout));
        }
    }
    Ok(DMatrix::from_vec(
        l,
        m,
        covariance.complex_covariances(&gradients),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::covariance::test_covariances::{self, assert_close};

    fn flat(c: &Covariance2) -> [f64; 4] {
        [c[0][0], c[0][1], c[1][0], c[1][1]]
    }

    #[test]
    fn equals_central_differences() {
        for feedthrough in [false, true] {
            let (system, covariance) = test_covariances::two_by_three(feedthrough);
            for path in [Path::Input, Path::Innovation] {
                let analytic = path_covariance(&system, &covariance, 1.3, path).unwrap();
                for o in 0..analytic.nrows() {
                    for i in 0..analytic.ncols() {
                        let numeric =
                            test_covariances::numeric_covariance(&system, &covariance, |s| {
                                let g = path.response(s, 1.3)[(o, i)];
                                vec![g.re, g.im]
                            });
                        assert_close(&flat(&analytic[(o, i)]), numeric.as_slice(), 1e-7);
                    }
                }
            }
        }
    }

    #[test]
    fn does_not_depend_on_the_state_basis() {
        let (system, covariance) = test_covariances::two_by_three(true);
        let (other, moved) = test_covariances::in_another_basis(&system, &covariance);
        for path in [Path::Input, Path::Innovation] {
            let a = path_covariance(&system, &covariance, 0.4, path).unwrap();
            let b = path_covariance(&other, &moved, 0.4, path).unwrap();
            for (x, y) in a.iter().zip(b.iter()) {
                assert_close(&flat(x), &flat(y), 1e-10);
            }
        }
    }

    #[test]
    fn a_static_model_has_the_covariance_of_its_feedthrough() {
        let (system, covariance) = test_covariances::static_gain(0.25);
        let c = frequency_response_covariance(&system, &covariance, 1.0).unwrap();
        assert_eq!(c[(0, 0)], [[0.25, 0.0], [0.0, 0.0]]);
    }
}
