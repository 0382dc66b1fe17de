//! A subspace method after Ljung's book.

use nalgebra::DMatrix;

use super::super::knudsen::{Observability, Regression, inputs};
use super::super::pem::Signals;
use super::{BaselineEstimate, ProjectionWeight, noise_model, weighted_observability};
use crate::identify::IdentifyError;
use crate::linalg::{
    least_squares, multiply, multiply_nt, pseudo_inverse, qr_r, solve_upper, spectral_radius,
};
use crate::model::StateSpace;

/// Relative size below which the observability matrix counts as rank deficient.
const DEPENDENT: f64 = 1e-12;
/// Rows that are compressed at a time.
const BLOCK: usize = 4096;

/// Ljung, *System Identification* (1999), section 10.6: `C` and `A` from the observability matrix and its shift; `B`
/// and `D` (and the initial state) by least squares of the simulated outputs, linear once `A` and `C` are known; `K`
/// from the covariance of the residuals of the estimated states, by the Riccati equation.
///
/// `experiments` are the signals behind the regression, in its units. With an unstable `A` there is no simulation to
/// fit: `B` and `D` come from the Toeplitz matrix of the regression then.
///
/// # Errors
/// [`IdentifyError::Order`], or [`IdentifyError::Linalg`] for singular regressions.
pub(crate) fn n4sid(
    regression: &Regression,
    experiments: &[&Signals],
    order: usize,
    weight: ProjectionWeight,
    feedthrough: bool,
    sample_time: f64,
) -> Result<BaselineEstimate, IdentifyError> {
    let outputs = regression.outputs;
    let (gamma, singular_values) = weighted_observability(regression, order, weight)?;
    let rows = gamma.nrows() - outputs;
    let c = gamma.rows(0, outputs).into_owned();
    let a = least_squares(
        &gamma.rows(0, rows).into_owned(),
        &gamma.rows(outputs, rows).into_owned(),
    )?;
    let (b, d) = if spectral_radius(&a)? < 1.0 {
        by_simulation(&a, &c, experiments, regression.inputs, feedthrough)?
    } else {
        let observability = Observability::of(&a, &c, regression.future)?;
        inputs(regression, &observability, &a, &c, feedthrough)?
    };
    let covariance = residual_covariance(regression, &gamma, [&a, &b, &c, &d])?;
    let (k, innovation_covariance) = noise_model(&a, &c, &covariance)?;
    Ok(BaselineEstimate {
        system: StateSpace {
            a,
            b,
            c,
            d,
            k,
            sample_time,
        },
        innovation_covariance,
        singular_values,
    })
}

/// Least squares of `y - C (qI - A)^-1 B u - D u`, with an initial state for each experiment.
fn by_simulation(
    a: &DMatrix<f64>,
    c: &DMatrix<f64>,
    experiments: &[&Signals],
    inputs: usize,
    feedthrough: bool,
) -> Result<(DMatrix<f64>, DMatrix<f64>), IdentifyError> {
    let (outputs, n) = c.shape();
    let direct = if feedthrough { inputs * outputs } else { 0 };
    let unknown = n * inputs + direct;
    // Columns: initial state, B, D, output. The initial state is regressed out of each experiment.
    let total = n + unknown + 1;
    let mut all = DMatrix::zeros(0, total - n);
    for signals in experiments {
        let samples = signals.first().map_or(0, Vec::len);
        // Column j: the state that unknown j makes.
        let mut states = DMatrix::<f64>::zeros(n, n + n * inputs);
        states.columns_mut(0, n).fill_with_identity();
        let mut compressed = DMatrix::zeros(0, total);
        let mut first = 0;
        while first < samples {
            let count = (BLOCK / outputs).max(1).min(samples - first);
            let head = compressed.nrows();
            let mut block = compressed.resize_vertically(head + count * outputs, 0.0);
            for k in 0..count {
                let row = head + k * outputs;
                block
                    .view_mut((row, 0), (outputs, n + n * inputs))
                    .copy_from(&(c * &states));
                for o in 0..outputs {
                    if feedthrough {
                        for j in 0..inputs {
                            block[(row + o, n + n * inputs + o + outputs * j)] =
                                signals[j][first + k];
                        }
                    }
                    block[(row + o, total - 1)] = signals[inputs + o][first + k];
                }
                states = a * &states;
                for j in 0..inputs {
                    for i in 0..n {
                        states[(i, n + i + n * j)] += signals[j][first + k];
                    }
                }
            }
            compressed = qr_r(&block);
            first += count;
        }
        let below = compressed.nrows().saturating_sub(n);
        let head = all.nrows();
        all = all.resize_vertically(head + below, 0.0);
        all.rows_mut(head, below)
            .copy_from(&compressed.view((compressed.nrows() - below, n), (below, total - n)));
    }
    let triangular = qr_r(&all);
    if triangular.nrows() < unknown
        || (0..unknown).any(|i| triangular[(i, i)].abs() <= DEPENDENT * triangular.amax())
    {
        return Err(IdentifyError::SingularRegression {
            what: "the simulated responses",
        });
    }
    let square = triangular.view((0, 0), (unknown, unknown)).into_owned();
    let right = triangular.view((0, unknown), (unknown, 1)).into_owned();
    let solution = solve_upper(&square, &right);
    let b = DMatrix::from_column_slice(n, inputs, &solution.as_slice()[..n * inputs]);
    let d = if feedthrough {
        DMatrix::from_column_slice(outputs, inputs, &solution.as_slice()[n * inputs..])
    } else {
        DMatrix::zeros(outputs, inputs)
    };
    Ok((b, d))
}

