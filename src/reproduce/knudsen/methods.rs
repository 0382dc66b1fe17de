//! The methods of table 2 that run here, and what this crate adds to them: one recording in, ARMAX parameters out.

use crate::identify::baselines::TableTwo;
use crate::identify::knudsen::{Decomposition, Regression, ResidualStep, knudsen};
use crate::identify::pem::{Form, prediction_error_method};
use crate::log::Log;
use crate::reproduce::data_factor::{Failure, raw_factor};
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
/// tk-chol with a longer past.
pub(super) const WITH_LONG_PAST: &str = "tk-chol, i = 20";
/// The same with two Gauss-Newton steps of the prediction error.
pub(super) const WITH_STEPS: &str = "tk-chol, i = 20, two steps";
/// The n4sid-like method with fixed horizons that its automatic form is held against.
pub(super) const FIXED_HORIZONS: &str = "n4sid-like CVA";
/// Past horizon of [`WITH_LONG_PAST`].
const LONG_PAST: usize = 20;

/// A method of table 2 as a function of recording and system.
macro_rules! of_table {
    ($method:ident) => {
        |log, example| table_two(TableTwo::$method, log, example)
    };
}

/// All of them; [`REFERENCE`] is among them.
pub(super) fn methods() -> Vec<Method> {
    use Kind::{Added, Automatic, PredictionError, Subspace};
    let method = |name, kind, run| Method { name, kind, run };
    vec![
        method(REFERENCE, Subspace, of_table!(TkChol)),
        method("tk", Subspace, of_table!(Tk)),
        method("subid SV", Subspace, of_table!(SubidSv)),
        method("subid CVA", Subspace, of_table!(SubidCva)),
        method("n4sid-like MOESP", Subspace, of_table!(N4sidMoesp)),
        method(FIXED_HORIZONS, Subspace, of_table!(N4sidCva)),
        method("n4sid-like, automatic", Automatic, of_table!(N4sidAuto)),
        method("prediction error", PredictionError, of_table!(Pem)),
        method(WITH_LONG_PAST, Added, with_long_past),
        method(WITH_STEPS, Added, of_table!(Polished)),
    ]
}

fn table_two(method: TableTwo, log: &Log, example: &KnudsenExample) -> Result<Vec<f64>, Failure> {
    method
        .parameters(log, example.order(), example.horizon)
        .map_err(|e| e.to_string())
}

fn with_long_past(log: &Log, example: &KnudsenExample) -> Result<Vec<f64>, Failure> {
    let future = example.order() + 2;
    let factor = raw_factor(log, LONG_PAST + future - 1)?;
    let estimate = || {
        let regression = Regression::new(&factor, LONG_PAST)?;
        let decomposition = Decomposition::new(&regression)?;
        knudsen(
            &regression,
            &decomposition,
            example.order(),
            true,
            ResidualStep::Cholesky,
            log.sample_time,
        )
    };
    let found = estimate().map_err(|e| e.to_string())?;
    let armax = found
        .system
        .armax()
        .map_err(|e| e.to_string())?
        .ok_or("not one input and one output")?;
    Ok(armax_parameters(
        &armax,
        found.innovation_covariance[(0, 0)],
    ))
}

/// The Cramer-Rao bound of a recording: variances of an efficient estimate at the truth, initial state unknown. That
/// of `sigma^2` is `2 sigma^4 / N`.
pub(super) fn bound(log: &Log, example: &KnudsenExample) -> Result<Vec<f64>, Failure> {
    let signals: Vec<Vec<f64>> = log
        .input_data
        .iter()
        .chain(&log.output_data)
        .cloned()
        .collect();
    let found = prediction_error_method(&example.system.system, &[&signals], true, Form::Armax, 0)
        .map_err(|e| e.to_string())?;
    let (_, covariance) = found.armax.ok_or("no polynomials")?;
    // The information at the truth is scaled with the estimated variance of the innovations; the true one is known.
    let scale = example.variance / found.innovation_covariance[(0, 0)];
    let mut variances: Vec<f64> = covariance.diagonal().iter().map(|v| v * scale).collect();
    variances.push(2.0 * example.variance.powi(2) / log.samples() as f64);
    Ok(variances)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::systems::knudsen_armax;

    /// The bound of the notes behind this crate (`knudsen.md`, section 6), found with other software.
    #[test]
    fn the_bound_is_that_of_the_notes() {
        let example = knudsen_armax();
        let count = 40;
        let mut sum = vec![0.0; example.parameters().len()];
        for seed in 0..count {
            let log = example.record(500, seed);
            for (sum, variance) in sum.iter_mut().zip(bound(&log, &example).unwrap()) {
                *sum += variance / count as f64;
            }
        }
        let notes = [
            0.00586, 0.00538, 0.00319, 0.00604, 0.00417, 0.0311, 0.0309, 1.90e-4,
        ];
        for (variance, expected) in sum.iter().zip(notes) {
            assert!(
                (variance.sqrt() / expected - 1.0).abs() < 0.05,
                "{} {expected}",
                variance.sqrt()
            );
        }
    }
}
