//! Example 2: fifth order, marginally stable, under a controller of order four.

use super::algorithm::Windows;
use super::chiuso_picci_statements::{against_optimised, misprints, statements};
use super::first_order_example::setup;
use super::variance::{Plan, failures};
use super::{PAPER, PAPER_RUNS};
use crate::reproduce::document::Reproduction;
use crate::reproduce::monte_carlo_runs::Study;
use crate::reproduce::reproduce_error::ReproduceError;
use crate::reproduce::{Experiment, document_of};
use crate::systems::chiuso_picci_two;

/// Example 2 of Chiuso & Picci.
#[derive(Debug, Clone, Copy)]
pub struct ChiusoPicciTwo;

const WINDOWS: Windows = Windows {
    past: 25,
    future: 15,
    columns: 2000,
    order: 5,
};

impl Experiment for ChiusoPicciTwo {
    fn name(&self) -> &'static str {
        "chiuso-picci-2"
    }

    fn title(&self) -> &'static str {
        "Variance from data: a marginally stable fifth-order plant under dynamic feedback"
    }

    fn paper_runs(&self) -> usize {
        PAPER_RUNS
    }

    fn reproduce(&self, study: &Study) -> Result<Reproduction, ReproduceError> {
        let runs = study.count(PAPER_RUNS)?;
        let plan = Plan::new(chiuso_picci_two(), WINDOWS);
        let outcomes = plan.carry_out(study, runs)?;
        let mut document = document_of(self, PAPER, runs, study);
        document.setup = setup(
            &WINDOWS,
            "A2, B2, C2, K2 and H(z) of section 5, as printed; u = r - H y",
        );
        document.comparison = statements(&outcomes);
        document.comparison.extend(against_optimised(&outcomes));
        document.comparison.extend(misprints());
        document
            .figures
            .push(plan.figure(&outcomes, runs, "Example 2: Fig. 1"));
        document.tables.push(plan.table(&outcomes));
        document.remarks = failures(&outcomes, runs);
        document.remarks.push(
            "Poles at 1 and at 0.979 exp(0.15 j): at 2000 columns their estimates scatter across the unit circle, the \
             estimated response there has no finite mean, and neither has its estimated variance. The paper's mean \
             curve is a matter of luck below 0.4 rad/sample; medians are not."
                .to_owned(),
        );
        Ok(document)
    }
}