/// Covariance of `[x+ - A x - B u; y - C x - D u]` with the states `Gamma^+ Theta_p W_p` of two windows one sample
/// apart, all in the coordinates of the factor.
fn residual_covariance(
    regression: &Regression,
    gamma: &DMatrix<f64>,
    [a, b, c, d]: [&DMatrix<f64>; 4],
) -> Result<DMatrix<f64>, IdentifyError> {
    let Regression {
        inputs, outputs, ..
    } = *regression;
    let q = inputs + outputs;
    let n = a.nrows();
    let past_rows = regression.past_rows();
    let regressors = regression.regressors();
    let factor = &regression.factor;
    let states = multiply(
        &pseudo_inverse(gamma, DEPENDENT)?,
        &regression.past_coefficients(),
    );
    // The present sample: u_i is the first of the future inputs, y_i the first of the future outputs.
    let u = factor.columns(past_rows, inputs).into_owned();
    let y = factor.columns(regressors, outputs).into_owned();
    let past = factor.columns(0, past_rows).into_owned();
    let mut next_past = DMatrix::zeros(factor.nrows(), past_rows);
    next_past
        .columns_mut(0, past_rows - q)
        .copy_from(&past.columns(q, past_rows - q));
    next_past.columns_mut(past_rows - q, inputs).copy_from(&u);
    next_past
        .columns_mut(past_rows - outputs, outputs)
        .copy_from(&y);
    let now = multiply_nt(&past, &states);
    let next = multiply_nt(&next_past, &states);
    let mut residual = DMatrix::zeros(factor.nrows(), n + outputs);
    residual
        .columns_mut(0, n)
        .copy_from(&(next - &now * a.transpose() - &u * b.transpose()));
    residual
        .columns_mut(n, outputs)
        .copy_from(&(y - &now * c.transpose() - &u * d.transpose()));
    Ok(residual.transpose() * &residual / regression.columns as f64)
}

#[cfg(test)]
mod tests {
    use nalgebra::DVector;

    use super::*;
    use crate::systems;

    /// Two inputs, two outputs, two experiments with initial states of their own, longer than a block.
    #[test]
    fn responses_are_found_without_noise() {
        let mut truth = systems::two_by_two().system;
        for feedthrough in [false, true] {
            if feedthrough {
                truth.d = DMatrix::from_row_slice(2, 2, &[0.4, -0.2, 0.1, 0.9]);
            }
            let n = truth.states();
            let signals: Vec<Vec<Vec<f64>>> = [BLOCK + 37, 200]
                .into_iter()
                .enumerate()
                .map(|(e, samples)| {
                    let input = |j: usize| -> Vec<f64> {
                        (0..samples)
                            .map(|k| (0.1 * ((k * k + 7 * e + 1) * (j + 2)) as f64).sin())
                            .collect()
                    };
                    let u = [input(0), input(1)];
                    let x0 = DVector::from_fn(n, |i, _| 1.0 + i as f64 - 2.0 * e as f64);
                    let y = truth.simulate(&[&u[0], &u[1]], Some(&x0)).unwrap();
                    u.into_iter().chain(y).collect()
                })
                .collect();
            let experiments: Vec<&Signals> = signals.iter().map(Vec::as_slice).collect();
            let (b, d) = by_simulation(&truth.a, &truth.c, &experiments, 2, feedthrough).unwrap();
            assert!((b - &truth.b).amax() < 1e-8, "{feedthrough}");
            assert!((d - &truth.d).amax() < 1e-8, "{feedthrough}");
        }
    }
}
