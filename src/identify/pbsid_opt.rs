//! Optimised predictor-based subspace identification, from `R` alone.
//!
//! The paper works with matrices as long as the record; here every quantity is expressed through the
//! factor `R` of the data, which gives the same numbers (a test holds the two forms against each other)
//! at a cost that does not depend on the number of samples.

use nalgebra::DMatrix;

use super::error::IdentifyError;
use super::varx::Varx;
use crate::linalg::{
    cholesky_upper, multiply, multiply_nt, multiply_tn, pseudo_inverse, qr_thin, solve_upper,
    solve_upper_transposed, svd_thin,
};
use crate::model::StateSpace;
use crate::moments::RFactor;

/// Relative size below which a regressor is dependent on the others, or zero, to working precision.
const DEPENDENT: f64 = 1e-11;

/// Weight `W` of the singular value decomposition (28).
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum Weight {
    /// `W = I` in the units of the recording, as in the paper.
    Identity,
    /// Canonical variates: `W' W` is the inverse of the covariance of the stacked future outputs,
    /// `Phi Phi' / Nc + I (x) Lambda`. Does not depend on the units of the outputs.
    Cva,
}

/// Singular value decomposition of the weighted product of extended observability and state sequence.
#[derive(Debug, Clone)]
pub struct Decomposition {
    /// `[Gamma K]`, `f l x p q` (24)-(25).
    gamma_k: DMatrix<f64>,
    /// `U' W`, one row a singular value.
    weighted_left: DMatrix<f64>,
    /// Singular values of `W Gamma K Z`, decreasing.
    pub singular_values: Vec<f64>,
    columns: usize,
}

/// Stacks the vector ARX coefficients into the block upper triangular `Gamma K` of (25), `f` block rows.
fn gamma_k(varx: &Varx, future: usize, channels: usize) -> DMatrix<f64> {
    let outputs = varx.coefficients.nrows();
    let width = varx.past * channels;
    let mut out = DMatrix::zeros(future * outputs, width);
    for i in 0..future {
        let shift = i * channels;
        out.view_mut((i * outputs, shift), (outputs, width - shift))
            .copy_from(&varx.coefficients.columns(0, width - shift));
    }
    out
}

/// Weighted singular value decomposition (28) for a future window `f <= p`.
///
/// # Errors
/// [`IdentifyError::Linalg`] when the decomposition does not converge.
pub fn decompose(
    factor: &RFactor,
    varx: &Varx,
    future: usize,
    weight: Weight,
) -> Result<Decomposition, IdentifyError> {
    let (q, outputs) = (factor.channels(), factor.outputs);
    let width = factor.past * q;
    let gamma_k = gamma_k(varx, future, q);
    let past_factor = factor.r.view((0, 0), (width, width)).into_owned();
    let product = multiply_nt(&gamma_k, &past_factor);
    let weight_matrix = match weight {
        Weight::Identity => {
            // The channels are scaled: identity in the user's units is the scale of each output.
            let scale = &factor.scale[factor.inputs..];
            DMatrix::from_fn(future * outputs, future * outputs, |i, j| {
                if i == j { scale[i % outputs] } else { 0.0 }
            })
        }
        Weight::Cva => {
            let mut covariance = multiply_nt(&product, &product) / factor.columns as f64;
            for i in 0..future {
                let mut block = covariance.view_mut((i * outputs, i * outputs), (outputs, outputs));
                block += &varx.innovation_covariance;
            }
            // A noise-free record leaves the covariance singular; rounding is its noise then.
            let floor = covariance.amax() * 1e-13;
            for i in 0..covariance.nrows() {
                covariance[(i, i)] += floor;
            }
            let upper = cholesky_upper(&covariance)?;
            solve_upper_transposed(
                &upper,
                &DMatrix::identity(future * outputs, future * outputs),
            )
        }
    };
    let svd = svd_thin(&multiply(&weight_matrix, &product))?;
    let mut left = svd.u;
    for mut column in left.column_iter_mut() {
        // The sign of a singular vector is arbitrary: fix it, so that results are reproducible.
        if column[column.icamax()] < 0.0 {
            column.neg_mut();
        }
    }
    Ok(Decomposition {
        gamma_k,
        weighted_left: multiply_tn(&left, &weight_matrix),
        singular_values: svd.values.iter().copied().collect(),
        columns: factor.columns,
    })
}

impl Decomposition {
    /// Largest order that the decomposition can give.
    pub fn largest_order(&self) -> usize {
        let first = self.singular_values.first().copied().unwrap_or(0.0);
        self.singular_values
            .iter()
            .take_while(|&&s| s > first * 1e-12)
            .count()
    }

    /// The map `S` (`n x f l`) from the stacked predicted outputs to the state, (29), scaled so that the
    /// states have unit variance.
    pub fn state_map(&self, order: usize) -> DMatrix<f64> {
        scaled_rows(
            &self.weighted_left,
            &self.singular_values,
            self.columns,
            order,
        )
    }

    /// `S [Gamma K]`, `n x p q`: the state as a function of the past window.
    fn state_of_past(&self, state_map: &DMatrix<f64>) -> DMatrix<f64> {
        multiply(state_map, &self.gamma_k)
    }
}

