//! Estimated, Monte Carlo and true asymptotic variance of the frequency response in the examples of Chiuso & Picci.
//!
//! `cargo run --release --example variance_study -- [EXAMPLE 1|2] [RUNS] [WINDOWS] [SEED]`

#[path = "../tests/support/variance.rs"]
mod variance;

use innovant::identify::{Method, Weight};
use innovant::internal::systems::{chiuso_picci_frequencies, chiuso_picci_one, chiuso_picci_two};
use variance::Study;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<u64> = std::env::args()
        .skip(1)
        .map(|a| a.parse())
        .collect::<Result<_, _>>()?;
    let argument = |index: usize, default: u64| arguments.get(index).copied().unwrap_or(default);
    let (plant, past, future, usual) = match argument(0, 1) {
        1 => (chiuso_picci_one(), 10, 5, 1000),
        _ => (chiuso_picci_two(), 25, 15, 2000),
    };
    let (runs, windows, seed) = (argument(1, 1000), argument(2, usual), argument(3, 1));
    for (method, weight) in [
        (Method::PbsidOpt, Weight::Identity),
        (Method::Whitening, Weight::Identity),
        (Method::InnovationEstimation, Weight::Identity),
        (Method::InnovationEstimation, Weight::Cva),
    ] {
        let study = Study {
            plant: &plant,
            method,
            weight,
            past,
            future,
            samples: windows as usize + past + future,
            runs,
            seed,
        };
        println!(
            "{}, weight {weight:?}, {runs} runs of {windows} windows",
            method.name()
        );
        println!("  rad/sample  asymptotic sd  estimated/MC  true/MC  median est./true  5 %..95 %");
        for v in study.run(&chiuso_picci_frequencies()) {
            println!(
                "  {:>10.4}  {:>13.4e}  {:>12.3}  {:>7.3}  {:>16.3}  {:.2}..{:.2}",
                v.rad,
                v.asymptotic.sqrt(),
                v.mean_estimated / v.monte_carlo,
                v.asymptotic / v.monte_carlo,
                v.percentiles[1] / v.asymptotic,
                v.percentiles[0] / v.asymptotic,
                v.percentiles[2] / v.asymptotic,
            );
        }
    }
    Ok(())
}
