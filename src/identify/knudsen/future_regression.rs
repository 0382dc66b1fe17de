//! The regression of stacked future outputs on past and future inputs, from `R` alone.

use nalgebra::DMatrix;

use crate::identify::IdentifyError;
use crate::linalg::{multiply_tn, pseudo_inverse, qr_r, reciprocal_condition_upper, solve_upper};
use crate::moments::RFactor;

/// Below this reciprocal condition the regressors are dependent to working precision, and the minimum-norm solution
/// is taken.
const DEPENDENT: f64 = 1e-12;

/// Least squares of `Y_f` on `Z = [W_p; U_f]`, Knudsen (7)-(8) and (25), with `i` past and `h` future samples.
///
/// `W_p` holds the past samples in the order of the recording, `[u; y]` of the oldest first. The paper stacks all
/// outputs before all inputs; nothing that follows depends on the order.
#[derive(Debug, Clone)]
pub(crate) struct Regression {
    /// Past window `i`.
    pub(crate) past: usize,
    /// Future window `h`.
    pub(crate) future: usize,
    /// Number of inputs `m`.
    pub(crate) inputs: usize,
    /// Number of outputs `l`.
    pub(crate) outputs: usize,
    /// Number of windows `j`.
    pub(crate) columns: usize,
    /// Triangular factor of `[Z; y_i; .. ; y_{i+h-1}]` (as columns): what is below the rows of `Z` is residual.
    pub(crate) factor: DMatrix<f64>,
    /// `Theta = [Theta_p Theta_f]`, `h l x (i (m + l) + h m)`.
    pub(crate) coefficients: DMatrix<f64>,
    /// `P`, the covariance of the residuals, `h l` square, divided by `j` less the rows of `Z`.
    pub(crate) residual_covariance: DMatrix<f64>,
}

impl Regression {
    /// Regression with a past of `past` samples: the data factor holds windows of `past + future` samples, so its
    /// own window is `past + future - 1`.
    ///
    /// # Errors
    /// [`IdentifyError::TooShort`] when there are not more windows than variables, [`IdentifyError::Horizon`] when
    /// the factor holds no future.
    pub(crate) fn new(factor: &RFactor, past: usize) -> Result<Self, IdentifyError> {
        let (q, inputs, outputs) = (factor.channels(), factor.inputs, factor.outputs);
        let blocks = factor.past + 1;
        if past == 0 || past >= blocks {
            return Err(IdentifyError::Horizon {
                asked: format!("--past {past}"),
                reason: format!("a window of {blocks} samples has to hold a past and a future"),
            });
        }
        let future = blocks - past;
        let mut order: Vec<usize> = (0..past * q).collect();
        for k in past..blocks {
            order.extend(k * q..k * q + inputs);
        }
        let regressors = order.len();
        for k in past..blocks {
            order.extend(k * q + inputs..(k + 1) * q);
        }
        if factor.columns <= order.len() {
            return Err(IdentifyError::TooShort {
                samples: factor.columns + factor.past,
                past: factor.past,
                needed: factor.past + order.len() + 1,
            });
        }
        let permuted = DMatrix::from_fn(factor.r.nrows(), order.len(), |i, k| {
            factor.r[(i, order[k])]
        });
        let triangular = qr_r(&permuted);
        let rows = future * outputs;
        let of_regressors = triangular
            .view((0, 0), (regressors, regressors))
            .into_owned();
        let of_outputs = triangular
            .view((0, regressors), (regressors, rows))
            .into_owned();
        let residual = triangular
            .view((regressors, regressors), (rows, rows))
            .into_owned();
        let mut sum_of_squares = multiply_tn(&residual, &residual);
        let solution = if reciprocal_condition_upper(&of_regressors) < DEPENDENT {
            let solution = pseudo_inverse(&of_regressors, DEPENDENT)? * &of_outputs;
            let rest = &of_outputs - &of_regressors * &solution;
            sum_of_squares += multiply_tn(&rest, &rest);
            solution
        } else {
            solve_upper(&of_regressors, &of_outputs)
        };
        let symmetric = (&sum_of_squares + sum_of_squares.transpose()) * 0.5;
        Ok(Self {
            past,
            future,
            inputs,
            outputs,
            columns: factor.columns,
            factor: triangular,
            coefficients: solution.transpose(),
            residual_covariance: symmetric / (factor.columns - regressors) as f64,
        })
    }

    /// Rows of `Z`.
    pub(crate) fn regressors(&self) -> usize {
        self.coefficients.ncols()
    }

    /// Rows of `W_p`.
    pub(crate) fn past_rows(&self) -> usize {
        self.past * (self.inputs + self.outputs)
    }

    /// Residual degrees of freedom, `j` less the rows of `Z`.
    pub(crate) fn degrees_of_freedom(&self) -> usize {
        self.columns - self.regressors()
    }

    /// `Theta_p`, `h l x i (m + l)`.
    pub(crate) fn past_coefficients(&self) -> DMatrix<f64> {
        self.coefficients.columns(0, self.past_rows()).into_owned()
    }

    /// `Theta_f`, the estimate of the Toeplitz matrix `H_h^d` (17), `h l x h m`.
    pub(crate) fn future_coefficients(&self) -> DMatrix<f64> {
        let first = self.past_rows();
        self.coefficients
            .columns(first, self.future * self.inputs)
            .into_owned()
    }

    /// Triangular root of `W_p W_p'` (as `R' R`), `i (m + l)` square.
    pub(crate) fn past_factor(&self) -> DMatrix<f64> {
        let rows = self.past_rows();
        self.factor.view((0, 0), (rows, rows)).into_owned()
    }

    /// Triangular root of `Z Z'` (as `R' R`).
    pub(crate) fn regressor_factor(&self) -> DMatrix<f64> {
        let rows = self.regressors();
        self.factor.view((0, 0), (rows, rows)).into_owned()
    }
}