/// The first `order` rows of `U' W`, each divided by the standard deviation of its state over the record.
pub(super) fn scaled_rows(
    weighted_left: &DMatrix<f64>,
    singular_values: &[f64],
    columns: usize,
    order: usize,
) -> DMatrix<f64> {
    let mut map = weighted_left.rows(0, order).into_owned();
    for (i, mut row) in map.row_iter_mut().enumerate() {
        row *= (columns as f64).sqrt() / singular_values[i];
    }
    map
}

/// System matrices with the regression quantities that their covariance needs.
#[derive(Debug, Clone)]
pub struct Estimate {
    /// The system in scaled units.
    pub system: StateSpace,
    /// `S`, `n x f l`.
    pub state_map: DMatrix<f64>,
    /// `zeta Phi^+`, `(p+1) q x (n + r + l)`, `Phi = [xhat; u; ehat]`.
    pub state_regression: DMatrix<f64>,
    /// `zeta [xhat; (u)]^+`, `(p+1) q x (n (+ r))`.
    pub output_regression: DMatrix<f64>,
}

/// Least-squares recovery of the system matrices (33)-(34) for the given map to the state. All windows
/// take part: the state after the last one is a function of the data as well.
///
/// # Errors
/// [`IdentifyError::Linalg`] for a singular regression.
pub fn system_matrices(
    factor: &RFactor,
    varx: &Varx,
    decomposition: &Decomposition,
    state_map: DMatrix<f64>,
    sample_time: f64,
) -> Result<Estimate, IdentifyError> {
    let q = factor.channels();
    let n = state_map.nrows();
    let width = factor.past * q;
    let state = decomposition.state_of_past(&state_map);
    // The past window slides by one sample.
    let mut next = DMatrix::zeros(n, width + q);
    next.view_mut((0, q), (n, width)).copy_from(&state);
    state_regressions(factor, varx, &state, &next, state_map, sample_time)
}

/// `[A B K]` and `[C (D)]` by regression, for a state that is `state` (`n x p q`) times the past window and a next
/// state that is `next` (`n x (p+1) q`) times the past window with its next sample.
///
/// # Errors
/// [`IdentifyError::SingularRegression`] when the regressors are dependent.
pub(super) fn state_regressions(
    factor: &RFactor,
    varx: &Varx,
    state: &DMatrix<f64>,
    next: &DMatrix<f64>,
    state_map: DMatrix<f64>,
    sample_time: f64,
) -> Result<Estimate, IdentifyError> {
    let (q, inputs, outputs) = (factor.channels(), factor.inputs, factor.outputs);
    let n = state_map.nrows();
    let width = factor.past * q;
    let total = width + q;

    let mut phi = DMatrix::zeros(n + inputs + outputs, total);
    phi.view_mut((0, 0), (n, width)).copy_from(state);
    for i in 0..inputs {
        phi[(n + i, width + i)] = 1.0;
    }
    let coefficients = &varx.coefficients;
    let mut residual_rows = phi.view_mut((n + inputs, 0), (outputs, coefficients.ncols()));
    residual_rows.copy_from(&(-coefficients));
    for i in 0..outputs {
        phi[(n + inputs + i, width + inputs + i)] = 1.0;
    }

    let next_state = multiply_nt(&factor.r, next);
    let state_inverse = left_inverse(
        &multiply_nt(&factor.r, &phi),
        n + inputs,
        "states and inputs",
    )?;
    let abk = multiply(&state_inverse, &next_state).transpose();

    let rows = if varx.feedthrough { n + inputs } else { n };
    let of_output = multiply_nt(&factor.r, &phi.rows(0, rows).into_owned());
    let output_inverse = left_inverse(
        &of_output,
        rows,
        if varx.feedthrough {
            "states and inputs"
        } else {
            "states"
        },
    )?;
    let output_columns = factor.r.columns(total - outputs, outputs).into_owned();
    let cd = multiply(&output_inverse, &output_columns).transpose();

    // zeta Phi^+ = R' (R Phi')^+'.
    let regression = |inverse: &DMatrix<f64>| multiply(inverse, &factor.r).transpose();
    Ok(Estimate {
        system: StateSpace {
            a: abk.columns(0, n).into_owned(),
            b: abk.columns(n, inputs).into_owned(),
            k: abk.columns(n + inputs, outputs).into_owned(),
            c: cd.columns(0, n).into_owned(),
            d: if varx.feedthrough {
                cd.columns(n, inputs).into_owned()
            } else {
                DMatrix::zeros(outputs, inputs)
            },
            sample_time,
        },
        state_regression: regression(&state_inverse),
        output_regression: regression(&output_inverse),
        state_map,
    })
}

/// `M^+` of a tall matrix whose first `essential` columns must be independent. The others are residuals, which
/// vanish in a noise-free record: directions that they leave open get the minimum-norm solution (`K = 0`).
fn left_inverse(
    matrix: &DMatrix<f64>,
    essential: usize,
    what: &'static str,
) -> Result<DMatrix<f64>, IdentifyError> {
    let (q, r) = qr_thin(matrix);
    let largest = r.amax();
    let full = |columns: usize| {
        r.nrows() >= columns && (0..columns).all(|i| r[(i, i)].abs() > DEPENDENT * largest)
    };
    if full(r.ncols()) {
        return Ok(solve_upper(&r, &q.transpose()));
    }
    if !full(essential) {
        return Err(IdentifyError::SingularRegression { what });
    }
    Ok(pseudo_inverse(matrix, DEPENDENT)?)
}
