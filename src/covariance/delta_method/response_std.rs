//! Standard deviations of the responses in time and of the static gain.

use nalgebra::{DMatrix, DVector};

use super::gradient::Differential;
use crate::covariance::{CovarianceError, ParameterCovariance};
use crate::linalg::multiply;
use crate::model::StateSpace;

/// Standard deviations of the impulse response at samples `0 .. samples`, each `l x r`. First order
/// (`pbsid-opt.md` section 2):
/// `dh[k] = dC A^(k-1) B + C A^(k-1) dB + sum_i C A^i dA A^(k-2-i) B`, `dh[0] = dD`.
///
/// # Errors
/// [`CovarianceError::Layout`] or [`CovarianceError::Size`] for the covariance of another model.
pub fn impulse_response_std(
    system: &StateSpace,
    covariance: &ParameterCovariance,
    samples: usize,
) -> Result<Vec<DMatrix<f64>>, CovarianceError> {
    let all: Vec<usize> = (0..samples).collect();
    response_std(system, covariance, &all, |k| if k == 0 { 1.0 } else { 0.0 })
}

/// Standard deviations of the step response at samples `0 .. samples`, each `l x r`; first order.
///
/// # Errors
/// [`CovarianceError::Layout`] or [`CovarianceError::Size`] for the covariance of another model.
pub fn step_response_std(
    system: &StateSpace,
    covariance: &ParameterCovariance,
    samples: usize,
) -> Result<Vec<DMatrix<f64>>, CovarianceError> {
    let all: Vec<usize> = (0..samples).collect();
    step_response_std_at(system, covariance, &all)
}

/// As [`step_response_std`], at these samples only (increasing).
pub(crate) fn step_response_std_at(
    system: &StateSpace,
    covariance: &ParameterCovariance,
    at: &[usize],
) -> Result<Vec<DMatrix<f64>>, CovarianceError> {
    response_std(system, covariance, at, |_| 1.0)
}

/// Response to the same input signal in each channel by turns, with its sensitivity carried along:
/// `dx[k+1] = A dx[k] + dA x[k] + dB u[k]`, `dy[k] = C dx[k] + dC x[k] + dD u[k]`.
fn response_std(
    system: &StateSpace,
    covariance: &ParameterCovariance,
    at: &[usize],
    signal: impl Fn(usize) -> f64,
) -> Result<Vec<DMatrix<f64>>, CovarianceError> {
    covariance.check(system)?;
    let layout = &covariance.layout;
    let (n, r, l) = (system.states(), system.inputs(), system.outputs());
    let mut stds = vec![DMatrix::zeros(l, r); at.len()];
    let Some(&last) = at.last() else {
        return Ok(stds);
    };
    for input in 0..r {
        let mut x = DVector::zeros(n);
        // Columns: vec A, then this column of B.
        let mut sensitivity = DMatrix::zeros(n, n * n + n);
        let mut gradients = Vec::with_capacity(at.len() * l);
        let mut next = 0;
        for k in 0..=last {
            let u = signal(k);
            if at[next] == k {
                let through = &system.c * &sensitivity;
                for output in 0..l {
                    let mut gradient = vec![0.0; layout.len()];
                    for j in 0..n * n {
                        gradient[j] = through[(output, j)];
                    }
                    for j in 0..n {
                        gradient[layout.b() + input * n + j] = through[(output, n * n + j)];
                        gradient[layout.c() + j * l + output] = x[j];
                    }
                    if layout.feedthrough {
                        gradient[layout.d() + input * l + output] = u;
                    }
                    gradients.push(gradient);
                }
                next += 1;
            }
            if n == 0 {
                continue;
            }
            sensitivity = multiply(&system.a, &sensitivity);
            for i in 0..n {
                for j in 0..n {
                    sensitivity[(i, j * n + i)] += x[j];
                }
                sensitivity[(i, n * n + i)] += u;
            }
            x = &system.a * &x + system.b.column(input) * u;
        }
        let variances = covariance.variances(&gradients);
        for (std, variances) in stds.iter_mut().zip(variances.chunks(l)) {
            for (output, variance) in variances.iter().enumerate() {
                std[(output, input)] = variance.sqrt();
            }
        }
    }
    Ok(stds)
}

