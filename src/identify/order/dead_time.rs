//! Dead time of the inputs: samples over which an input does nothing yet.
//!
//! A dead time of `d` samples is `d` states for each input in a state-space model, and none where the input is shifted. In
//! the vector ARX model it is `d` leading coefficients of the input that are zero, whatever the noise and also in closed
//! loop, because a predictor of the form `H^-1 G u + (1 - H^-1) y` has the dead time of `G`. Leading coefficients that
//! are jointly insignificant propose a dead time; the model of the shifted input decides by Schwarz's criterion.

use nalgebra::DMatrix;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::evidence::{OrderEvidence, REFEREE_LEVEL};
use crate::identify::subspace::Varx;
use crate::linalg::{cholesky_upper, solve_upper_transposed};

/// Significance of the leading coefficients from which a dead time has ended.
pub(crate) const LEVEL: f64 = 0.01;
/// Leading lags of each input whose coefficients are jointly zero at [`LEVEL`]; 0 for an input without any significant one.
fn proposed(varx: &Varx, inputs: usize) -> Vec<usize> {
    let none = vec![0; inputs];
    if varx.dependent || varx.feedthrough {
        return none;
    }
    let Ok(upper) = cholesky_upper(&varx.innovation_covariance) else {
        return none;
    };
    (0..inputs)
        .map(|input| leading_zeros(varx, &upper, input).unwrap_or(0))
        .collect()
}

/// Wald's test of the first lag, of the first two, and so on, until it rejects.
fn leading_zeros(varx: &Varx, upper: &DMatrix<f64>, input: usize) -> Option<usize> {
    let (m, l) = (varx.regressors(), varx.coefficients.nrows());
    let q = m / varx.past;
    // Coefficients and columns of `R^-T`, whose products are their covariance, in units of the innovations.
    let mut coefficients = DMatrix::zeros(0, l);
    let mut factors = DMatrix::zeros(m, 0);
    for lag in 1..=varx.past {
        let column = (varx.past - lag) * q + input;
        let mut unit = DMatrix::zeros(m, 1);
        unit[(column, 0)] = 1.0;
        let whitened =
            solve_upper_transposed(upper, &varx.coefficients.columns(column, 1).into_owned());
        coefficients = coefficients.insert_row(lag - 1, 0.0);
        coefficients
            .row_mut(lag - 1)
            .copy_from(&whitened.transpose());
        factors = factors.insert_column(lag - 1, 0.0);
        factors
            .column_mut(lag - 1)
            .copy_from(&solve_upper_transposed(&varx.regressor_factor, &unit));
        let covariance = factors.tr_mul(&factors);
        let statistic = coefficients
            .tr_mul(&covariance.cholesky()?.solve(&coefficients))
            .trace();
        let p_value = ChiSquared::new((lag * l) as f64).ok()?.sf(statistic);
        if p_value < LEVEL {
            return Some(lag - 1);
        }
    }
    None
}

/// What an identification says about the dead time of its inputs.
#[derive(Debug, Clone)]
pub(crate) struct Evidence {
    /// Leading lags of each input that do nothing.
    pub(crate) proposed: Vec<usize>,
    /// Schwarz's criterion of the model against its vector ARX model, where it was computed.
    schwarz: Option<f64>,
    /// Whether the chi-square test accepts the order.
    pub(crate) accepted: bool,
    /// `log det` of the innovation covariance of the vector ARX model in the user's units, by maximum likelihood.
    log_determinant: f64,
    /// Windows of the vector ARX model.
    windows: usize,
}

impl Evidence {
    /// Of a model with this evidence for its order; `scale` are the divisors of the outputs.
    pub(crate) fn new(
        varx: &Varx,
        order: Option<&OrderEvidence>,
        inputs: usize,
        scale: &[f64],
    ) -> Self {
        let likeliest = &varx.sum_of_squares / varx.columns as f64;
        let half = cholesky_upper(&likeliest).map_or(f64::NEG_INFINITY, |upper| {
            upper.diagonal().iter().map(|d| d.ln()).sum::<f64>()
        });
        Self {
            proposed: proposed(varx, inputs),
            schwarz: order.and_then(|e| e.schwarz),
            accepted: order
                .and_then(|e| e.p_value)
                .is_none_or(|p| p >= REFEREE_LEVEL),
            log_determinant: 2.0 * (half + scale.iter().map(|s| s.ln()).sum::<f64>()),
            windows: varx.columns,
        }
    }

    /// By how much Schwarz's criterion is smaller than that of `other`; `None` where one of them is not known.
    pub(crate) fn gain_over(&self, other: &Self) -> Option<f64> {
        let windows = self.windows.min(other.windows) as f64;
        let criterion = |e: &Self| Some(e.schwarz? + windows * e.log_determinant);
        Some(criterion(other)? - criterion(self)?).filter(|gain| gain.is_finite())
    }
}

#[cfg(test)]
#[path = "tests/dead_time_tests.rs"]
mod tests;
