//! Errors of the parameters over many recordings.

use super::SAMPLES;
use super::methods::{Kind, Method, REFERENCE, bound, methods};
use crate::reproduce::data_factor::Failure;
use crate::reproduce::figure::{BarSeries, Bars, Row, Table, all_finite};
use crate::reproduce::monte_carlo_runs::{Study, successes};
use crate::reproduce::statistics::{mean, median, percentiles, root_mean_square};
use crate::reproduce::{ReproduceError, plain_numbers};
use crate::systems::KnudsenExample;

/// Bars beyond this many times tk-chol are cut: the paper's y-axes are "truncated" too.
const CUT: f64 = 3.0;

/// One method over all recordings; a number for each parameter.
#[derive(Debug, Clone)]
pub(super) struct Outcome {
    pub(super) method: Method,
    /// Root mean square error, (42) with its square root.
    pub(super) rms: Vec<f64>,
    /// Mean error.
    pub(super) bias: Vec<f64>,
    /// Median of the absolute error.
    pub(super) median: Vec<f64>,
    /// Shares of the sum of squared errors that the largest twentieth of the recordings brings.
    pub(super) tail: Vec<f64>,
    pub(super) failed: usize,
}

/// Errors of all methods on one system.
pub(super) struct Errors {
    pub(super) example: KnudsenExample,
    pub(super) outcomes: Vec<Outcome>,
    /// Square root of the Cramer-Rao bound, averaged over the recordings.
    pub(super) bound: Vec<f64>,
    /// Index of [`REFERENCE`].
    reference: usize,
}

impl Errors {
    /// Carries the study out.
    pub(super) fn carry_out(
        example: KnudsenExample,
        study: &Study,
        runs: usize,
    ) -> Result<Self, ReproduceError> {
        let methods = methods();
        let truth = example.parameters();
        let mut by_method: Vec<Vec<Result<Vec<f64>, Failure>>> =
            methods.iter().map(|_| Vec::with_capacity(runs)).collect();
        let run = |seed: u64| {
            let log = example.record(SAMPLES, seed);
            let found: Vec<_> = methods.iter().map(|m| (m.run)(&log, &example)).collect();
            (found, bound(&log, &example))
        };
        let mut bounds = Vec::with_capacity(runs);
        for (results, bound) in study.monte_carlo(runs, run) {
            bounds.push(bound);
            for (all, result) in by_method.iter_mut().zip(results) {
                all.push(result);
            }
        }
        let outcomes: Vec<Outcome> = methods
            .iter()
            .zip(by_method)
            .map(|(method, results)| {
                let (found, failed) = successes(method.name, results)?;
                Ok(outcome(*method, &found, &truth, failed))
            })
            .collect::<Result<_, ReproduceError>>()?;
        let reference = outcomes
            .iter()
            .position(|o| o.method.name == REFERENCE)
            .unwrap_or(0);
        let (bounds, _) = successes("the Cramer-Rao bound", bounds)?;
        let bound = (0..truth.len())
            .map(|k| mean(&bounds.iter().map(|b| b[k]).collect::<Vec<_>>()).sqrt())
            .collect();
        Ok(Self {
            example,
            outcomes,
            bound,
            reference,
        })
    }

    /// tk-chol.
    pub(super) fn reference(&self) -> &Outcome {
        &self.outcomes[self.reference]
    }

    /// The method of that name.
    pub(super) fn find(&self, name: &str) -> Option<&Outcome> {
        self.outcomes.iter().find(|o| o.method.name == name)
    }

    /// The subspace methods that the paper compares tk-chol with.
    pub(super) fn rivals(&self) -> impl Iterator<Item = &Outcome> {
        self.outcomes
            .iter()
            .filter(|o| o.method.kind == Kind::Subspace && o.method.name != REFERENCE)
    }

    /// Rms of a method relative to tk-chol.
    pub(super) fn relative(&self, of: &Outcome) -> Vec<f64> {
        let reference = &self.reference().rms;
        of.rms.iter().zip(reference).map(|(a, b)| a / b).collect()
    }

    /// Indices of the parameters `c1..cn, sigma^2`: "the focus is on" them.
    pub(super) fn stochastic(&self) -> std::ops::Range<usize> {
        let n = self.example.order();
        2 * n + 1..3 * n + 2
    }

    /// Indices of the parameters of `A(q)` and `B(q)`.
    pub(super) fn deterministic(&self) -> std::ops::Range<usize> {
        0..self.stochastic().start
    }

