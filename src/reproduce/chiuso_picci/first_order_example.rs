//! Example 1: first order with proportional feedback.

use super::algorithm::Windows;
use super::chiuso_picci_statements::{against_optimised, misprints, statements};
use super::variance::{Plan, failures};
use super::{PAPER, PAPER_RUNS};
use crate::reproduce::document::{Fact, Reproduction};
use crate::reproduce::monte_carlo_runs::Study;
use crate::reproduce::reproduce_error::ReproduceError;
use crate::reproduce::{Experiment, document_of};
use crate::systems::chiuso_picci_one;

/// Example 1 of Chiuso & Picci.
#[derive(Debug, Clone, Copy)]
pub struct ChiusoPicciOne;

const WINDOWS: Windows = Windows {
    past: 10,
    future: 5,
    columns: 1000,
    order: 1,
};

impl Experiment for ChiusoPicciOne {
    fn name(&self) -> &'static str {
        "chiuso-picci-1"
    }

    fn title(&self) -> &'static str {
        "Variance from data: a first-order plant with proportional feedback"
    }

    fn paper_runs(&self) -> usize {
        PAPER_RUNS
    }

    fn reproduce(&self, study: &Study) -> Result<Reproduction, ReproduceError> {
        let runs = study.count(PAPER_RUNS)?;
        let plan = Plan::new(chiuso_picci_one(), WINDOWS);
        let outcomes = plan.carry_out(study, runs)?;
        let mut document = document_of(self, PAPER, runs, study);
        document.setup = setup(&WINDOWS, "A = 0.9, B = 1, C = 1.4, K = 1; u = 5 r - y");
        document.comparison = statements(&outcomes);
        document.comparison.extend(against_optimised(&outcomes));
        document.comparison.extend(misprints());
        document
            .figures
            .push(plan.figure(&outcomes, runs, "Example 1: Fig. 1"));
        document.tables.push(plan.table(&outcomes));
        document.remarks = failures(&outcomes, runs);
        Ok(document)
    }
}

/// The set-up of an example.
pub(super) fn setup(windows: &Windows, plant: &str) -> Vec<Fact> {
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
