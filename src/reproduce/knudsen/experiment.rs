//! The three experiments: the same study of three systems.

use super::errors::Errors;
use super::knudsen_statements::statements;
use super::{PAPER, PAPER_RUNS, SAMPLES};
use crate::reproduce::document::{Fact, Reproduction};
use crate::reproduce::monte_carlo_runs::Study;
use crate::reproduce::{Experiment, ReproduceError, document_of};
use crate::systems::{KnudsenExample, knudsen_armax, knudsen_bj, knudsen_vo};

/// Section 6 of Knudsen for one of its systems.
#[derive(Debug, Clone, Copy)]
pub(crate) struct KnudsenExperiment {
    name: &'static str,
    title: &'static str,
    figure: &'static str,
    origin: &'static str,
    example: fn() -> KnudsenExample,
}

const EXPERIMENTS: [KnudsenExperiment; 3] = [
    KnudsenExperiment {
        name: "knudsen-vo",
        title: "The stochastic part: a noise zero at 0.9996",
        figure: "Figure 1",
        origin: "book of van Overschee & De Moor, section 4.4.5; all digits of table 1 agree",
        example: knudsen_vo,
    },
    KnudsenExperiment {
        name: "knudsen-armax",
        title: "The stochastic part: a second-order ARMAX system",
        figure: "Figure 2",
        origin: "closed form behind the printed digits: period 20, damping 0.5; noise zeros period 10, damping 0.25",
        example: knudsen_armax,
    },
    KnudsenExperiment {
        name: "knudsen-bj",
        title: "The stochastic part: a fourth-order Box-Jenkins system",
        figure: "Figure 3",
        origin: "closed form behind the printed digits: second-order process and noise parts with periods 10 and 20",
        example: knudsen_bj,
    },
];

/// The three experiments.
pub(crate) fn knudsen_experiments() -> &'static [KnudsenExperiment; 3] {
    &EXPERIMENTS
}

impl Experiment for KnudsenExperiment {
    fn name(&self) -> &'static str {
        self.name
    }

    fn title(&self) -> &'static str {
        self.title
    }

    fn paper_runs(&self) -> usize {
        PAPER_RUNS
    }

    fn reproduce(&self, study: &Study) -> Result<Reproduction, ReproduceError> {
        let runs = study.count(PAPER_RUNS)?;
        let errors = Errors::carry_out((self.example)(), study, runs)?;
        let mut document = document_of(self, PAPER, runs, study);
        document.setup = setup(&errors.example, self.origin);
        document.comparison = statements(&errors);
        document.bars.push(errors.bars(self.figure));
        document.tables = errors.tables(runs);
        document.remarks = errors.failures(runs);
        document.remarks.push(
            "Noise models whose predictor is unstable are replaced by their minimum-phase equivalents, sigma^2 \
             multiplied by the squared moduli of the zeros that move. The paper does not say so, but its row of the BJ \
             system is only met with it, and sigma^2 there has a heavy tail because of it: its rms is an accident of \
             the recordings."
                .to_owned(),
        );
        Ok(document)
    }
}

fn setup(example: &KnudsenExample, origin: &str) -> Vec<Fact> {
    vec![
        Fact::paper("System", example.name),
        Fact::paper("Order", example.order().to_string()),
        Fact::paper("Recordings", format!("of {SAMPLES} samples")),
        Fact::paper("Horizons", format!("h = i = {}", example.horizon)),
        Fact::paper("Measure", "root mean square error of the ARMAX parameters"),
        Fact::ours("Exact parameters", origin),
        Fact::ours(
            "Input",
            "random telegraph signal of amplitude one that switches with probability 0.15; the paper has \"a suitable \
             excitation\"",
        ),
        Fact::ours(
            "Initial state",
            "stationary: 1000 samples before each recording",
        ),
        Fact::ours("Noise models", "made minimum phase where they are not"),
    ]
}
