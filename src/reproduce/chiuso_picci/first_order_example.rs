//! Example 1: first order with proportional feedback.

use super::PAPER_RUNS;
use super::algorithm::Windows;
use super::variance_study::Example;
use crate::reproduce::document::Reproduction;
use crate::reproduce::monte_carlo_runs::Study;
use crate::reproduce::{Experiment, ReproduceError};
use crate::systems::chiuso_picci_one;

/// Example 1 of Chiuso & Picci.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ChiusoPicciOne;

const EXAMPLE: Example = Example {
    plant: chiuso_picci_one,
    windows: Windows {
        past: 10,
        future: 5,
        columns: 1000,
        order: 1,
    },
    stated: "A = 0.9, B = 1, C = 1.4, K = 1; u = 5 r - y",
    figure: "Example 1: Fig. 1",
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
        EXAMPLE.reproduce(self, study)
    }
}
