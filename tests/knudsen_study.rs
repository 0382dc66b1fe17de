//! Knudsen's Monte Carlo: 200 recordings of 500 samples of his three systems, all methods of table 2.
//!
//! `cargo test --release --test knudsen_study -- --nocapture` prints the tables.

use innovant::identify::baselines::TableTwo;
use innovant::systems::{KnudsenExample, knudsen_armax, knudsen_bj, knudsen_vo};
use rayon::prelude::*;

const RUNS: u64 = 200;
const SAMPLES: usize = 500;
const SEED: u64 = 2001;

/// Root mean square errors of every parameter, one vector a method.
struct Study {
    example: KnudsenExample,
    /// Errors of each method, run and parameter.
    errors: Vec<Vec<Vec<f64>>>,
}

impl Study {
    fn new(example: KnudsenExample) -> Self {
        let truth = example.parameters();
        let per_run: Vec<Vec<Vec<f64>>> = (0..RUNS)
            .into_par_iter()
            .map(|run| {
                let log = example.record(SAMPLES, SEED * 1000 + run);
                TableTwo::ALL
                    .iter()
                    .map(|method| {
                        let found = method
                            .parameters(&log, example.order(), example.horizon)
                            .unwrap();
                        found.iter().zip(&truth).map(|(f, t)| f - t).collect()
                    })
                    .collect()
            })
            .collect();
        let errors = (0..TableTwo::ALL.len())
            .map(|method| per_run.iter().map(|run| run[method].clone()).collect())
            .collect();
        Self { example, errors }
    }

    fn rms(&self, method: TableTwo) -> Vec<f64> {
        let index = TableTwo::ALL.iter().position(|m| *m == method).unwrap();
        let runs = &self.errors[index];
        (0..runs[0].len())
            .map(|p| (runs.iter().map(|e| e[p] * e[p]).sum::<f64>() / runs.len() as f64).sqrt())
            .collect()
    }

    /// Relative to tk-chol.
    fn relative(&self, method: TableTwo) -> Vec<f64> {
        let reference = self.rms(TableTwo::TkChol);
        self.rms(method)
            .iter()
            .zip(reference)
            .map(|(a, b)| a / b)
            .collect()
    }

    fn print(&self) {
        println!("{}: rms of tk-chol, ours and printed", self.example.name);
        let names = self.example.parameter_names();
        println!("{:18}{}", "", row(&names, |n| format!("{n:>9}")));
        let number = |v: &f64| format!("{v:9.2e}");
        println!("{:18}{}", "ours", row(&self.rms(TableTwo::TkChol), number));
        println!("{:18}{}", "printed", row(&self.example.printed_rms, number));
        for method in TableTwo::ALL {
            let relative = self.relative(method);
            println!(
                "{:18}{}",
                method.name(),
                row(&relative, |v| format!("{v:9.2}"))
            );
        }
    }
}

fn row<T>(values: &[T], show: impl Fn(&T) -> String) -> String {
    values.iter().map(show).collect()
}

#[test]
fn vo() {
    let study = Study::new(knudsen_vo());
    study.print();
}

#[test]
fn armax() {
    let study = Study::new(knudsen_armax());
    study.print();
}

#[test]
fn bj() {
    let study = Study::new(knudsen_bj());
    study.print();
}
