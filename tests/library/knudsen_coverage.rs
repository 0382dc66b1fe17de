//! Does the delta-method covariance of tk-chol say how far off the estimate is?
//!
//! `cargo test --release --test library knudsen_coverage -- --nocapture` prints the shares.

use innovant::covariance::{
    ellipse_quantile, frequency_response_covariance, interval_quantile, noise_response_covariance,
    static_gain_std,
};
use innovant::identify::{Method, Order};
use innovant::internal::systems::knudsen_armax;
use innovant::{Options, identify};
use rayon::prelude::*;

const RUNS: u64 = 200;
const SAMPLES: usize = 2000;
/// rad/sample: below, at and above the corner of the plant.
const FREQUENCIES: [f64; 4] = [0.1, 0.4, 0.8, 1.6];
const LEVELS: [f64; 2] = [0.95, 0.99];

/// Of one run: which regions hold the truth, `[level][frequency]` of `G` and of `H`, and `[level]` of the static gain.
struct Held {
    responses: [[[bool; 4]; 2]; 2],
    gain: [bool; 2],
}

fn held(seed: u64) -> Held {
    let example = knudsen_armax();
    let truth = &example.system.system;
    let options = Options {
        method: Method::Knudsen,
        order: Order::Fixed(2),
        feedthrough: true,
        ..Options::default()
    };
    let model = identify(&[example.record(SAMPLES, seed)], &options).unwrap();
    let covariance = model.covariance.as_ref().unwrap();
    let mut responses = [[[false; 4]; 2]; 2];
    for (k, &w) in FREQUENCIES.iter().enumerate() {
        let of_inputs = model.system.frequency_response(w) - truth.frequency_response(w);
        let of_noise = model.system.noise_response(w) - truth.noise_response(w);
        let spreads = [
            frequency_response_covariance(&model.system, covariance, w).unwrap(),
            noise_response_covariance(&model.system, covariance, w).unwrap(),
        ];
        for (path, (error, spread)) in [of_inputs, of_noise].iter().zip(&spreads).enumerate() {
            let (e, [[a, b], [_, d]]) = (error[0], spread[0]);
            let square =
                (d * e.re * e.re - 2.0 * b * e.re * e.im + a * e.im * e.im) / (a * d - b * b);
            for (level, share) in LEVELS.iter().enumerate() {
                responses[path][level][k] = square <= ellipse_quantile(*share, None);
            }
        }
    }
    let error = model.system.static_gain().unwrap()[(0, 0)] - truth.static_gain().unwrap()[(0, 0)];
    let std = static_gain_std(&model.system, covariance).unwrap().unwrap()[(0, 0)];
    Held {
        responses,
        gain: LEVELS.map(|level| error.abs() <= interval_quantile(level, None) * std),
    }
}

/// Standard error of the share of `RUNS` independent runs. Shares that are averages over frequencies have less.
fn standard_error(level: f64) -> f64 {
    (level * (1.0 - level) / RUNS as f64).sqrt()
}

#[test]
fn delta_method_regions_hold_the_truth() {
    let runs: Vec<Held> = (0..RUNS)
        .into_par_iter()
        .map(|k| held(31_000 + k))
        .collect();
    let share = |inside: &dyn Fn(&Held) -> usize, of: usize| {
        runs.iter().map(inside).sum::<usize>() as f64 / (runs.len() * of) as f64
    };
    let count = |list: &[bool]| list.iter().filter(|held| **held).count();
    for (level, nominal) in LEVELS.into_iter().enumerate() {
        let found = [
            (
                "G",
                share(&|run| count(&run.responses[0][level]), FREQUENCIES.len()),
            ),
            (
                "H",
                share(&|run| count(&run.responses[1][level]), FREQUENCIES.len()),
            ),
            ("static gain", share(&|run| usize::from(run.gain[level]), 1)),
        ];
        for (what, found) in found {
            println!(
                "{what:12} {:.1} % nominal: {:.2} %",
                100.0 * nominal,
                100.0 * found
            );
            // Three standard errors: one such test in 400 fails by chance.
            let limit = 3.0 * standard_error(nominal);
            assert!(
                (found - nominal).abs() < limit,
                "{what}: {found} instead of {nominal}"
            );
        }
    }
}
