//! Does the stated variance hold for every method? Example 1 of Chiuso & Picci. The whole study (1000 runs, both
//! examples) is `cargo run --release --example variance_study`.

use innovant::identify::{Method, Weight};
use innovant::internal::systems::{chiuso_picci_frequencies, chiuso_picci_one};

use crate::variance::Study;

const METHODS: [(Method, Weight); 4] = [
    (Method::PbsidOpt, Weight::Identity),
    (Method::Whitening, Weight::Identity),
    (Method::InnovationEstimation, Weight::Identity),
    (Method::InnovationEstimation, Weight::Cva),
];

fn study(windows: usize, runs: u64, method: Method, weight: Weight) -> Vec<(f64, f64)> {
    let plant = chiuso_picci_one();
    let (past, future) = (10, 5);
    let study = Study {
        plant: &plant,
        method,
        weight,
        past,
        future,
        samples: windows + past + future,
        runs,
        seed: 100,
    };
    study
        .run(&chiuso_picci_frequencies())
        .iter()
        .map(|v| {
            println!(
                "{} {weight:?} at {:.3}: estimated {:.3e}, Monte Carlo {:.3e}, true {:.3e}",
                method.name(),
                v.rad,
                v.mean_estimated,
                v.monte_carlo,
                v.asymptotic
            );
            (
                v.mean_estimated / v.monte_carlo,
                v.percentiles[1] / v.asymptotic,
            )
        })
        .collect()
}

/// 300 runs: the Monte Carlo variance has a standard error of sqrt(2 / 300) = 8 %, so that the ratio, which is
/// 0.92 to 1.11 in the limit of many runs at this length, stays within these bounds by three standard errors.
#[test]
fn estimated_variance_is_that_of_monte_carlo() {
    for (method, weight) in METHODS {
        for (ratio, _) in study(1000, 300, method, weight) {
            assert!(
                (0.72..1.4).contains(&ratio),
                "{method:?} {weight:?}: {ratio}"
            );
        }
    }
}

/// Longer recordings state the asymptotic variance: the median over few runs is within its scatter.
#[test]
fn estimated_variance_tends_to_the_true_asymptotic_one() {
    for (method, weight) in METHODS {
        for (_, ratio) in study(100_000, 15, method, weight) {
            assert!(
                (0.93..1.07).contains(&ratio),
                "{method:?} {weight:?}: {ratio}"
            );
        }
    }
}
