//! The robust combined subspace algorithm.

use nalgebra::DMatrix;

use super::super::knudsen::{Regression, extended_observability};
use super::{BaselineEstimate, ProjectionWeight, noise_model, weighted_observability};
use crate::identify::IdentifyError;
use crate::linalg::{least_squares, multiply, multiply_nt, pseudo_inverse};
use crate::model::StateSpace;

/// Relative size below which the observability matrix counts as rank deficient.
const DEPENDENT: f64 = 1e-12;

/// van Overschee & De Moor (1996), figure 4.8: states by projections onto two pasts one sample apart; `A` and `C`
/// from one regression with everything else free; `B` and `D` from a second one that knows how they enter; the noise
/// from the residuals of the first.
///
/// # Errors
/// [`IdentifyError::Horizon`] unless past and future window have the same length of at least two,
/// [`IdentifyError::Order`], or [`IdentifyError::Linalg`] for singular regressions.
pub(crate) fn subid(
    regression: &Regression,
    order: usize,
    weight: ProjectionWeight,
    feedthrough: bool,
    sample_time: f64,
) -> Result<BaselineEstimate, IdentifyError> {
    let Regression {
        past,
        future,
        inputs,
        outputs,
        ..
    } = *regression;
    if past != future || future < 2 {
        return Err(IdentifyError::Horizon {
            asked: format!("--past {past} --future {future}"),
            reason: "subid needs a future window as long as the past one, of at least 2".to_owned(),
        });
    }
    let (gamma, singular_values) = weighted_observability(regression, order, weight)?;
    let n = order;
    let rows = future * outputs;
    let factor = &regression.factor;
    let regressors = regression.regressors();
    let past_rows = regression.past_rows();
    // The factor has Z first, then y_i, then the other future outputs: its first coordinates are those of Z, and
    // with the next l those of the longer past [W_p^+; U_f^-] together with Z.
    let longer = regressors + outputs;
    let projected = factor.view((0, regressors), (regressors, rows)).transpose();
    let projected_next = factor
        .view((0, longer), (longer, rows - outputs))
        .transpose();
    let present = factor.view((0, regressors), (longer, outputs)).transpose();
    let future_inputs = factor
        .view((0, past_rows), (regressors, future * inputs))
        .transpose();

    let shorter = |gamma: &DMatrix<f64>| gamma.rows(0, rows - outputs).into_owned();
    let states = |gamma: &DMatrix<f64>| -> Result<_, IdentifyError> {
        let now = multiply(&pseudo_inverse(gamma, DEPENDENT)?, &projected);
        let mut left = DMatrix::zeros(n + outputs, longer);
        left.rows_mut(0, n).copy_from(&multiply(
            &pseudo_inverse(&shorter(gamma), DEPENDENT)?,
            &projected_next,
        ));
        left.rows_mut(n, outputs).copy_from(&present);
        Ok((now, left))
    };
    // A and C: [X_next; Y] = [A; C] X + (anything) U_f.
    let (now, left) = states(&gamma)?;
    let mut right = DMatrix::zeros(n + future * inputs, longer);
    right.view_mut((0, 0), (n, regressors)).copy_from(&now);
    right
        .view_mut((n, 0), (future * inputs, regressors))
        .copy_from(&future_inputs);
    let solution = least_squares(&right.transpose(), &left.transpose())?.transpose();
    let residual = &left - multiply(&solution, &right);
    let a = solution.view((0, 0), (n, n)).into_owned();
    let c = solution.view((n, 0), (outputs, n)).into_owned();

    // B and D, with the observability matrix of these A and C.
    let gamma = extended_observability(&a, &c, future);
    let (now, left) = states(&gamma)?;
    let of_states = solution.columns(0, n).into_owned();
    let target = left.columns(0, regressors) - multiply(&of_states, &now);
    let (b, d) = input_matrices(&InputProblem {
        regression,
        of_states: &of_states,
        gamma: &gamma,
        target: &target,
        future_inputs: &future_inputs,
        feedthrough,
    })?;

    let covariance = multiply_nt(&residual, &residual) / regression.columns as f64;
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

struct InputProblem<'a> {
    regression: &'a Regression,
    of_states: &'a DMatrix<f64>,
    gamma: &'a DMatrix<f64>,
    target: &'a DMatrix<f64>,
    future_inputs: &'a DMatrix<f64>,
    feedthrough: bool,
}

/// The coefficient of `U_f` is linear in `[D; B]`, block column by block column:
/// `[B | Gamma_{i-1}^+ H_{i-1}; D | 0] - [A; C] Gamma_i^+ H_i`.
fn input_matrices(
    problem: &InputProblem<'_>,
) -> Result<(DMatrix<f64>, DMatrix<f64>), IdentifyError> {
    let InputProblem {
        regression,
        of_states,
        gamma,
        target,
        future_inputs,
        feedthrough,
    } = *problem;
    let Regression {
        future,
        inputs,
        outputs,
        ..
    } = *regression;
    let n = of_states.ncols();
    let rows = future * outputs;
    // Block column k of H_blocks is S_k [D; B].
    let column_of_toeplitz = |blocks: usize, k: usize| {
        let mut s = DMatrix::zeros(blocks * outputs, outputs + n);
        s.view_mut((k * outputs, 0), (outputs, outputs))
            .fill_with_identity();
        let below = (blocks - 1 - k) * outputs;
        s.view_mut(((k + 1) * outputs, outputs), (below, n))
            .copy_from(&gamma.rows(0, below));
        s
    };
    let through_state = multiply(of_states, &pseudo_inverse(gamma, DEPENDENT)?);
    let shorter = pseudo_inverse(&gamma.rows(0, rows - outputs).into_owned(), DEPENDENT)?;
    let first = if feedthrough { 0 } else { outputs };
    let unknown = outputs - first + n;
    let (height, coordinates) = target.shape();
    // vec(target) = sum_k (u_k' (x) N_k) vec([D; B]).
    let mut regressor = DMatrix::zeros(height * coordinates, unknown * inputs);
    for k in 0..future {
        let mut block = -multiply(&through_state, &column_of_toeplitz(future, k));
        if k == 0 {
            for i in 0..outputs {
                block[(n + i, i)] += 1.0;
            }
            for i in 0..n {
                block[(i, outputs + i)] += 1.0;
            }
        } else {
            let next = multiply(&shorter, &column_of_toeplitz(future - 1, k - 1));
            let mut upper = block.rows_mut(0, n);
            upper += next;
        }
        for coordinate in 0..coordinates {
            for input in 0..inputs {
                let u = future_inputs[(k * inputs + input, coordinate)];
                for j in 0..unknown {
                    for i in 0..height {
                        regressor[(coordinate * height + i, input * unknown + j)] +=
                            u * block[(i, first + j)];
                    }
                }
            }
        }
    }
    let right = DMatrix::from_column_slice(height * coordinates, 1, target.as_slice());
    let solution = least_squares(&regressor, &right)?;
    let both = DMatrix::from_column_slice(unknown, inputs, solution.as_slice());
    let d = if feedthrough {
        both.rows(0, outputs).into_owned()
    } else {
        DMatrix::zeros(outputs, inputs)
    };
    Ok((both.rows(outputs - first, n).into_owned(), d))
}
