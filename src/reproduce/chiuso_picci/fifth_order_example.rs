//! Example 2: fifth order, marginally stable, under a controller of order four.

use super::PAPER_RUNS;
use super::algorithm::Windows;
use super::variance_study::Example;
use crate::reproduce::document::Reproduction;
use crate::reproduce::monte_carlo_runs::Study;
use crate::reproduce::{Experiment, ReproduceError};
use crate::systems::chiuso_picci_two;

/// Example 2 of Chiuso & Picci.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ChiusoPicciTwo;

const EXAMPLE: Example = Example {
    plant: chiuso_picci_two,
    windows: Windows {
        past: 25,
        future: 15,
        columns: 2000,
        order: 5,
    },
    stated: "A2, B2, C2, K2 and H(z) of section 5, as printed; u = r - H y",
    figure: "Example 2: Fig. 1",
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
        let mut document = EXAMPLE.reproduce(self, study)?;
        document.remarks.push(
            "Poles at 1 and at 0.979 exp(0.15 j): at 2000 columns their estimates scatter across the unit circle, the \
             estimated response there has no finite mean, and neither has its estimated variance. The paper's mean \
             curve is a matter of luck below 0.4 rad/sample; medians are not."
                .to_owned(),
        );
        Ok(document)
    }
}
