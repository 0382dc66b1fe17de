//! Estimated variances of many runs against the true asymptotic variance.

use num_complex::Complex64;

use super::algorithm::{Algorithm, Failure, Found, Windows, algorithms};
use crate::reproduce::figure::{Curve, Figure, Panel, Quantity, Role, Row, Table};
use crate::reproduce::monte_carlo_runs::{Study, successes};
use crate::reproduce::statistics::{logarithmic_grid, mean, percentiles};
use crate::reproduce::{ReproduceError, plain_numbers};
use crate::systems::ClosedLoop;

/// Points between two of the eight frequencies at which numbers are given.
const REFINED: usize = 5;
/// Number of frequencies at which numbers are given.
const GIVEN: usize = 8;
/// Lowest and highest frequency, rad/sample.
const ENDS: (f64, f64) = (0.02, 3.0);

/// A study of one closed loop.
pub(super) struct Plan {
    pub(super) plant: ClosedLoop,
    pub(super) windows: Windows,
    /// Frequencies of the figure; every [`REFINED`]-th of them is one at which numbers are given.
    pub(super) grid: Vec<f64>,
}

/// One algorithm over all runs; everything at the frequencies of the grid.
#[derive(Debug, Clone)]
pub(super) struct Outcome {
    pub(super) algorithm: Algorithm,
    /// True asymptotic variance of the response, divided by the number of columns.
    pub(super) truth: Vec<f64>,
    /// Mean of the estimated variances.
    pub(super) mean: Vec<f64>,
    /// Their 5 %, 50 % and 95 % percentiles, frequency by frequency.
    pub(super) percentiles: Vec<[f64; 3]>,
    /// Variance of the estimated response about its mean over the runs.
    pub(super) monte_carlo: Vec<f64>,
    pub(super) failed: usize,
}

impl Plan {
    /// A study with these windows.
    pub(super) fn new(plant: ClosedLoop, windows: Windows) -> Self {
        Self {
            plant,
            windows,
            grid: logarithmic_grid(ENDS.0, ENDS.1, REFINED * (GIVEN - 1) + 1),
        }
    }

    /// Indices of the frequencies at which numbers are given.
    pub(super) fn given() -> impl Iterator<Item = usize> {
        (0..GIVEN).map(|k| REFINED * k)
    }

    fn run(&self, seed: u64) -> Vec<Result<Found, Failure>> {
        let samples = self.windows.columns + self.windows.past + self.windows.future;
        let log = match self.plant.record(samples, seed) {
            Ok(log) => log,
            Err(error) => return vec![Err(error.to_string()); algorithms().len()],
        };
        algorithms()
            .iter()
            .map(|algorithm| algorithm.run(&log, &self.windows, &self.grid))
            .collect()
    }

    /// Carries the study out.
    pub(super) fn carry_out(
        &self,
        study: &Study,
        runs: usize,
    ) -> Result<Vec<Outcome>, ReproduceError> {
        let mut by_algorithm: Vec<Vec<_>> = algorithms().iter().map(|_| Vec::new()).collect();
        for run in study.monte_carlo(runs, |seed| self.run(seed)) {
            for (results, result) in by_algorithm.iter_mut().zip(run) {
                results.push(result);
            }
        }
        algorithms()
            .into_iter()
            .zip(by_algorithm)
            .map(|(algorithm, results)| {
                let (found, failed) = successes(algorithm.name, results)?;
                let truth = algorithm.true_variance(&self.plant, &self.windows, &self.grid)?;
                Ok(self.outcome(algorithm, &found, failed, truth))
            })
            .collect()
    }

