//! The methods of table 2 that run here, and what this crate adds to them: one recording in, ARMAX parameters out.

use crate::identify::knudsen::{Decomposition, Regression, ResidualStep, knudsen};
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

/// All of them; [`REFERENCE`] is among them.
pub(super) fn methods() -> Vec<Method> {
    let method = |name, kind, run| Method { name, kind, run };
    vec![
        method("tk", Kind::Subspace, |log, example| {
            residual_step(
                log,
                example,
                ResidualStep::FirstColumn,
                example.horizon,
                example.horizon,
            )
        }),
        method(REFERENCE, Kind::Subspace, |log, example| {
            residual_step(
                log,
                example,
                ResidualStep::Cholesky,
                example.horizon,
                example.horizon,
            )
        }),
        method("tk-chol, i = 20", Kind::Added, |log, example| {
            let future = example.order() + 2;
            residual_step(log, example, ResidualStep::Cholesky, LONG_PAST, future)
        }),
    ]
}

/// Knudsen's estimate with past `past` and future `future`.
fn residual_step(
    log: &Log,
    example: &KnudsenExample,
    step: ResidualStep,
    past: usize,
    future: usize,
) -> Result<Vec<f64>, Failure> {
    let factor = raw_factor(log, past + future - 1)?;
    let regression = Regression::new(&factor, past).map_err(|e| e.to_string())?;
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
    parameters(&found.system, found.innovation_covariance[(0, 0)])
}

/// The parameters of a model with one input and one output.
fn parameters(system: &StateSpace, variance: f64) -> Result<Vec<f64>, Failure> {
    let armax = system
        .armax()
        .map_err(|e| e.to_string())?
        .ok_or("not one input and one output")?;
    Ok(armax_parameters(&armax, variance))
}
