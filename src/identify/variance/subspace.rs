//! Asymptotic covariance of PBSID_opt, without any matrix as long as the record.
//!
//! The only random quantity is the error `M = E Z^+` of the vector ARX coefficients, whose covariance is
//! `(Z Z')^-1 (x) Lambda`. To first order the system matrices follow it linearly,
//!
//! ```text
//! [dA dB dK] = S T(M) zeta_next Phi^+ - A S T(M) Z Phi^+ + K M Z Phi^+
//! [dC (dD)]  = -C S T(M) Z [xhat;(u)]^+ + M Z [xhat;(u)]^+
//! ```
//!
//! with `T(M)` the block upper triangular arrangement (26). This is van Wingerden (35)-(41) and
//! Appendices B, C written for `M`. The terms in `K M` and `M` are the paper's beta terms with a **plus**:
//! the residual is `Ehat = E - E Pi_Z`, so its error is `-E Pi_Z`; the printed minus in (B.2) and (B.4) is
//! wrong, which a test shows.

use nalgebra::DMatrix;

use super::propagation::Propagation;
use crate::covariance::{ParameterCovariance, ParameterLayout};
use crate::identify::subspace::{Estimate, Varx};
use crate::linalg::{
    LinalgError, multiply, multiply_nt, pseudo_inverse, solve_upper_right,
    symmetric_square_root_factor,
};

/// Jacobian of `theta` with respect to `vec M`, entry `(parameter, o + l j)` for `M[o, j]`.
pub fn subspace_jacobian(estimate: &Estimate, varx: &Varx) -> (ParameterLayout, DMatrix<f64>) {
    jacobian_with_sign(estimate, varx, 1.0)
}

/// The Jacobian with the paper's terms beta times `sign`: plus one is right, minus one is what (B.2) and (B.4)
/// print, which only a comparison with the paper has a use for.
pub(crate) fn jacobian_with_sign(
    estimate: &Estimate,
    varx: &Varx,
    sign: f64,
) -> (ParameterLayout, DMatrix<f64>) {
    let system = &estimate.system;
    let (n, inputs, outputs) = (system.states(), system.inputs(), system.outputs());
    let q = inputs + outputs;
    let layout = ParameterLayout::of(system, varx.feedthrough);
    let regressors = varx.regressors();
    let mut jacobian = DMatrix::zeros(layout.len(), outputs * regressors);

    // The state equation: parameters vec [A B K], index a + n c.
    let zeta = &estimate.state_regression;
    let width = varx.past * q;
    let current = zeta.rows(0, width).into_owned();
    let next = zeta.rows(q, width).into_owned();
    let map = &estimate.state_map;
    let minus_a_map = -multiply(&system.a, map);
    add_shifted(&mut jacobian, n, 0, outputs, q, map, &next);
    add_shifted(&mut jacobian, n, 0, outputs, q, &minus_a_map, &current);
    add_direct(
        &mut jacobian,
        n,
        0,
        outputs,
        &(&system.k * sign),
        &zeta.rows(0, regressors).into_owned(),
    );

    // The output equation: parameters vec [C (D)], index a + l c.
    let zeta = &estimate.output_regression;
    let minus_c_map = -multiply(&system.c, map);
    let current = zeta.rows(0, width).into_owned();
    let first = layout.c();
    add_shifted(
        &mut jacobian,
        outputs,
        first,
        outputs,
        q,
        &minus_c_map,
        &current,
    );
    let identity = DMatrix::identity(outputs, outputs) * sign;
    add_direct(
        &mut jacobian,
        outputs,
        first,
        outputs,
        &identity,
        &zeta.rows(0, regressors).into_owned(),
    );
    (layout, jacobian)
}

/// Adds the derivative of `L T(M) G` with respect to `M`, `L = [L_1 .. L_f]` (`rows x f l`), `G` (`p q x m`):
/// `sum_i L_i[a, o] G[i q + j, c]` for parameter `(a, c)` and coefficient `(o, j)`.
///
/// The sum over the block rows `i` is one matrix product per column `c`.
fn add_shifted(
    jacobian: &mut DMatrix<f64>,
    rows: usize,
    first: usize,
    outputs: usize,
    channels: usize,
    left: &DMatrix<f64>,
    right: &DMatrix<f64>,
) {
    let future = left.ncols() / outputs;
    let width = right.nrows();
    // (a, o) x i.
    let stacked = DMatrix::from_fn(rows * outputs, future, |ao, i| {
        left[(ao % rows, i * outputs + ao / rows)]
    });
    for c in 0..right.ncols() {
        // i x j: row i is the column of G, moved up by i blocks.
        let hankel = DMatrix::from_fn(future, width, |i, j| {
            let row = i * channels + j;
            if row < width { right[(row, c)] } else { 0.0 }
        });
        let product = multiply(&stacked, &hankel);
        for j in 0..width {
            for o in 0..outputs {
                for a in 0..rows {
                    jacobian[(first + a + rows * c, o + outputs * j)] += product[(a + rows * o, j)];
                }
            }
        }
    }
}

