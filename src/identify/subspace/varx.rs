//! The high-order vector ARX model: the only estimate that carries noise, from which everything else
//! follows.

use nalgebra::DMatrix;

use crate::identify::IdentifyError;
use crate::linalg::{multiply_tn, pseudo_inverse, reciprocal_condition_upper, solve_upper};
use crate::moments::RFactor;

/// Below this reciprocal condition the regressors are dependent to working precision, and the
/// minimum-norm solution is taken: it predicts the record as well as any other.
const DEPENDENT: f64 = 1e-12;

/// Least squares of `y[k+p]` on `z[k], ..., z[k+p-1]` (and `u[k+p]` with feedthrough), from `R` alone:
/// van Wingerden (22)-(23).
#[derive(Debug, Clone)]
pub struct Varx {
    /// Coefficients `[C K^p (D)]`, `l x m`, oldest block first, `m = p q (+ r)`.
    pub coefficients: DMatrix<f64>,
    /// Triangular factor of the regressors, `m x m`.
    pub regressor_factor: DMatrix<f64>,
    /// The outputs in the same orthogonal coordinates, first `m` rows: `m x l`.
    pub output_factor: DMatrix<f64>,
    /// Residual sum of squares, `l x l`.
    pub sum_of_squares: DMatrix<f64>,
    /// `sum_of_squares / (Nc - m)`: the degrees of freedom matter (the paper is silent; `1 / Nc` is too
    /// small by `m / Nc`).
    pub innovation_covariance: DMatrix<f64>,
    /// Number of windows `Nc`.
    pub columns: usize,
    /// Past window.
    pub past: usize,
    /// Whether the regressors were dependent.
    pub dependent: bool,
    /// Whether `u[k+p]` is among the regressors.
    pub feedthrough: bool,
}

impl Varx {
    /// Number of regressors `m`.
    pub fn regressors(&self) -> usize {
        self.regressor_factor.nrows()
    }

    /// Residual degrees of freedom of each output.
    pub fn degrees_of_freedom(&self) -> usize {
        self.columns - self.regressors()
    }
}

/// Fits the vector ARX model.
///
/// # Errors
/// [`IdentifyError::TooShort`] when there are not more windows than regressors and outputs.
pub fn varx(factor: &RFactor, feedthrough: bool) -> Result<Varx, IdentifyError> {
    let (q, inputs, outputs) = (factor.channels(), factor.inputs, factor.outputs);
    let regressors = factor.past * q + if feedthrough { inputs } else { 0 };
    if factor.columns <= regressors + outputs {
        return Err(IdentifyError::TooShort {
            samples: factor.columns + factor.past,
            past: factor.past,
            needed: factor.past + regressors + outputs + 1,
        });
    }
    let r = &factor.r;
    let order = r.ncols();
    let regressor_factor = r.view((0, 0), (regressors, regressors)).into_owned();
    let output_factor = r
        .view((0, order - outputs), (regressors, outputs))
        .into_owned();
    let dependent = reciprocal_condition_upper(&regressor_factor) < DEPENDENT;
    let solution = if dependent {
        pseudo_inverse(&regressor_factor, DEPENDENT)? * &output_factor
    } else {
        solve_upper(&regressor_factor, &output_factor)
    };
    let below = r
        .view((regressors, order - outputs), (order - regressors, outputs))
        .into_owned();
    let mut sum_of_squares = multiply_tn(&below, &below);
    if dependent {
        let rest = &output_factor - &regressor_factor * &solution;
        sum_of_squares += multiply_tn(&rest, &rest);
    }
    let innovation_covariance = &sum_of_squares / (factor.columns - regressors) as f64;
    Ok(Varx {
        coefficients: solution.transpose(),
        regressor_factor,
        output_factor,
        sum_of_squares,
        innovation_covariance,
        columns: factor.columns,
        past: factor.past,
        dependent,
        feedthrough,
    })
}
