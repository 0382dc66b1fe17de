//! The methods of table 2 of Knudsen (2001) on one recording, as ARMAX parameters.

use super::super::horizon;
use super::super::knudsen::{
    Decomposition, NoiseModel, Regression, ResidualStep, knudsen, minimum_phase,
};
use super::super::pem::{Form, STEPS, prediction_error_method};
use super::{BaselineEstimate, ProjectionWeight, n4sid, subid};
use crate::identify::IdentifyError;
use crate::log::Log;
use crate::model::StateSpace;
use crate::moments::{PanelQr, RFactor, Trend};
use crate::systems::armax_parameters;

/// Past window of the polished tk-chol: long enough to take the bias out of the noise model, measured on the paper's
/// systems.
const LONG_PAST: usize = 20;
/// Gauss-Newton steps of the polished tk-chol, as in `--method knudsen --polish always`.
const POLISH_STEPS: usize = 2;
/// Samples for each regressor of the longest window that Akaike's criterion chooses from.
const SAMPLES_PER_REGRESSOR: usize = 10;

/// A method of the comparison.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TableTwo {
    /// Knudsen, first block column.
    Tk,
    /// Knudsen, Cholesky factor.
    TkChol,
    /// Robust combined algorithm, its own weight (SV).
    SubidSv,
    /// The same with canonical variates.
    SubidCva,
    /// After Ljung, canonical variates.
    N4sidCva,
    /// After Ljung, MOESP weight.
    N4sidMoesp,
    /// After Ljung, canonical variates, both horizons by Akaike's criterion of the ARX model (our rule: at least
    /// `n + 2`).
    N4sidAuto,
    /// Prediction error method, ARMAX of the same orders, from tk-chol.
    Pem,
    /// tk-chol with `i = 20`, `h = n + 2`, and two Gauss-Newton steps of the prediction error method: not in the
    /// paper.
    Polished,
}

impl TableTwo {
    /// Every method, in the order of the table.
    pub const ALL: [Self; 9] = [
        Self::Tk,
        Self::TkChol,
        Self::SubidSv,
        Self::SubidCva,
        Self::N4sidCva,
        Self::N4sidMoesp,
        Self::N4sidAuto,
        Self::Pem,
        Self::Polished,
    ];

    /// Short name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tk => "tk",
            Self::TkChol => "tk-chol",
            Self::SubidSv => "subid SV",
            Self::SubidCva => "subid CVA",
            Self::N4sidCva => "n4sid-like CVA",
            Self::N4sidMoesp => "n4sid-like MOESP",
            Self::N4sidAuto => "n4sid-like auto",
            Self::Pem => "PEM",
            Self::Polished => "tk-chol polished",
        }
    }

    /// The model of a recording with one input and one output, nothing removed from the channels, noise model of
    /// minimum phase; `horizon` is the paper's `h = i`.
    ///
    /// # Errors
    /// [`IdentifyError`] when the recording does not allow the model.
    pub fn estimate(
        self,
        log: &Log,
        order: usize,
        horizon: usize,
    ) -> Result<(StateSpace, f64), IdentifyError> {
        let signals: Vec<Vec<f64>> = log
            .input_data
            .iter()
            .chain(&log.output_data)
            .cloned()
            .collect();
        let inputs = log.input_data.len();
        let time = log.sample_time;
        let square = |size: usize| Regression::new(&factor(&signals, inputs, 2 * size - 1), size);
        let chol = |past: usize, future: usize, step: ResidualStep| {
            let regression = Regression::new(&factor(&signals, inputs, past + future - 1), past)?;
            let decomposition = Decomposition::new(&regression)?;
            let made = knudsen(&regression, &decomposition, order, true, step, time)?;
            Ok::<_, IdentifyError>((made.system, made.innovation_covariance[(0, 0)]))
        };
        let improved = |start: &StateSpace, steps: usize| {
            let made = prediction_error_method(start, &[&signals], true, Form::Armax, steps)?;
            Ok((made.system, made.innovation_covariance[(0, 0)]))
        };
        let classical = |estimate: BaselineEstimate| {
            let BaselineEstimate {
                system,
                innovation_covariance,
                ..
            } = estimate;
            let noise = NoiseModel {
                k: system.k.clone(),
                innovation_covariance,
            };
            let (noise, _) = minimum_phase(&system.a, &system.c, noise);
            let variance = noise.innovation_covariance[(0, 0)];
            let k = noise.k;
            Ok((StateSpace { k, ..system }, variance))
        };
        let ljung = |size: usize, weight: ProjectionWeight| {
            let regression = square(size)?;
            classical(n4sid(&regression, &[&signals], order, weight, true, time)?)
        };
        let book = |weight: ProjectionWeight| {
            classical(subid(&square(horizon)?, order, weight, true, time)?)
        };
        match self {
            Self::Tk => chol(horizon, horizon, ResidualStep::FirstColumn),
            Self::TkChol => chol(horizon, horizon, ResidualStep::Cholesky),
            Self::SubidSv => book(ProjectionWeight::Moesp),
            Self::SubidCva => book(ProjectionWeight::Cva),
            Self::N4sidCva => ljung(horizon, ProjectionWeight::Cva),
            Self::N4sidMoesp => ljung(horizon, ProjectionWeight::Moesp),
            Self::N4sidAuto => {
                let longest = log.samples() / (SAMPLES_PER_REGRESSOR * signals.len() + 1);
                let criterion = horizon::akaike(&factor(&signals, inputs, longest.max(1)), true);
                let best = horizon::best_past(&criterion).unwrap_or(horizon);
                ljung(best.max(order + 2), ProjectionWeight::Cva)
            }
            Self::Pem => {
                let (start, _) = chol(horizon, horizon, ResidualStep::Cholesky)?;
                improved(&start, STEPS)
            }
            Self::Polished => {
                let (start, _) = chol(LONG_PAST, order + 2, ResidualStep::Cholesky)?;
                improved(&start, POLISH_STEPS)
            }
        }
    }

    /// The parameters of [`TableTwo::estimate`] in the order of table 1, `a1..an, b0..bn, c1..cn, sigma^2`.
    ///
    /// # Errors
    /// As [`TableTwo::estimate`].
    pub fn parameters(
        self,
        log: &Log,
        order: usize,
        horizon: usize,
    ) -> Result<Vec<f64>, IdentifyError> {
        let (system, variance) = self.estimate(log, order, horizon)?;
        let armax = system
            .armax()
            .map_err(|error| IdentifyError::Option(error.to_string()))?
            .ok_or_else(|| {
                IdentifyError::Option(
                    "the comparison is of models with one input and one output".to_owned(),
                )
            })?;
        Ok(armax_parameters(&armax, variance))
    }
}

/// The data factor of signals as they are.
fn factor(signals: &[Vec<f64>], inputs: usize, window: usize) -> RFactor {
    let scale = vec![1.0; signals.len()];
    let mut panels = PanelQr::new(window, &scale);
    panels.start_experiment(&Trend::zero(signals.len()));
    let columns: Vec<&[f64]> = signals.iter().map(Vec::as_slice).collect();
    panels.push(&columns);
    let (r, columns) = panels.finish();
    RFactor::from_panels(r, columns, inputs, &scale)
}
