//! Optimised predictor-based subspace identification, from `R` alone.
//!
//! The paper works with matrices as long as the record; here every quantity is expressed through the
//! factor `R` of the data, which gives the same numbers (a test holds the two forms against each other)
//! at a cost that does not depend on the number of samples.

use nalgebra::DMatrix;

use super::varx::Varx;
use super::weighted::{WeightedSvd, in_users_units};
use crate::identify::IdentifyError;
use crate::linalg::{
    cholesky_upper, multiply, multiply_nt, pseudo_inverse, qr_thin, solve_upper,
    solve_upper_transposed,
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
    /// Of `W Gamma K Z`.
    pub svd: WeightedSvd,
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
        Weight::Identity => in_users_units(&factor.scale[factor.inputs..], future),
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
    Ok(Decomposition {
        gamma_k,
        svd: WeightedSvd::new(&weight_matrix, &product, factor.columns)?,
    })
}

impl Decomposition {
    /// `S [Gamma K]`, `n x p q`: the state as a function of the past window.
    fn state_of_past(&self, state_map: &DMatrix<f64>) -> DMatrix<f64> {
        multiply(state_map, &self.gamma_k)
    }
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
