//! The methods of table 2 that run here, and what this crate adds to them: one recording in, ARMAX parameters out.

use crate::identify::baselines::{BaselineEstimate, ProjectionWeight, n4sid, subid};
use crate::identify::knudsen::{Decomposition, Regression, ResidualStep, knudsen};
use crate::identify::pem::{Form, STEPS, prediction_error_method};
use crate::identify::varx;
use crate::log::Log;
use crate::model::StateSpace;
use crate::reproduce::data::{Failure, raw_factor};
use crate::systems::{KnudsenExample, armax_parameters};

/// What a method is in the comparison.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// A subspace method with the paper's horizons: "only the first four are directly comparable".
    Subspace,
    /// A subspace method that chooses its horizons.
    Automatic,
    /// A prediction-error method.
    PredictionError,
    /// Not in the paper.
    Added,
}

/// A method of the study.
#[derive(Debug, Clone, Copy)]
pub(super) struct Method {
    pub(super) name: &'static str,
    pub(super) kind: Kind,
    /// Parameters of a recording, in the order of table 1.
    pub(super) run: fn(&Log, &KnudsenExample) -> Result<Vec<f64>, Failure>,
}

/// The method that the paper's figures are relative to.
pub(super) const REFERENCE: &str = "tk-chol";
/// Past horizon of tk-chol with a longer past.
pub(super) const LONG_PAST: usize = 20;

/// The name of that method.
pub(super) const WITH_LONG_PAST: &str = "tk-chol, i = 20";
/// The same with one Gauss-Newton step of the prediction error.
pub(super) const WITH_STEP: &str = "tk-chol, i = 20, one step";
/// Longest past that the automatic choice looks at: beyond it 500 samples have nothing more to say.
const LONGEST_PAST: usize = 15;

/// All of them; [`REFERENCE`] is among them.
pub(super) fn methods() -> Vec<Method> {
    use Kind::{Added, Automatic, PredictionError, Subspace};
    use ProjectionWeight::{Cva, Moesp};
    let method = |name, kind, run| Method { name, kind, run };
    vec![
        method(REFERENCE, Subspace, tk_chol),
        method("tk", Subspace, |log, example| {
            let horizon = example.horizon;
            finished(&residual_step(
                log,
                example,
                ResidualStep::FirstColumn,
                horizon,
                horizon,
            )?)
        }),
        method("subid, SV", Subspace, |log, example| {
            by_subid(log, example, Moesp)
        }),
        method("subid, CVA", Subspace, |log, example| {
            by_subid(log, example, Cva)
        }),
        method("n4sid, MOESP", Subspace, |log, example| {
            by_n4sid(log, example, Moesp, example.horizon, example.horizon)
        }),
        method("n4sid, CVA", Subspace, |log, example| {
            by_n4sid(log, example, Cva, example.horizon, example.horizon)
        }),
        method("n4sid, automatic", Automatic, |log, example| {
            let past = automatic_past(log)?.max(example.horizon);
            by_n4sid(log, example, Cva, past, past)
        }),
        method("prediction error", PredictionError, |log, example| {
            let horizon = example.horizon;
            let start = residual_step(log, example, ResidualStep::Cholesky, horizon, horizon)?;
            prediction_error(log, &start.0, STEPS)
        }),
        method(WITH_LONG_PAST, Added, |log, example| {
            finished(&with_long_past(log, example)?)
        }),
        method(WITH_STEP, Added, |log, example| {
            prediction_error(log, &with_long_past(log, example)?.0, 1)
        }),
    ]
}

/// A model with its innovation variance.
type Found = (StateSpace, f64);

fn tk_chol(log: &Log, example: &KnudsenExample) -> Result<Vec<f64>, Failure> {
    let horizon = example.horizon;
    finished(&residual_step(
        log,
        example,
        ResidualStep::Cholesky,
        horizon,
        horizon,
    )?)
}

fn with_long_past(log: &Log, example: &KnudsenExample) -> Result<Found, Failure> {
    residual_step(
        log,
        example,
        ResidualStep::Cholesky,
        LONG_PAST,
        example.order() + 2,
    )
}

fn regression(log: &Log, past: usize, future: usize) -> Result<Regression, Failure> {
    let factor = raw_factor(log, past + future - 1)?;
    Regression::new(&factor, past).map_err(|e| e.to_string())
}