    fn outcome(
        &self,
        algorithm: Algorithm,
        found: &[Found],
        failed: usize,
        truth: Vec<f64>,
    ) -> Outcome {
        let at = |k: usize| -> Vec<f64> { found.iter().map(|f| f.variance[k]).collect() };
        let places = 0..self.grid.len();
        Outcome {
            algorithm,
            truth,
            mean: places.clone().map(|k| mean(&at(k))).collect(),
            percentiles: places
                .clone()
                .map(|k| percentiles(&at(k), [0.05, 0.5, 0.95]))
                .collect(),
            monte_carlo: places
                .map(|k| {
                    let values: Vec<Complex64> = found.iter().map(|f| f.response[k]).collect();
                    let centre = values.iter().sum::<Complex64>() / values.len() as f64;
                    let scatter: f64 = values.iter().map(|v| (v - centre).norm_sqr()).sum();
                    scatter / (values.len() - 1) as f64
                })
                .collect(),
            failed,
        }
    }

    /// Figure 1 of the paper, a panel for each algorithm.
    pub(super) fn figure(&self, outcomes: &[Outcome], runs: usize, title: &str) -> Figure {
        let panels = outcomes
            .iter()
            .map(|o| {
                let percentile = |k: usize| o.percentiles.iter().map(move |p| p[k]);
                Panel {
                    title: o.algorithm.name.to_owned(),
                    curves: vec![
                        Curve::banded(
                            "mean estimate, 5 % to 95 %",
                            Role::First,
                            o.mean.iter().copied(),
                            percentile(0),
                            percentile(2),
                        ),
                        Curve::line("median estimate", Role::Second, percentile(1)),
                        Curve::line(
                            "Monte Carlo variance",
                            Role::Third,
                            o.monte_carlo.iter().copied(),
                        ),
                        Curve::line(
                            "true asymptotic variance",
                            Role::Truth,
                            o.truth.iter().copied(),
                        ),
                    ],
                }
            })
            .collect();
        Figure {
            id: "variance".to_owned(),
            title: title.to_owned(),
            caption: format!(
                "Variance of the estimated transfer function, E|F - E F|^2, over frequency: what {runs} recordings say \
                 of it, each by itself, against the true asymptotic variance. Percentiles are taken frequency by \
                 frequency. The Monte Carlo variance is that of the {runs} estimates themselves."
            ),
            x: Quantity::frequency(),
            y: Quantity {
                label: "variance of F".to_owned(),
                unit: String::new(),
                logarithmic: true,
            },
            at: self.grid.clone(),
            panels,
        }
    }

    /// Ratios at the eight frequencies.
    pub(super) fn table(&self, outcomes: &[Outcome]) -> Table {
        let mut rows = Vec::new();
        for o in outcomes {
            let mut row = |what: &str, value: &dyn Fn(usize) -> f64| {
                let name = format!("{}: {what}", o.algorithm.name);
                rows.push(Row::found(&name, Self::given().map(value)));
            };
            row("true standard deviation", &|k| o.truth[k].sqrt());
            row("mean estimated / true variance", &|k| {
                o.mean[k] / o.truth[k]
            });
            row("5 % percentile / true", &|k| {
                o.percentiles[k][0] / o.truth[k]
            });
            row("median / true", &|k| o.percentiles[k][1] / o.truth[k]);
            row("95 % percentile / true", &|k| {
                o.percentiles[k][2] / o.truth[k]
            });
            row("mean estimated / Monte Carlo variance", &|k| {
                o.mean[k] / o.monte_carlo[k]
            });
        }
        Table {
            id: "ratios".to_owned(),
            title: "Estimated, true and Monte Carlo variance".to_owned(),
            caption: "Variance of F at eight frequencies (rad/sample). Near a pole on the unit circle the estimated \
                      response has heavy tails: means and Monte Carlo variances say little there, medians do."
                .to_owned(),
            rows_are: "Algorithm".to_owned(),
            columns: Self::given()
                .map(|k| plain_numbers::number(self.grid[k], 2))
                .collect(),
            rows,
            digits: 3,
        }
    }
}

/// Sentences on runs that failed.
pub(super) fn failures(outcomes: &[Outcome], runs: usize) -> Vec<String> {
    outcomes
        .iter()
        .filter_map(|o| plain_numbers::failures(o.algorithm.name, o.failed, runs))
        .collect()
}
