//! Knudsen's Monte Carlo: 200 recordings of 500 samples of his three systems, all methods of table 2.
//!
//! `cargo test --release --test knudsen_study -- --nocapture` prints the tables.

use innovant::internal::identify::TableTwo;
use innovant::internal::systems::{KnudsenExample, knudsen_armax, knudsen_bj, knudsen_vo};
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

/// Our rms of tk-chol over the printed one, for parameters whose names begin with one of `letters`.
fn check_printed(study: &Study, letters: &[&str], tolerance: f64) {
    let names = study.example.parameter_names();
    let ours = study.rms(TableTwo::TkChol);
    for ((name, ours), printed) in names.iter().zip(ours).zip(&study.example.printed_rms) {
        if letters.iter().any(|letter| name.starts_with(letter)) {
            let ratio = ours / printed;
            assert!(
                (ratio - 1.0).abs() < tolerance,
                "{} {name}: {ratio:.3} times the printed rms",
                study.example.name
            );
        }
    }
}

/// Geometric mean over the noise parameters `c1..cn` (and `sigma^2`) of the rms relative to tk-chol.
fn noise_level(study: &Study, method: TableTwo, with_variance: bool) -> f64 {
    let names = study.example.parameter_names();
    let logs: Vec<f64> = names
        .iter()
        .zip(study.relative(method))
        .filter(|(name, _)| name.starts_with('c') || (with_variance && *name == "sigma2"))
        .map(|(_, ratio)| ratio.ln())
        .collect();
    (logs.iter().sum::<f64>() / logs.len() as f64).exp()
}

/// Methods of the paper that share the horizon of tk-chol.
const COMPARABLE: [TableTwo; 5] = [
    TableTwo::Tk,
    TableTwo::SubidSv,
    TableTwo::SubidCva,
    TableTwo::N4sidCva,
    TableTwo::N4sidMoesp,
];

/// Both tables are rms of 200 runs, each with a standard error of 5 %: their ratio has 7 %, so 15 % is two of them.
const PRINTED: f64 = 0.15;
/// In the BJ system `a` and `b` are 5 to 7 % above the printed row in the long run and `b0` 20 % (600 runs of
/// `innovant reproduce knudsen-bj`); heavy tails (the worst twentieth of runs has 38 % of the squares, 27 % when normal)
/// make blocks of 200 runs differ by 13 %. 30 % is `b0` with two standard errors of an rms of 200 runs, 5 % each.
const PRINTED_HEAVY: f64 = 0.30;

#[test]
fn vo() {
    let study = Study::new(knudsen_vo());
    study.print();
    check_printed(&study, &["a", "b", "c", "s"], PRINTED);
    for method in COMPARABLE {
        // Best of the comparable methods in every noise parameter, beaten in a and b.
        let relative = study.relative(method);
        assert!(relative[3] > 1.1 && relative[4] > 1.3, "{}", method.name());
        if method != TableTwo::Tk {
            assert!(relative[..3].iter().all(|r| *r < 0.9), "{}", method.name());
        }
    }
    for method in [TableTwo::Pem, TableTwo::Polished] {
        let relative = study.relative(method);
        assert!(relative.iter().all(|r| *r < 0.75), "{}", method.name());
    }
}

#[test]
fn armax() {
    let study = Study::new(knudsen_armax());
    study.print();
    // b2 is 0.0079 in the long run (800 runs of `innovant reproduce knudsen-armax`), 18 % below the printed 0.0096:
    // 25 % is that with one and a half standard errors of an rms of 200 runs, 5 % each.
    check_printed(&study, &["a", "b0", "b1", "c", "s"], PRINTED);
    check_printed(&study, &["b2"], 0.25);
    for method in COMPARABLE {
        let relative = study.relative(method);
        assert!(relative[5..].iter().all(|r| *r > 1.3), "{}", method.name());
    }
    // Cramer-Rao bound with the initial state profiled out, for this excitation.
    let bound = [
        0.00586, 0.00538, 0.00319, 0.00604, 0.00417, 0.0311, 0.0309, 1.90e-4,
    ];
    for method in [TableTwo::Pem, TableTwo::Polished] {
        let ratios: Vec<f64> = study
            .rms(method)
            .iter()
            .zip(bound)
            .map(|(rms, bound)| rms / bound)
            .collect();
        println!(
            "{:18}{}",
            method.name(),
            row(&ratios, |v| format!("{v:9.3}"))
        );
        // 1.1 with room for the standard error of an rms of 200 runs, 5 %; the mean over the parameters has less.
        assert!(
            ratios.iter().all(|r| *r < 1.2),
            "{} {ratios:?}",
            method.name()
        );
        let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
        assert!(mean < 1.1, "{} {mean}", method.name());
    }
}

#[test]
fn bj() {
    let study = Study::new(knudsen_bj());
    study.print();
    check_printed(&study, &["c"], PRINTED);
    check_printed(&study, &["a", "b"], PRINTED_HEAVY);
    for method in COMPARABLE {
        // The paper's claim holds over the noise parameters together (c4, whose truth is 0, is an exception); tk is
        // close.
        let level = noise_level(&study, method, false);
        assert!(level > 1.0, "{}: {level}", method.name());
    }
    // "Best only in BJ" holds against the canonical variates, and is a tie against the others.
    let a1 = |method: TableTwo| study.relative(method)[0];
    assert!(a1(TableTwo::SubidCva) > 1.2 && a1(TableTwo::N4sidCva) > 1.2);
    assert!((a1(TableTwo::SubidSv) - 1.0).abs() < 0.1);
    assert!((a1(TableTwo::N4sidMoesp) - 1.0).abs() < 0.1);
    // The variance has a heavy tail: a few noise models far from minimum phase. Its median error is small.
    let index = TableTwo::ALL
        .iter()
        .position(|m| *m == TableTwo::TkChol)
        .unwrap();
    let mut errors: Vec<f64> = study.errors[index].iter().map(|e| e[13].abs()).collect();
    errors.sort_by(f64::total_cmp);
    println!(
        "sigma2 of tk-chol, |error|: median {:.2e}, 90 % {:.2e}, largest {:.2e}; rms {:.2e}, printed 1.67e-5",
        errors[100],
        errors[180],
        errors[199],
        study.rms(TableTwo::TkChol)[13]
    );
    assert!(errors[100] < 1e-5);
    // Few steps do better than tk-chol where converged ARMAX models have heavy tails.
    let polished = study.relative(TableTwo::Polished);
    assert!(polished[..13].iter().all(|r| *r < 1.0), "{polished:?}");
}