/// Knudsen's estimate with past `past` and future `future`.
fn residual_step(
    log: &Log,
    example: &KnudsenExample,
    step: ResidualStep,
    past: usize,
    future: usize,
) -> Result<Found, Failure> {
    let regression = regression(log, past, future)?;
    let decomposition = Decomposition::new(&regression).map_err(|e| e.to_string())?;
    let found = knudsen(
        &regression,
        &decomposition,
        example.order(),
        true,
        step,
        log.sample_time,
    )
    .map_err(|e| e.to_string())?;
    Ok((found.system, found.innovation_covariance[(0, 0)]))
}

fn by_subid(
    log: &Log,
    example: &KnudsenExample,
    weight: ProjectionWeight,
) -> Result<Vec<f64>, Failure> {
    let regression = regression(log, example.horizon, example.horizon)?;
    let found = subid(&regression, example.order(), weight, true, log.sample_time);
    baseline(found.map_err(|e| e.to_string())?)
}

fn by_n4sid(
    log: &Log,
    example: &KnudsenExample,
    weight: ProjectionWeight,
    past: usize,
    future: usize,
) -> Result<Vec<f64>, Failure> {
    let regression = regression(log, past, future)?;
    let signals = signals(log);
    let found = n4sid(
        &regression,
        &[&signals],
        example.order(),
        weight,
        true,
        log.sample_time,
    );
    baseline(found.map_err(|e| e.to_string())?)
}

fn baseline(found: BaselineEstimate) -> Result<Vec<f64>, Failure> {
    finished(&(found.system, found.innovation_covariance[(0, 0)]))
}

/// The past window of the vector ARX model with the smallest Akaike criterion, as Matlab's n4sid chooses it.
fn automatic_past(log: &Log) -> Result<usize, Failure> {
    let longest = raw_factor(log, LONGEST_PAST)?;
    let mut best = (f64::INFINITY, 1);
    for past in 1..=LONGEST_PAST {
        let model = varx(&longest.shortened(past), true).map_err(|e| e.to_string())?;
        let samples = model.columns as f64;
        let criterion = samples * (model.sum_of_squares[(0, 0)] / samples).ln()
            + 2.0 * model.regressors() as f64;
        if criterion < best.0 {
            best = (criterion, past);
        }
    }
    Ok(best.1)
}

fn signals(log: &Log) -> Vec<Vec<f64>> {
    log.input_data
        .iter()
        .chain(&log.output_data)
        .cloned()
        .collect()
}

fn prediction_error(log: &Log, start: &StateSpace, steps: usize) -> Result<Vec<f64>, Failure> {
    let signals = signals(log);
    let found = prediction_error_method(start, &[&signals], true, Form::Armax, steps)
        .map_err(|e| e.to_string())?;
    let variance = found.innovation_covariance[(0, 0)];
    match found.armax {
        Some((armax, _)) => Ok(armax_parameters(&armax, variance)),
        None => finished(&(found.system, variance)),
    }
}

/// The Cramer-Rao bound of a recording: variances of an efficient estimate at the truth, initial state unknown. That
/// of `sigma^2` is `2 sigma^4 / N`.
pub(super) fn bound(log: &Log, example: &KnudsenExample) -> Result<Vec<f64>, Failure> {
    let signals = signals(log);
    let found = prediction_error_method(&example.system.system, &[&signals], true, Form::Armax, 0)
        .map_err(|e| e.to_string())?;
    let (_, covariance) = found.armax.ok_or("no polynomials")?;
    // The information at the truth is scaled with the estimated variance of the innovations; the true one is known.
    let scale = example.variance / found.innovation_covariance[(0, 0)];
    let mut variances: Vec<f64> = covariance.diagonal().iter().map(|v| v * scale).collect();
    variances.push(2.0 * example.variance.powi(2) / log.samples() as f64);
    Ok(variances)
}

/// The parameters of a model with one input and one output.
fn finished((system, variance): &Found) -> Result<Vec<f64>, Failure> {
    let armax = system
        .armax()
        .map_err(|e| e.to_string())?
        .ok_or("not one input and one output")?;
    Ok(armax_parameters(&armax, *variance))
}
