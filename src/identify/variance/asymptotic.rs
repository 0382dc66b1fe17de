//! The 'true' asymptotic covariance of a subspace estimate: that of known plant, noise and controller.
//!
//! For studies: what an estimated covariance is to be compared with. The formulas are those that the data-based
//! covariances use, with every sample covariance replaced by the exact one, which Lyapunov's equation of the closed
//! loop gives. Nothing is simulated. As in the estimate, the state is the one that the past window makes, and the residual
//! the one that it leaves.

use nalgebra::DMatrix;

use super::nested_errors::NestedErrors;
use super::subspace::subspace_covariance;
use crate::covariance::{CovarianceError, ParameterCovariance};
use crate::identify::subspace::{Estimate, Prediction, Varx, Weight};
use crate::linalg::{
    LinalgError, cholesky_upper, discrete_lyapunov, multiply, multiply_nt, multiply_tn,
    pseudo_inverse, solve_upper, solve_upper_transposed,
};
use crate::systems::{ClosedLoop, JointModel};

/// Algorithm whose asymptotic covariance is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AsymptoticMethod {
    /// PBSID_opt.
    PbsidOpt,
    /// Whitening filter or innovation estimation.
    Nested(Prediction),
}

/// `N` times the covariance of the parameters, `N` going to infinity, in the basis of `closed_loop.plant`.
///
/// `past` and `future` are the windows; the past window should be long enough that `(A - K C)^past` is negligible, as
/// in the papers: what it truncates is a bias that this covariance says nothing about.
///
/// # Errors
/// [`CovarianceError::Linalg`] for a closed loop that is not stable, or a plant that is not observable over the future
/// window.
pub fn asymptotic_covariance(
    closed_loop: &ClosedLoop,
    method: AsymptoticMethod,
    weight: Weight,
    past: usize,
    future: usize,
) -> Result<ParameterCovariance, CovarianceError> {
    let plant = &closed_loop.plant;
    let lambda = &closed_loop.innovation_covariance;
    let (n, inputs, outputs) = (plant.states(), plant.inputs(), plant.outputs());
    let q = inputs + outputs;
    let moments = Stationary::new(&closed_loop.joint()?)?;
    let width = past * q;

    // Oldest first: z[t-p] .. z[t].
    let window = moments.window(past + 1, |i, j| i as isize - j as isize);
    let past_covariance = window.view((0, 0), (width, width)).into_owned();
    let past_factor = cholesky_upper(&past_covariance)?;
    let solve = |right: &DMatrix<f64>| {
        solve_upper(&past_factor, &solve_upper_transposed(&past_factor, right))
    };
    let state_map = state_map(closed_loop, method, weight, future)?;
    // State and prediction of the output as functions of the past window.
    let (state_of_past, coefficients) = match method {
        AsymptoticMethod::Nested(_) => {
            let outputs_of_past = window.view((0, width + inputs), (width, outputs));
            (
                solve(&moments.past_with_state(past, n)).transpose(),
                solve(&outputs_of_past.into_owned()),
            )
        }
        // The paper's assumption (A - K C)^p = 0: van Wingerden (20)-(22).
        AsymptoticMethod::PbsidOpt => {
            let predictor = &plant.a - &plant.k * &plant.c;
            let mut column = DMatrix::zeros(n, q);
            column.columns_mut(0, inputs).copy_from(&plant.b);
            column.columns_mut(inputs, outputs).copy_from(&plant.k);
            let mut state = DMatrix::zeros(n, width);
            for block in (0..past).rev() {
                state.columns_mut(block * q, q).copy_from(&column);
                column = &predictor * column;
            }
            let coefficients = (&plant.c * &state).transpose();
            (state, coefficients)
        }
    };

    // [x; u; e] as functions of the window, and its regression on them.
    let mut regressors = DMatrix::zeros(n + q, width + q);
    regressors
        .view_mut((0, 0), (n, width))
        .copy_from(&state_of_past);
    for i in 0..inputs {
        regressors[(n + i, width + i)] = 1.0;
    }
    regressors
        .view_mut((n + inputs, 0), (outputs, width))
        .copy_from(&(-coefficients.transpose()));
    for i in 0..outputs {
        regressors[(n + inputs + i, width + inputs + i)] = 1.0;
    }
    let with_regressors = multiply_nt(&window, &regressors);
    let own = multiply(&regressors, &with_regressors);
    let regression = |count: usize| -> Result<DMatrix<f64>, LinalgError> {
        let factor = cholesky_upper(&own.view((0, 0), (count, count)).into_owned())?;
        let cross = with_regressors.columns(0, count).transpose();
        Ok(solve_upper(&factor, &solve_upper_transposed(&factor, &cross)).transpose())
    };

    let state_regression = regression(n + q)?;
    let output_regression = regression(n)?;
    match method {
        AsymptoticMethod::PbsidOpt => {
            let estimate = Estimate {
                system: plant.clone(),
                state_map,
                state_regression,
                output_regression,
            };
            let varx = Varx {
                coefficients: coefficients.transpose(),
                output_factor: multiply(&past_factor, &coefficients),
                regressor_factor: past_factor,
                sum_of_squares: lambda.clone(),
                innovation_covariance: lambda.clone(),
                columns: width + 1,
                past,
                dependent: false,
                feedthrough: false,
            };
            Ok(subspace_covariance(&estimate, &varx)?)
        }
        AsymptoticMethod::Nested(prediction) => {
            let newest_first = moments.window(past + future, |i, j| j as isize - i as isize);
            let errors = NestedErrors {
                prediction,
                system: plant,
                innovation_covariance: lambda,
                state_map: &state_map,
                state_regression: &state_regression,
                output_regression: &output_regression,
                window_factor: &cholesky_upper(&newest_first)?,
                columns: 1.0,
                past,
                feedthrough: false,
            };
            let found = errors.propagation()?;
            Ok(ParameterCovariance::of_root(
                found.layout,
                &found.parameters,
            ))
        }
    }
}