    /// The paper's bar chart.
    pub(super) fn bars(&self, title: &str) -> Bars {
        let series = self
            .outcomes
            .iter()
            .filter(|o| o.method.name != REFERENCE)
            .map(|o| BarSeries {
                name: o.method.name.to_owned(),
                values: all_finite(self.relative(o)),
            })
            .collect();
        Bars {
            id: "relative".to_owned(),
            title: title.to_owned(),
            caption: "The dashed line is tk-chol: shorter bars are better. Bars that are cut carry their value."
                .to_owned(),
            quantity: "rms error relative to tk-chol".to_owned(),
            reference: 1.0,
            cut: CUT,
            groups: self.example.parameter_names(),
            series,
        }
    }

    /// Rms of tk-chol beside the printed row, and of all methods relative to it.
    pub(super) fn tables(&self, runs: usize) -> Vec<Table> {
        let columns = self.example.parameter_names();
        let reference = self.reference();
        let printed = &self.example.printed_rms;
        let quotient = reference.rms.iter().zip(printed).map(|(a, b)| a / b);
        let table_1 = Table {
            id: "table-1".to_owned(),
            title: format!("Table 1, {}: tk-chol", self.example.name),
            caption: format!(
                "Root mean square errors over {runs} recordings of {SAMPLES} samples. Tail: share of the sum of squares \
                 that the worst twentieth of the recordings brings; a normal error has 0.27."
            ),
            rows_are: "Row".to_owned(),
            columns: columns.clone(),
            rows: vec![
                Row::found("true value", self.example.parameters()),
                Row::printed("rms as printed", printed.iter().copied()),
                Row::found("rms here", reference.rms.iter().copied()),
                Row::found("here / printed", quotient),
                Row::found("bias here", reference.bias.iter().copied()),
                Row::found(
                    "median absolute error here",
                    reference.median.iter().copied(),
                ),
                Row::found("tail", reference.tail.iter().copied()),
            ],
            digits: 3,
        };
        let rms = self
            .outcomes
            .iter()
            .map(|o| Row::found(o.method.name, o.rms.iter().copied()));
        let all = Table {
            id: "rms".to_owned(),
            title: "Root mean square errors".to_owned(),
            caption: "The bound is that of unbiased estimates at the truth; a biased one may stay below it.".to_owned(),
            rows_are: "Method".to_owned(),
            columns: columns.clone(),
            rows: std::iter::once(Row::printed("tk-chol as printed", printed.iter().copied()))
                .chain(rms)
                .collect(),
            digits: 3,
        };
        let relative = Table {
            id: "relative-rms".to_owned(),
            title: "Relative to tk-chol".to_owned(),
            caption: "Root mean square error over that of tk-chol; below one is better.".to_owned(),
            rows_are: "Method".to_owned(),
            columns,
            rows: self
                .outcomes
                .iter()
                .map(|o| Row::found(o.method.name, self.relative(o)))
                .collect(),
            digits: 3,
        };
        vec![table_1, all, relative]
    }

    /// Sentences on recordings that a method failed on.
    pub(super) fn failures(&self, runs: usize) -> Vec<String> {
        self.outcomes
            .iter()
            .filter_map(|o| plain_numbers::failures(o.method.name, o.failed, runs))
            .collect()
    }
}

fn outcome(method: Method, found: &[Vec<f64>], truth: &[f64], failed: usize) -> Outcome {
    let errors = |k: usize| -> Vec<f64> { found.iter().map(|theta| theta[k] - truth[k]).collect() };
    let of = |f: &dyn Fn(&[f64]) -> f64| (0..truth.len()).map(|k| f(&errors(k))).collect();
    Outcome {
        method,
        rms: of(&|e| root_mean_square(e.iter().copied())),
        bias: of(&|e| mean(e)),
        median: of(&|e| median(&e.iter().map(|v| v.abs()).collect::<Vec<_>>())),
        tail: of(&|e| tail(e)),
        failed,
    }
}

/// The share of the sum of squares that the largest twentieth of the values brings.
fn tail(errors: &[f64]) -> f64 {
    let squares: Vec<f64> = errors.iter().map(|e| e * e).collect();
    let [limit] = percentiles(&squares, [0.95]);
    let large: f64 = squares.iter().filter(|s| **s > limit).sum();
    large / squares.iter().sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tail_shows() {
        let mut errors = vec![1.0; 100];
        assert!(tail(&errors) < 0.06);
        errors[7] = 100.0;
        assert!(tail(&errors) > 0.98);
    }

    #[test]
    fn the_normal_tail_is_what_the_caption_says() {
        use rand::SeedableRng;
        use rand_distr::{Distribution, StandardNormal};
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(2);
        let errors: Vec<f64> = (0..200_000)
            .map(|_| StandardNormal.sample(&mut random))
            .collect();
        assert!((tail(&errors) - 0.27).abs() < 0.015, "{}", tail(&errors));
    }
}
