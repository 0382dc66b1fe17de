//! Classical subspace methods, to compare with: those of table 2 of Knudsen (2001) that have a description.
//!
//! | file | method | source |
//! |---|---|---|
//! | `subid` | robust combined algorithm | van Overschee & De Moor (1996), figure 4.8 |
//! | `table_two` | all methods of the table on one recording | Knudsen (2001), section 6 |
//! | `n4sid` | shift of the observability matrix, inputs by simulation, noise by a Riccati equation | Ljung (1999), section 10.6 |
//!
//! Both need inputs that do not depend on past outputs. `n4sid` follows the book; it is not the MATLAB function, and
//! says nothing about it.

mod n4sid;
mod subid;
mod table_two;

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::identify_error::IdentifyError;
use super::knudsen::Regression;
use crate::linalg::{
    LinalgError, multiply, multiply_tn, qr_r, qr_thin, solve_upper_transposed, stationary_filter,
    svd_thin,
};
use crate::model::StateSpace;

pub(crate) use n4sid::n4sid;
pub(crate) use subid::subid;
pub use table_two::TableTwo;

/// Weights of the singular value decomposition of the oblique projection.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "lowercase")]
pub(crate) enum ProjectionWeight {
    /// `W1 = I`, `W2 = Pi` (perpendicular to the future inputs): MOESP, and the default of subid (there called SV).
    #[default]
    Moesp,
    /// `W1 = (Y_f Pi Y_f')^(-1/2)`, `W2 = Pi`: canonical variates.
    Cva,
}

/// A model with its noise, in the units of the regression.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct BaselineEstimate {
    /// The system.
    pub(crate) system: StateSpace,
    /// Covariance of the innovations.
    pub(crate) innovation_covariance: DMatrix<f64>,
    /// Singular values of the weighted projection.
    pub(crate) singular_values: Vec<f64>,
}

/// `Gamma_h` of order `n` from the weighted oblique projection `W1 Theta_p W_p W2`, with the singular values.
fn weighted_observability(
    regression: &Regression,
    order: usize,
    weight: ProjectionWeight,
) -> Result<(DMatrix<f64>, Vec<f64>), IdentifyError> {
    let largest = (regression.future - 1) * regression.outputs;
    if order == 0 || order > largest {
        return Err(IdentifyError::Order {
            order,
            largest,
            reason: format!(
                "a future window of {} samples allows no more",
                regression.future
            ),
        });
    }
    let factor = &regression.factor;
    let (past_rows, regressors) = (regression.past_rows(), regression.regressors());
    let outputs = regression.future * regression.outputs;
    // In the coordinates of the factor, Z spans the first ones.
    let inputs = factor
        .view((0, past_rows), (regressors, regressors - past_rows))
        .into_owned();
    let basis = qr_thin(&inputs).0;
    let perpendicular = |m: &DMatrix<f64>| m - multiply(&basis, &multiply_tn(&basis, m));
    let past = perpendicular(&factor.view((0, 0), (regressors, past_rows)).into_owned());
    let product = multiply(&regression.past_coefficients(), &past.transpose());
    let root = match weight {
        ProjectionWeight::Moesp => DMatrix::identity(outputs, outputs),
        ProjectionWeight::Cva => {
            let explained = factor
                .view((0, regressors), (regressors, outputs))
                .into_owned();
            let rest = factor
                .view((regressors, regressors), (outputs, outputs))
                .into_owned();
            let mut stacked = DMatrix::zeros(regressors + outputs, outputs);
            stacked
                .rows_mut(0, regressors)
                .copy_from(&perpendicular(&explained));
            stacked.rows_mut(regressors, outputs).copy_from(&rest);
            // Y_f Pi Y_f' = C' C: W1 = C'^-1, and W1^-1 = C'.
            qr_r(&stacked).transpose()
        }
    };
    let weighted = match weight {
        ProjectionWeight::Moesp => product,
        ProjectionWeight::Cva => solve_upper_transposed(&root.transpose(), &product),
    };
    let svd = svd_thin(&weighted)?;
    let mut left = svd.u.columns(0, order).into_owned();
    for (j, mut column) in left.column_iter_mut().enumerate() {
        // The sign of a singular vector is arbitrary: fix it, so that results are reproducible.
        if column[column.icamax()] < 0.0 {
            column.neg_mut();
        }
        column.scale_mut(svd.values[j].sqrt());
    }
    Ok((multiply(&root, &left), svd.values.iter().copied().collect()))
}