/// The limit of `S = (Gamma' W' W Gamma)^-1 Gamma' W' W` in the basis of the plant.
///
/// For canonical variates `W' W` is the inverse of `Gamma P Gamma' + R`, `R` the covariance of the stacked noise; the
/// first term drops out of `S`.
fn state_map(
    closed_loop: &ClosedLoop,
    method: AsymptoticMethod,
    weight: Weight,
    future: usize,
) -> Result<DMatrix<f64>, LinalgError> {
    let plant = &closed_loop.plant;
    let (n, outputs) = (plant.states(), plant.outputs());
    let order = future * outputs;
    let with_innovations = method == AsymptoticMethod::Nested(Prediction::InnovationEstimation);
    let transition = if with_innovations {
        plant.a.clone()
    } else {
        &plant.a - &plant.k * &plant.c
    };
    let mut observability = DMatrix::zeros(order, n);
    let mut row = plant.c.clone();
    for i in 0..future {
        observability.rows_mut(i * outputs, outputs).copy_from(&row);
        row = &row * &transition;
    }
    let whitener = match weight {
        Weight::Identity => DMatrix::identity(order, order),
        Weight::Cva => {
            let mut toeplitz = DMatrix::identity(order, order);
            if with_innovations {
                for i in 0..future {
                    for j in 0..i {
                        let response =
                            observability.rows((i - j - 1) * outputs, outputs) * &plant.k;
                        toeplitz
                            .view_mut((i * outputs, j * outputs), (outputs, outputs))
                            .copy_from(&response);
                    }
                }
            }
            let lambda = &closed_loop.innovation_covariance;
            let noise = DMatrix::<f64>::identity(future, future).kronecker(lambda);
            let covariance = multiply_nt(&multiply(&toeplitz, &noise), &toeplitz);
            let upper = cholesky_upper(&covariance)?;
            solve_upper_transposed(&upper, &DMatrix::identity(order, order))
        }
    };
    let weighted = multiply(&whitener, &observability);
    let gram = multiply_tn(&weighted, &weighted);
    if cholesky_upper(&gram).is_err() {
        return Err(LinalgError::Singular {
            what: "observability matrix",
        });
    }
    Ok(multiply(
        &pseudo_inverse(&weighted, f64::EPSILON)?,
        &whitener,
    ))
}

/// Exact covariances of the stationary closed loop.
struct Stationary {
    /// `E z[k] z[k]'`.
    at_zero: DMatrix<f64>,
    /// `E s[k+1] z[k]'`.
    next_state_with_output: DMatrix<f64>,
    transition: DMatrix<f64>,
    output: DMatrix<f64>,
}

impl Stationary {
    fn new(joint: &JointModel) -> Result<Self, LinalgError> {
        let noise = multiply_nt(&joint.noise_to_state, &joint.noise_to_state);
        let states = discrete_lyapunov(&joint.transition, &noise)?;
        let with_output = multiply_nt(&states, &joint.output);
        Ok(Self {
            at_zero: multiply(&joint.output, &with_output)
                + multiply_nt(&joint.noise_to_output, &joint.noise_to_output),
            next_state_with_output: multiply(&joint.transition, &with_output)
                + multiply_nt(&joint.noise_to_state, &joint.noise_to_output),
            transition: joint.transition.clone(),
            output: joint.output.clone(),
        })
    }

    /// Covariance of `blocks` samples of `z`; `lag(i, j)` is the time of block `i` minus that of block `j`.
    fn window(&self, blocks: usize, lag: impl Fn(usize, usize) -> isize) -> DMatrix<f64> {
        let q = self.at_zero.nrows();
        let mut lagged = vec![self.at_zero.clone()];
        let mut state = self.next_state_with_output.clone();
        for _ in 1..blocks {
            lagged.push(&self.output * &state);
            state = &self.transition * state;
        }
        let mut out = DMatrix::zeros(blocks * q, blocks * q);
        for i in 0..blocks {
            for j in 0..blocks {
                let tau = lag(i, j);
                let block = &lagged[tau.unsigned_abs()];
                let mut place = out.view_mut((i * q, j * q), (q, q));
                if tau >= 0 {
                    place.copy_from(block);
                } else {
                    place.copy_from(&block.transpose());
                }
            }
        }
        out
    }

    /// `E z[t-p .. t) x[t]'`, oldest first, `x` the first `n` entries of the joint state.
    fn past_with_state(&self, past: usize, n: usize) -> DMatrix<f64> {
        let q = self.at_zero.nrows();
        let mut out = DMatrix::zeros(past * q, n);
        let mut state = self.next_state_with_output.clone();
        for block in (0..past).rev() {
            out.rows_mut(block * q, q)
                .copy_from(&state.rows(0, n).transpose());
            state = &self.transition * state;
        }
        out
    }
}
