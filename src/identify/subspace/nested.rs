//! Nested vector ARX regressions of growing past windows, and the state that they make, from one factor.
//!
//! For `k = 0 ..= f` the outputs `y[t+k]` are regressed on *all* of `z[t-p .. t+k]`. The regressors are nested, so
//! one triangular factor of `p + f + 1` blocks holds every one of them, and also those that are shifted by one
//! sample: the regression of `y[t+1+k]` on `z[t-p .. t+1+k]` is regression `k + 1`.
//!
//! - **Whitening filter** (Chiuso & Picci, "predictor based"): the part of the coefficients on the past
//!   `z[t-p .. t)` predicts the outputs with the future inputs and outputs held; its range is spanned by
//!   `C (A - K C)^i`.
//! - **Innovation estimation** (Qin & Ljung): the future outputs are replaced by the future innovations, which are
//!   the residuals of the earlier regressions and span the same space. With `L` the strictly lower block triangular
//!   coefficients on the future outputs this is multiplication by `(I - L)^-1`; the range is spanned by `C A^i`.
//!
//! The state at `t` and at `t + 1` are the *same* combination of the predictions from `z[t-p .. t)` and from
//! `z[t-p .. t]`: the past window grows by one sample instead of sliding.

use nalgebra::DMatrix;

use super::pbsid_opt::{Estimate, Weight, state_regressions};
use super::varx::{Varx, varx};
use super::weighted::{WeightedSvd, in_users_units};
use crate::identify::IdentifyError;
use crate::linalg::{
    cholesky_upper, multiply, multiply_nt, multiply_tn, pseudo_inverse, reciprocal_condition_upper,
    solve_upper, solve_upper_transposed,
};
use crate::moments::RFactor;

/// Below this reciprocal condition the regressors are dependent to working precision, as in the vector ARX model.
const DEPENDENT: f64 = 1e-12;

/// Which of the two algorithms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Prediction {
    /// Whitening filter.
    Whitening,
    /// Innovation estimation.
    InnovationEstimation,
}

/// Coefficients of the nested regressions of a past window `p` and a future window `f`.
#[derive(Debug, Clone)]
pub(crate) struct Nested {
    /// `Theta_k`, `k = 0 ..= f`, `l x ((p + k) q (+ r))`, oldest block first.
    pub(crate) coefficients: Vec<DMatrix<f64>>,
    /// Residual covariance of each, `l x l`, per window (no degrees of freedom taken off: these are weights).
    pub(crate) residual_covariances: Vec<DMatrix<f64>>,
    /// Data of the first `p + 1` blocks.
    pub(crate) leading: RFactor,
    /// Vector ARX model of the past window, over the same windows: `Theta_0` with its residuals.
    pub(crate) varx: Varx,
    /// Future window.
    pub(crate) future: usize,
}

impl Nested {
    /// Regressions from a factor of window `past + future`.
    ///
    /// # Errors
    /// [`IdentifyError::TooShortForWindows`] when there are not more windows than regressors.
    pub(crate) fn new(
        factor: &RFactor,
        past: usize,
        feedthrough: bool,
    ) -> Result<Self, IdentifyError> {
        let (q, inputs, outputs) = (factor.channels(), factor.inputs, factor.outputs);
        let future = factor.past - past;
        let direct = if feedthrough { inputs } else { 0 };
        let most = factor.past * q + direct;
        if factor.columns <= most + outputs {
            return Err(IdentifyError::TooShortForWindows {
                samples: factor.columns + factor.past,
                past,
                future,
                needed: factor.past + most + outputs + 1,
            });
        }
        let r = &factor.r;
        let mut coefficients = Vec::with_capacity(future + 1);
        let mut residual_covariances = Vec::with_capacity(future + 1);
        let dependent =
            reciprocal_condition_upper(&r.view((0, 0), (most, most)).into_owned()) < DEPENDENT;
        for k in 0..=future {
            let blocks = (past + k) * q;
            let regressors = blocks + direct;
            let square = r.view((0, 0), (regressors, regressors)).into_owned();
            let of_outputs = r.columns(blocks + inputs, outputs);
            let target = of_outputs.rows(0, regressors).into_owned();
            let solution = if dependent {
                pseudo_inverse(&square, DEPENDENT)? * &target
            } else {
                solve_upper(&square, &target)
            };
            let below = of_outputs
                .rows(regressors, blocks + q - regressors)
                .into_owned();
            let mut squares = multiply_tn(&below, &below);
            if dependent {
                let rest = &target - &square * &solution;
                squares += multiply_tn(&rest, &rest);
            }
            coefficients.push(solution.transpose());
            residual_covariances.push(squares / factor.columns as f64);
        }
        let leading = factor.leading(past);
        Ok(Self {
            coefficients,
            residual_covariances,
            varx: varx(&leading, feedthrough)?,
            leading,
            future,
        })
    }

    /// Number of windows.
    pub(crate) fn columns(&self) -> usize {
        self.leading.columns
    }

