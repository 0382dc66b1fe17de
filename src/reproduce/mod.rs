//! The papers' experiments, run again: their tables and figures beside what they print.
//!
//! An [`Experiment`] carries out a Monte Carlo study and delivers a [`Reproduction`]: comparison with the paper,
//! pictures and tables as numbers. JSON, CSV, terminal and page are written from that one document, by
//! `report`. Errors in print are found by computing what is printed, not by claiming it.
//!
//! | file | what it holds |
//! |---|---|
//! | `document`, `figure` | what a reproduction delivers |
//! | `monte_carlo_runs` | runs in parallel; each has its own seed, so that results depend neither on threads nor on their number |
//! | `statistics`, `plain_numbers` | percentiles and moments over runs; numbers in sentences |
//! | `data_factor` | the data factor of a simulated recording |
//! | `van_wingerden` | van Wingerden: both examples |
//! | `chiuso_picci` | Chiuso & Picci: both examples |
//! | `knudsen` | Knudsen: all three systems |

mod chiuso_picci;
mod data_factor;
mod document;
mod figure;
mod knudsen;
mod monte_carlo_runs;
mod plain_numbers;
mod reproduce_error;
mod statistics;
mod van_wingerden;

pub(crate) use chiuso_picci::{ChiusoPicciOne, ChiusoPicciTwo};
#[cfg(test)]
pub(crate) use document::Fact;
pub(crate) use document::{Agreement, Comparison, Origin, REPRODUCTION_FORMAT, Reproduction};
#[cfg(test)]
pub(crate) use figure::BarSeries;
pub(crate) use figure::{Bars, Curve, Figure, Panel, Quantity, Role, Row, Table};
pub(crate) use knudsen::knudsen_experiments;
pub(crate) use monte_carlo_runs::Study;
pub(crate) use reproduce_error::ReproduceError;
pub(crate) use van_wingerden::{VanWingerdenOne, VanWingerdenTwo};

/// An experiment of a paper.
pub(crate) trait Experiment: Sync {
    /// Its name on the command line.
    fn name(&self) -> &'static str;

    /// What it shows.
    fn title(&self) -> &'static str;

    /// Number of Monte Carlo runs in the paper.
    fn paper_runs(&self) -> usize;

    /// How often [`Study::progress`] is called when there are `runs` runs: the number of systems times that.
    fn runs_of(&self, runs: usize) -> usize {
        runs
    }

    /// Carries it out.
    ///
    /// # Errors
    /// [`ReproduceError`]: too few runs, or a method that fails in too many of them.
    fn reproduce(&self, study: &Study) -> Result<Reproduction, ReproduceError>;
}

/// All experiments, in the order of the papers.
pub(crate) fn experiments() -> Vec<&'static dyn Experiment> {
    let mut all: Vec<&'static dyn Experiment> = vec![
        &VanWingerdenOne,
        &VanWingerdenTwo,
        &ChiusoPicciOne,
        &ChiusoPicciTwo,
    ];
    for experiment in knudsen_experiments() {
        all.push(experiment);
    }
    all
}

/// The experiment of that name.
pub(crate) fn experiment(name: &str) -> Option<&'static dyn Experiment> {
    experiments().into_iter().find(|e| e.name() == name)
}

/// A document with its head filled in.
fn document_of(of: &dyn Experiment, paper: &str, runs: usize, study: &Study) -> Reproduction {
    Reproduction {
        format: REPRODUCTION_FORMAT.to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        experiment: of.name().to_owned(),
        title: of.title().to_owned(),
        paper: paper.to_owned(),
        runs,
        paper_runs: of.paper_runs(),
        seed: study.seed,
        setup: Vec::new(),
        comparison: Vec::new(),
        figures: Vec::new(),
        bars: Vec::new(),
        tables: Vec::new(),
        remarks: Vec::new(),
    }
}