/// Adds the derivative of `L M G` with respect to `M`: `L[a, o] G[j, c]`.
fn add_direct(
    jacobian: &mut DMatrix<f64>,
    rows: usize,
    first: usize,
    outputs: usize,
    left: &DMatrix<f64>,
    right: &DMatrix<f64>,
) {
    for c in 0..right.ncols() {
        for j in 0..right.nrows() {
            for o in 0..outputs {
                for a in 0..rows {
                    jacobian[(first + a + rows * c, o + outputs * j)] +=
                        left[(a, o)] * right[(j, c)];
                }
            }
        }
    }
}

/// Covariance of the system matrices, in scaled units and in the basis of the estimate.
///
/// # Errors
/// [`LinalgError`] when the innovation covariance cannot be decomposed.
pub fn subspace_covariance(
    estimate: &Estimate,
    varx: &Varx,
) -> Result<ParameterCovariance, LinalgError> {
    let (layout, jacobian) = subspace_jacobian(estimate, varx);
    let parameters = layout.len();
    let mut covariance = DMatrix::zeros(parameters, parameters);
    for whitened in whitened(&jacobian, varx)? {
        covariance += multiply_nt(&whitened, &whitened);
    }
    Ok(ParameterCovariance::of_matrix(layout, &covariance))
}

/// The errors behind [`subspace_covariance`] as a linear function of white noise, with those of the vector ARX
/// coefficients.
///
/// # Errors
/// [`LinalgError`] when the innovation covariance cannot be decomposed.
pub(crate) fn subspace_propagation(
    estimate: &Estimate,
    varx: &Varx,
) -> Result<Propagation, LinalgError> {
    let (layout, jacobian) = subspace_jacobian(estimate, varx);
    let of_coefficients = DMatrix::identity(jacobian.ncols(), jacobian.ncols());
    Ok(Propagation {
        layout,
        parameters: side_by_side(&whitened(&jacobian, varx)?),
        coefficients: side_by_side(&whitened(&of_coefficients, varx)?),
    })
}

fn side_by_side(parts: &[DMatrix<f64>]) -> DMatrix<f64> {
    let rows = parts.first().map_or(0, DMatrix::nrows);
    let mut out = DMatrix::zeros(rows, parts.iter().map(DMatrix::ncols).sum());
    let mut from = 0;
    for part in parts {
        out.columns_mut(from, part.ncols()).copy_from(part);
        from += part.ncols();
    }
    out
}

/// `J (R_z^-1 over j, chol(Lambda) over o)`, one part a direction of the noise: a covariance is the sum of the
/// products of the parts with their transposes, positive semidefinite by construction.
fn whitened(jacobian: &DMatrix<f64>, varx: &Varx) -> Result<Vec<DMatrix<f64>>, LinalgError> {
    let outputs = varx.coefficients.nrows();
    let regressors = varx.regressors();
    let parameters = jacobian.nrows();
    let noise = symmetric_square_root_factor(&varx.innovation_covariance)?;
    let inverse = if varx.dependent {
        Some(pseudo_inverse(&varx.regressor_factor, 1e-12)?)
    } else {
        None
    };
    let mut parts = Vec::with_capacity(outputs);
    for direction in 0..outputs {
        let mut mixed = DMatrix::zeros(parameters, regressors);
        for j in 0..regressors {
            let mut column = mixed.column_mut(j);
            for o in 0..outputs {
                column.axpy(
                    noise[(o, direction)],
                    &jacobian.column(o + outputs * j),
                    1.0,
                );
            }
        }
        parts.push(match &inverse {
            Some(inverse) => multiply(&mixed, inverse),
            None => solve_upper_right(&mixed, &varx.regressor_factor),
        });
    }
    Ok(parts)
}
