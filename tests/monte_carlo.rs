//! Does the stated uncertainty hold? 300 recordings of Example I (repaired), in closed loop, default settings:
//! how often the 95 % and 99 % regions of frequency response and poles hold the truth.
//!
//! `cargo test --release --test monte_carlo -- --nocapture` prints the table.

use innovant::covariance::impulse_response_std;
use innovant::identify::{CovarianceKind, Order, Polish};
use innovant::internal::systems::{TestSystem, servo, van_wingerden_one};
use innovant::{Options, identify};
use rayon::prelude::*;

#[path = "support/coverage.rs"]
mod coverage;
use coverage::{Count, coverage};

const RUNS: u64 = 300;

fn study(
    name: &str,
    plant: &TestSystem,
    samples: usize,
    options: &Options,
    frequencies: &[f64],
    runs: u64,
) -> [(f64, f64); 3] {
    let (counts, right_order) = (0..runs)
        .into_par_iter()
        .map(|run| {
            let model = identify(&[plant.record(samples, 1000 + run)], options).unwrap();
            let right = u64::from(model.system.states() == plant.system.states());
            (coverage(plant, &model, frequencies), right)
        })
        .reduce(
            || ([Count::default(); 3], 0),
            |(mut a, right_a), (b, right_b)| {
                for (a, b) in a.iter_mut().zip(&b) {
                    a.add(b);
                }
                (a, right_a + right_b)
            },
        );
    let shares = counts.map(|c| c.shares());
    assert!(
        right_order * 10 >= runs * 9,
        "right order in {right_order} of {runs}"
    );
    println!(
        "{name:<44} G {:.1} / {:.1}   |G| {:.1} / {:.1}   poles {:.1} / {:.1}   \
         right order {right_order} of {runs}",
        shares[0].0, shares[0].1, shares[1].0, shares[1].1, shares[2].0, shares[2].1
    );
    shares
}

const FREQUENCIES: [f64; 8] = [0.1, 0.3, 0.6, 0.785, 1.2, 1.8, 2.36, 3.0];

#[test]
fn default_settings_cover_in_closed_loop() {
    let plant = van_wingerden_one();
    let name = "Example I, N = 2000, default";
    let shares = study(name, &plant, 2000, &Options::default(), &FREQUENCIES, RUNS);
    for (at_95, at_99) in shares {
        assert!((93.0..=97.0).contains(&at_95), "{at_95}");
        assert!((97.5..=99.7).contains(&at_99), "{at_99}");
    }
}

#[test]
fn plain_subspace_estimate_covers_too() {
    let plant = van_wingerden_one();
    let options = Options {
        order: Order::Fixed(4),
        past: Some(10),
        polish: Polish::Never,
        ..Options::default()
    };
    let name = "Example I, N = 2000, p = 10, no polish";
    for (at_95, at_99) in study(name, &plant, 2000, &options, &FREQUENCIES, RUNS) {
        assert!((92.5..=97.0).contains(&at_95), "{at_95}");
        assert!((97.3..=99.7).contains(&at_99), "{at_99}");
    }
}

#[test]
fn slow_plant_with_coloured_noise_covers() {
    let plant = servo();
    // 1 kHz: from a tenth of the slow pole to a decade above the resonance.
    let frequencies: Vec<f64> = [1.0, 5.0, 10.0, 30.0, 80.0, 120.0, 200.0, 600.0].into();
    let name = "servo, N = 4000, default";
    for (at_95, at_99) in study(name, &plant, 4000, &Options::default(), &frequencies, 60) {
        assert!((91.0..=98.0).contains(&at_95), "{at_95}");
        assert!((96.0..=100.0).contains(&at_99), "{at_99}");
    }
}

/// First 50 Markov parameters from 1e5 samples in closed loop: the relative Frobenius error is what the stated
/// covariance, which is the Cramer-Rao bound of a maximum-likelihood estimate, promises.
#[test]
fn markov_parameters_are_as_good_as_promised() {
    const COUNT: usize = 50;
    let plant = van_wingerden_one();
    let truth = plant.system.impulse_response(COUNT + 1);
    let size: f64 = truth.iter().skip(1).map(|h| h.norm_squared()).sum();
    let errors: Vec<(f64, f64)> = (0..20_u64)
        .into_par_iter()
        .map(|run| {
            let log = plant.record(100_000, 5000 + run);
            let model = identify(&[log], &Options::default()).unwrap();
            let found = model.system.impulse_response(COUNT + 1);
            let square = |k: usize| (&found[k] - &truth[k]).norm_squared();
            let error: f64 = (1..=COUNT).map(square).sum();
            let covariance = model.covariance.as_ref().unwrap();
            let deviations = impulse_response_std(&model.system, covariance, COUNT + 1).unwrap();
            let promised: f64 = deviations.iter().skip(1).map(|d| d.norm_squared()).sum();
            (error / size, promised / size)
        })
        .collect();
    let mean = |values: &[(f64, f64)]| {
        values.iter().map(|(e, _)| e.sqrt()).sum::<f64>() / values.len() as f64
    };
    let rms = |pick: fn(&(f64, f64)) -> f64| {
        (errors.iter().map(pick).sum::<f64>() / errors.len() as f64).sqrt()
    };
    let (found, promised) = (rms(|e| e.0), rms(|e| e.1));
    println!(
        "Example I, N = 1e5, 50 Markov parameters: mean relative error {:.4} (first 10 draws), {:.4} (20); \
         rms {found:.4}, promised {promised:.4}",
        mean(&errors[..10]),
        mean(&errors)
    );
    // 20 squared errors of a few strong directions: the ratio of their mean scatters by about a quarter.
    assert!((0.5..1.5).contains(&(found / promised)));
}

/// The jackknife has 18 or more degrees of freedom, and its regions take Student and F quantiles.
#[test]
fn robust_covariance_covers() {
    let plant = van_wingerden_one();
    let options = Options {
        covariance: CovarianceKind::Robust,
        ..Options::default()
    };
    let name = "Example I, N = 4000, --covariance robust";
    for (at_95, at_99) in study(name, &plant, 4000, &options, &FREQUENCIES, 100) {
        assert!((91.0..=98.0).contains(&at_95), "{at_95}");
        assert!((96.5..=99.9).contains(&at_99), "{at_99}");
    }
}