    /// Predictions of the `f` outputs after `past` samples from those samples, `f l x past q`; `past` is `p`, or
    /// `p + 1` for the next state.
    pub(crate) fn predictions(&self, prediction: Prediction, past: usize) -> DMatrix<f64> {
        let (q, outputs) = (self.leading.channels(), self.leading.outputs);
        let shift = past - self.leading.past;
        let mut out = DMatrix::zeros(self.future * outputs, past * q);
        for k in 0..self.future {
            let row = self.coefficients[k + shift].columns(0, past * q);
            out.rows_mut(k * outputs, outputs).copy_from(&row);
        }
        match prediction {
            Prediction::Whitening => out,
            Prediction::InnovationEstimation => self.with_future_innovations(out, past),
        }
    }

    /// `(I - L)^-1 M` for `M` with `f l` rows, by forward substitution over block rows.
    fn with_future_innovations(&self, mut of: DMatrix<f64>, past: usize) -> DMatrix<f64> {
        let (q, inputs, outputs) = (
            self.leading.channels(),
            self.leading.inputs,
            self.leading.outputs,
        );
        let shift = past - self.leading.past;
        for k in 0..self.future {
            let mut row = of.rows(k * outputs, outputs).into_owned();
            for j in 0..k {
                let column = (past + j) * q + inputs;
                row += self.coefficients[k + shift].columns(column, outputs)
                    * of.rows(j * outputs, outputs);
            }
            of.rows_mut(k * outputs, outputs).copy_from(&row);
        }
        of
    }

    /// Square root (`F F'`) of the covariance of the stacked prediction errors: block diagonal for the whitening
    /// filter, `(I - L)^-1` times that for innovation estimation. It is also the covariance `P` of the stacked
    /// noise in the sense of Knudsen (25), estimated so that feedback does no harm.
    ///
    /// # Errors
    /// [`IdentifyError::Linalg`] when a residual covariance is singular.
    pub(crate) fn noise_root(&self, prediction: Prediction) -> Result<DMatrix<f64>, IdentifyError> {
        let outputs = self.leading.outputs;
        let order = self.future * outputs;
        let mut root = DMatrix::zeros(order, order);
        for k in 0..self.future {
            let mut covariance = self.residual_covariances[k].clone();
            // A noise-free record leaves it singular; rounding is its noise then.
            let floor = covariance.amax().max(f64::MIN_POSITIVE) * 1e-13;
            for i in 0..outputs {
                covariance[(i, i)] += floor;
            }
            let lower = cholesky_upper(&covariance)?.transpose();
            root.view_mut((k * outputs, k * outputs), (outputs, outputs))
                .copy_from(&lower);
        }
        Ok(match prediction {
            Prediction::Whitening => root,
            Prediction::InnovationEstimation => {
                self.with_future_innovations(root, self.leading.past)
            }
        })
    }
}

/// What all orders of one method, past and future window share.
#[derive(Debug, Clone)]
pub(crate) struct NestedDecomposition {
    prediction: Prediction,
    /// Predictions from `p` and from `p + 1` samples.
    from_past: DMatrix<f64>,
    from_longer_past: DMatrix<f64>,
    /// Of the weighted predictions.
    pub(crate) svd: WeightedSvd,
}

/// Weighted singular value decomposition of the predictions.
///
/// # Errors
/// [`IdentifyError::Linalg`] when the decomposition does not converge.
pub(crate) fn decompose_nested(
    nested: &Nested,
    prediction: Prediction,
    weight: Weight,
) -> Result<NestedDecomposition, IdentifyError> {
    let leading = &nested.leading;
    let (q, past) = (leading.channels(), leading.past);
    let order = nested.future * leading.outputs;
    let from_past = nested.predictions(prediction, past);
    let past_factor = leading.r.view((0, 0), (past * q, past * q)).into_owned();
    let product = multiply_nt(&from_past, &past_factor);
    let weight_matrix = match weight {
        Weight::Identity => in_users_units(&leading.scale[leading.inputs..], nested.future),
        Weight::Cva => {
            let root = nested.noise_root(prediction)?;
            let mut covariance = multiply_nt(&product, &product) / nested.columns() as f64;
            covariance += multiply_nt(&root, &root);
            let upper = cholesky_upper(&covariance)?;
            solve_upper_transposed(&upper, &DMatrix::identity(order, order))
        }
    };
    Ok(NestedDecomposition {
        prediction,
        from_longer_past: nested.predictions(prediction, past + 1),
        from_past,
        svd: WeightedSvd::new(&weight_matrix, &product, nested.columns())?,
    })
}

impl NestedDecomposition {
    /// Which algorithm it is of.
    pub(crate) fn prediction(&self) -> Prediction {
        self.prediction
    }
}

/// Least-squares recovery of the system matrices for the given map to the state.
///
/// # Errors
/// [`IdentifyError::SingularRegression`] when the states are dependent.
pub(crate) fn nested_system_matrices(
    nested: &Nested,
    decomposition: &NestedDecomposition,
    state_map: DMatrix<f64>,
    sample_time: f64,
) -> Result<Estimate, IdentifyError> {
    let state = multiply(&state_map, &decomposition.from_past);
    let next = multiply(&state_map, &decomposition.from_longer_past);
    state_regressions(
        &nested.leading,
        &nested.varx,
        &state,
        &next,
        state_map,
        sample_time,
    )
}
