//! The gain whose one-step predictor is nearest to the vector ARX model, for given `A, B, C, D`.
//!
//! `min_K | Lambda^{-1/2} (Ry' - Xi(A, B, C, D, K) Rz') |_F^2`, the cost of the polish over `K` alone: of all
//! stochastic parts that can go with a deterministic part it is the most likely one. The noise never has to be
//! told apart from the inputs, so feedback does no harm.

use nalgebra::{DMatrix, DVector};

use super::StochasticPart;
use crate::covariance::ParameterLayout;
use crate::identify::IdentifyError;
use crate::identify::method::Windows;
use crate::identify::polish::Problem;
use crate::identify::stable::with_stable_predictor;
use crate::identify::subspace::{Varx, varx};
use crate::identify::variance::Propagation;
use crate::linalg::{
    cholesky_upper, least_squares, multiply, multiply_nt, pseudo_inverse, solve_upper_transposed,
};
use crate::model::StateSpace;
use crate::moments::RFactor;

/// The iteration ends when a step changes the cost by less than this, in units of chi-square.
const DECREASE: f64 = 1e-10;
/// From the start of [`first_guess`] three to six steps are usual.
const ITERATIONS: usize = 40;
/// Halvings of a step that does not lead down.
const HALVINGS: usize = 12;
/// Directions of `K` whose effect on the predictor is below this share of the largest are not determined.
const UNDETERMINED: f64 = 1e-10;

pub(super) fn estimate(
    deterministic: &StateSpace,
    windows: &Windows,
    factor: &RFactor,
) -> Result<StochasticPart, IdentifyError> {
    let varx = varx(factor, windows.varx.feedthrough)?;
    let layout = ParameterLayout::of(deterministic, varx.feedthrough);
    let problem = Problem::new(&varx, layout)?;
    let guess = StateSpace {
        k: first_guess(deterministic, &varx)?,
        ..deterministic.clone()
    };
    let mut system = with_stable_predictor(&guess, &varx.innovation_covariance).unwrap_or(guess);
    let mut cost = problem.cost(&system);
    for _ in 0..ITERATIONS {
        let jacobian = problem.jacobian(&system);
        let of_gain = jacobian
            .columns(layout.k(), layout.c() - layout.k())
            .into_owned();
        let residual = DVector::from_column_slice(problem.residual(&system).as_slice());
        let step = pseudo_inverse(&of_gain, UNDETERMINED)? * residual;
        let direction = DMatrix::from_column_slice(layout.states, layout.outputs, step.as_slice());
        let tried = (0..HALVINGS).find_map(|halving| {
            let candidate = StateSpace {
                k: &system.k + &direction * 0.5_f64.powi(halving as i32),
                ..system.clone()
            };
            let candidate_cost = problem.cost(&candidate);
            (candidate_cost < cost).then_some((candidate, candidate_cost))
        });
        let Some((candidate, candidate_cost)) = tried else {
            break;
        };
        let gained = cost - candidate_cost;
        system = candidate;
        cost = candidate_cost;
        if gained < DECREASE {
            break;
        }
    }
    Ok(StochasticPart {
        gain: system.k,
        innovation_covariance: varx.innovation_covariance,
    })
}

/// `K` from the impulse response of the noise model, `g_i = C A^{i-1} K`, which the coefficients of the vector ARX
/// model on past outputs give: `g_0 = I`, `g_i = sum_{j=1}^i Xi_y(j) g_{i-j}`.
fn first_guess(deterministic: &StateSpace, varx: &Varx) -> Result<DMatrix<f64>, IdentifyError> {
    let (n, l) = (deterministic.states(), deterministic.outputs());
    let q = deterministic.inputs() + l;
    // As many as determine the state, twice over; further ones carry mostly noise.
    let count = varx.past.min(2 * (n.div_ceil(l) + 1));
    let on_output = |lag: usize| {
        let column = (varx.past - lag) * q + deterministic.inputs();
        varx.coefficients.columns(column, l)
    };
    let mut response: Vec<DMatrix<f64>> = vec![DMatrix::identity(l, l)];
    for i in 1..=count {
        let mut sum = DMatrix::zeros(l, l);
        for j in 1..=i {
            sum += on_output(j) * &response[i - j];
        }
        response.push(sum);
    }
    let mut observability = DMatrix::zeros(count * l, n);
    let mut stacked = DMatrix::zeros(count * l, l);
    let mut row = deterministic.c.clone();
    for i in 0..count {
        observability.rows_mut(i * l, l).copy_from(&row);
        stacked.rows_mut(i * l, l).copy_from(&response[i + 1]);
        row = &row * &deterministic.a;
    }
    Ok(least_squares(&observability, &stacked).or_else(|_| {
        pseudo_inverse(&observability, UNDETERMINED).map(|inverse| inverse * &stacked)
    })?)
}

/// `dK = X_K^+ (L^-1 dXi Rz' - X_D dtheta_D)` with `X` the derivative of the whitened predictions.
pub(super) fn propagation(
    system: &StateSpace,
    varx: &Varx,
    of_method: Propagation,
) -> Result<Propagation, IdentifyError> {
    let layout = ParameterLayout::of(system, varx.feedthrough);
    let problem = Problem::new(varx, layout)?;
    let jacobian = problem.jacobian(system);
    let Propagation {
        layout: _,
        mut parameters,
        coefficients,
    } = of_method;
    let (first, count) = (layout.k(), layout.c() - layout.k());
    parameters.rows_mut(first, count).fill(0.0);
    let mut change = -multiply(&jacobian, &parameters);
    let upper = cholesky_upper(&varx.innovation_covariance)?;
    let (outputs, regressors) = (layout.outputs, varx.regressors());
    for (mut column, coefficient) in change.column_iter_mut().zip(coefficients.column_iter()) {
        let error = DMatrix::from_column_slice(outputs, regressors, coefficient.as_slice());
        let predicted = multiply_nt(&error, &varx.regressor_factor);
        let whitened = solve_upper_transposed(&upper, &predicted);
        column += DVector::from_column_slice(whitened.as_slice());
    }
    let of_gain = jacobian.columns(first, count).into_owned();
    let gain = multiply(&pseudo_inverse(&of_gain, UNDETERMINED)?, &change);
    parameters.rows_mut(first, count).copy_from(&gain);
    Ok(Propagation {
        layout,
        parameters,
        coefficients,
    })
}