/// Standard deviation of the static gain `C (I - A)^-1 B + D` (`l x r`), first order; `None` with an
/// integrator.
///
/// # Errors
/// [`CovarianceError::Layout`] or [`CovarianceError::Size`] for the covariance of another model.
pub fn static_gain_std(
    system: &StateSpace,
    covariance: &ParameterCovariance,
) -> Result<Option<DMatrix<f64>>, CovarianceError> {
    covariance.check(system)?;
    if system.static_gain().is_none() {
        return Ok(None);
    }
    let (n, r, l) = (system.states(), system.inputs(), system.outputs());
    let (left, right) = if n == 0 {
        (DMatrix::zeros(l, 0), DMatrix::zeros(0, r))
    } else {
        let Some(inverse) = (DMatrix::identity(n, n) - &system.a).try_inverse() else {
            return Ok(None);
        };
        (&system.c * &inverse, inverse * &system.b)
    };
    let unit = |length: usize, at: usize| (0..length).map(|i| f64::from(i == at)).collect();
    let mut gradients = Vec::with_capacity(l * r);
    for input in 0..r {
        for output in 0..l {
            let differential: Differential<f64> = Differential {
                alpha: left.row(output).iter().copied().collect(),
                rho: right.column(input).iter().copied().collect(),
                beta: unit(r, input),
                kappa: Vec::new(),
                gamma: unit(l, output),
            };
            gradients.push(differential.gradient(&covariance.layout));
        }
    }
    let variances = covariance.variances(&gradients);
    Ok(Some(DMatrix::from_vec(l, r, variances).map(f64::sqrt)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::covariance::test_covariances::{self, assert_close};

    fn numeric_std(
        system: &StateSpace,
        covariance: &ParameterCovariance,
        f: impl Fn(&StateSpace) -> DMatrix<f64>,
    ) -> Vec<f64> {
        let numeric =
            test_covariances::numeric_covariance(system, covariance, |s| f(s).as_slice().to_vec());
        numeric
            .diagonal()
            .iter()
            .map(|v| v.max(0.0).sqrt())
            .collect()
    }

    #[test]
    fn equals_central_differences() {
        for feedthrough in [false, true] {
            let (system, covariance) = test_covariances::two_by_three(feedthrough);
            let step = step_response_std(&system, &covariance, 12).unwrap();
            let impulse = impulse_response_std(&system, &covariance, 12).unwrap();
            for k in [0, 1, 2, 5, 11] {
                let expected =
                    numeric_std(&system, &covariance, |s| s.step_response(12)[k].clone());
                assert_close(step[k].as_slice(), &expected, 1e-6);
                let expected =
                    numeric_std(&system, &covariance, |s| s.impulse_response(12)[k].clone());
                assert_close(impulse[k].as_slice(), &expected, 1e-6);
            }
            let gain = static_gain_std(&system, &covariance).unwrap().unwrap();
            let expected = numeric_std(&system, &covariance, |s| s.static_gain().unwrap());
            assert_close(gain.as_slice(), &expected, 1e-6);
        }
    }

    #[test]
    fn does_not_depend_on_the_state_basis_and_settles_at_the_static_gain() {
        let (system, covariance) = test_covariances::two_by_three(true);
        let (other, moved) = test_covariances::in_another_basis(&system, &covariance);
        let a = step_response_std_at(&system, &covariance, &[3, 200]).unwrap();
        let b = step_response_std_at(&other, &moved, &[3, 200]).unwrap();
        let gain = static_gain_std(&system, &covariance).unwrap().unwrap();
        assert_close(a[0].as_slice(), b[0].as_slice(), 1e-9);
        assert_close(a[1].as_slice(), gain.as_slice(), 1e-9);
    }

    #[test]
    fn an_integrator_has_no_static_gain() {
        let (mut system, covariance) = test_covariances::oscillator();
        system.a = nalgebra::dmatrix![1.0, 0.0; 0.2, 0.5];
        assert_eq!(static_gain_std(&system, &covariance).unwrap(), None);
        assert!(
            step_response_std(&system, &covariance, 0)
                .unwrap()
                .is_empty()
        );
    }
}