/// `K` and the innovation covariance from the joint covariance of the residuals of both equations (`n + l` square).
/// Without a stabilising solution, or with too little noise for one, `K = S R^-1`, and none at all without noise.
fn noise_model(
    a: &DMatrix<f64>,
    c: &DMatrix<f64>,
    covariance: &DMatrix<f64>,
) -> Result<(DMatrix<f64>, DMatrix<f64>), LinalgError> {
    let (l, n) = c.shape();
    let q = covariance.view((0, 0), (n, n)).into_owned();
    let s = covariance.view((0, n), (n, l)).into_owned();
    let r = covariance.view((n, n), (l, l)).into_owned();
    if let Ok(filter) = stationary_filter(a, c, &q, &r, &s) {
        return Ok((filter.gain, filter.innovation_covariance));
    }
    match r.clone().try_inverse() {
        Some(inverse) => Ok((s * inverse, r)),
        None => Ok((DMatrix::zeros(n, l), r)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::moments::RFactor;
    use crate::systems;

    /// Without process noise the input response is found exactly, whatever the weight.
    #[test]
    fn both_find_a_noise_free_system() {
        let mut example = systems::knudsen_armax();
        // Hardly any noise: the projections stay of full rank, as both methods need.
        example.system.innovation_covariance.fill(1e-18);
        let log = example.record(400, 3);
        let window = 7;
        let rows = log.samples() - window;
        let stacked = DMatrix::from_fn(rows, 2 * (window + 1), |k, column| {
            if column % 2 == 0 {
                log.input_data[0][k + column / 2]
            } else {
                log.output_data[0][k + column / 2]
            }
        });
        let factor = RFactor::from_panels(crate::linalg::qr_r(&stacked), rows, 1, &[1.0, 1.0]);
        let regression = Regression::new(&factor, 4).unwrap();
        let signals = [log.input_data[0].clone(), log.output_data[0].clone()];
        let truth = example.system.system.impulse_response(10);
        for weight in [ProjectionWeight::Moesp, ProjectionWeight::Cva] {
            let found = [
                subid(&regression, 2, weight, true, 1.0).unwrap(),
                n4sid(&regression, &[&signals], 2, weight, true, 1.0).unwrap(),
            ];
            for (which, estimate) in found.iter().enumerate() {
                for (t, f) in truth.iter().zip(estimate.system.impulse_response(10)) {
                    assert!((t - &f).amax() < 1e-5, "{which} {weight:?}: {t} {f}");
                }
                assert!(estimate.innovation_covariance[(0, 0)] < 1e-12);
            }
        }
    }

    #[test]
    fn orders_beyond_the_window_are_refused() {
        let log = systems::knudsen_armax().record(300, 1);
        let rows = 300 - 3;
        let stacked = DMatrix::from_fn(rows, 8, |k, column| {
            if column % 2 == 0 {
                log.input_data[0][k + column / 2]
            } else {
                log.output_data[0][k + column / 2]
            }
        });
        let factor = RFactor::from_panels(crate::linalg::qr_r(&stacked), rows, 1, &[1.0, 1.0]);
        let regression = Regression::new(&factor, 2).unwrap();
        assert!(subid(&regression, 2, ProjectionWeight::Moesp, true, 1.0).is_err());
        assert!(subid(&regression, 0, ProjectionWeight::Moesp, true, 1.0).is_err());
    }
}
