//! What both examples share: the study of the estimated variances, and its document.

use super::algorithm::Windows;
use super::chiuso_picci_statements::{against_optimised, misprints, statements};
use super::variance::{Plan, failures};
use super::{PAPER, PAPER_RUNS};
use crate::reproduce::document::{Fact, Reproduction};
use crate::reproduce::monte_carlo_runs::Study;
use crate::reproduce::{Experiment, ReproduceError, document_of};
use crate::systems::ClosedLoop;

/// An example of the paper.
pub(super) struct Example {
    pub(super) plant: fn() -> ClosedLoop,
    pub(super) windows: Windows,
    /// Plant and controller as the paper states them.
    pub(super) stated: &'static str,
    /// Title of the figure.
    pub(super) figure: &'static str,
}

impl Example {
    /// Carries out the study that `experiment` asks for.
    pub(super) fn reproduce(
        self,
        experiment: &dyn Experiment,
        study: &Study,
    ) -> Result<Reproduction, ReproduceError> {
        let runs = study.count(PAPER_RUNS)?;
        let mut document = document_of(experiment, PAPER, runs, study);
        document.setup = setup(&self.windows, self.stated);
        let plan = Plan::new((self.plant)(), self.windows);
        let outcomes = plan.carry_out(study, runs)?;
        document.comparison = statements(&outcomes);
        document.comparison.extend(against_optimised(&outcomes));
        document.comparison.extend(misprints());
        document
            .figures
            .push(plan.figure(&outcomes, runs, self.figure));
        document.tables.push(plan.table(&outcomes));
        document.remarks = failures(&outcomes, runs);
        Ok(document)
    }
}

/// The set-up of an example.
fn setup(windows: &Windows, plant: &str) -> Vec<Fact> {
    vec![
        Fact::paper("Plant and controller", plant),
        Fact::paper("Reference and innovation", "white, unit variance"),
        Fact::paper("Past window t - t0", windows.past.to_string()),
        Fact::paper("Future window f", windows.future.to_string()),
        Fact::paper("Columns N", windows.columns.to_string()),
        Fact::ours(
            "Weight W",
            "identity, for innovation estimation also CVA; the paper leaves it open",
        ),
        Fact::ours("Distribution of reference and innovation", "normal"),
        Fact::ours(
            "Variance of F",
            "E|F - E F|^2, the trace of the covariance of real and imaginary part",
        ),
        Fact::ours("Innovation variance", "residual sum of squares / (N - q p)"),
        Fact::ours("Recordings", "stationary; nothing removed"),
    ]
}
