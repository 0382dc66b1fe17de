//! What every closed-loop method has to do, beyond its own reference values: choose an order, estimate `D`, take several
//! recordings and other units, state a covariance that holds, and go with another stochastic step.

use innovant::covariance::{Covariance2, frequency_response_covariance, noise_response_covariance};
use innovant::identify::{CovarianceKind, Method, Order, Polish, Stochastic, Weight};
use innovant::internal::systems::{TestSystem, two_by_two, van_wingerden_one};
use innovant::log::Log;
use innovant::{Model, Options, identify};
use nalgebra::DMatrix;
use num_complex::Complex64;
use rayon::prelude::*;

const METHODS: [Method; 3] = [
    Method::PbsidOpt,
    Method::Whitening,
    Method::InnovationEstimation,
];

fn plain(method: Method) -> Options {
    Options {
        method,
        polish: Polish::Never,
        ..Options::default()
    }
}

/// `d' C^-1 d`, chi-square with two degrees of freedom.
fn distance(error: Complex64, [[a, b], [_, d]]: Covariance2) -> f64 {
    let determinant = a * d - b * b;
    (d * error.re * error.re - 2.0 * b * error.re * error.im + a * error.im * error.im)
        / determinant
}

fn largest_distance(model: &Model, truth: &TestSystem) -> f64 {
    let covariance = model.covariance.as_ref().unwrap();
    [0.1, 0.4, 0.785, 1.5, 2.36, 3.0]
        .into_iter()
        .flat_map(|w| {
            let w = w / model.system.sample_time;
            let truth = truth.system.frequency_response(w);
            let found = model.system.frequency_response(w);
            let spread = frequency_response_covariance(&model.system, covariance, w).unwrap();
            (0..found.len())
                .map(|i| distance(found[i] - truth[i], spread[i]))
                .collect::<Vec<_>>()
        })
        .fold(0.0, f64::max)
}

/// 24 correlated points: all of them beyond 30 (a probability of 3e-7 each) never happens to a method that is right.
const FAR: f64 = 30.0;

#[test]
fn every_method_finds_order_and_model_in_closed_loop() {
    let plant = van_wingerden_one();
    let log = plant.record(4000, 5);
    for method in METHODS {
        let model = identify(std::slice::from_ref(&log), &plain(method)).unwrap();
        let summary = model.summary.as_ref().unwrap();
        assert_eq!((summary.method, summary.polished), (method, false));
        assert_eq!(model.system.states(), 4, "{method:?}");
        let far = largest_distance(&model, &plant);
        println!("{}: largest squared distance {far:.1}", method.name());
        assert!(far < FAR, "{method:?}: {far}");
    }
}

/// Open loop, an input that acts at once: `D` is estimated, and its deviation from the truth is what is stated.
#[test]
fn feedthrough_is_estimated_with_its_uncertainty() {
    let mut plant = two_by_two();
    plant.system.d = DMatrix::from_row_slice(2, 2, &[0.5, 0.0, -0.3, 1.0]);
    for method in METHODS {
        let options = Options {
            feedthrough: true,
            order: Order::Fixed(3),
            past: Some(20),
            ..plain(method)
        };
        let squares: Vec<Vec<f64>> = (0..60_u64)
            .into_par_iter()
            .map(|seed| {
                let model = identify(&[plant.record(2000, 300 + seed)], &options).unwrap();
                let covariance = model.covariance.as_ref().unwrap();
                let first = covariance.layout.d();
                (0..4)
                    .map(|i| {
                        let error = model.system.d[i] - plant.system.d[i];
                        error * error / covariance.matrix[(first + i, first + i)]
                    })
                    .collect()
            })
            .collect();
        for entry in 0..4 {
            let mean = squares.iter().map(|s| s[entry]).sum::<f64>() / squares.len() as f64;
            println!(
                "{}: D{entry} squared error over variance {mean:.2}",
                method.name()
            );
            // Standard error sqrt(2 / 60) = 0.18.
            assert!((0.45..1.65).contains(&mean), "{method:?} D{entry}: {mean}");
        }
    }
}

#[test]
fn two_recordings_are_worth_one_of_twice_the_length() {
    let plant = van_wingerden_one();
    for method in METHODS {
        let options = Options {
            order: Order::Fixed(4),
            past: Some(10),
            future: Some(6),
            ..plain(method)
        };
        let variance = |logs: &[Log]| {
            let model = identify(logs, &options).unwrap();
            let covariance = model.covariance.as_ref().unwrap();
            frequency_response_covariance(&model.system, covariance, 1.5).unwrap()[0][0][0]
        };
        let one = variance(&[plant.record(20_000, 1)]);
        let two = variance(&[plant.record(20_000, 1), plant.record(20_000, 2)]);
        let ratio = one / two;
        assert!((1.85..2.15).contains(&ratio), "{method:?}: {ratio}");
    }
}

/// Canonical variates do not see the units of the channels; the model changes with them as it must.
#[test]
fn units_do_not_matter() {
    let plant = van_wingerden_one();
    let log = plant.record(1500, 9);
    let mut other = log.clone();
    for value in &mut other.output_data[0] {
        *value *= 1e4;
    }
    for value in &mut other.input_data[1] {
        *value *= 1e-3;
    }
    for method in METHODS {
        let options = Options {
            order: Order::Fixed(4),
            past: Some(9),
            weight: Some(Weight::Cva),
            ..plain(method)
        };
        let one = identify(std::slice::from_ref(&log), &options).unwrap();
        let two = identify(std::slice::from_ref(&other), &options).unwrap();
        let (g, h) = (
            one.system.frequency_response(0.9),
            two.system.frequency_response(0.9),
        );
        for ((o, i), factor) in [((0, 0), 1e4), ((1, 0), 1.0), ((0, 1), 1e7), ((1, 1), 1e3)] {
            let error = (g[(o, i)] * factor - h[(o, i)]).norm() / h[(o, i)].norm();
            assert!(error < 1e-8, "{method:?}: {error:e}");
        }
    }
}

/// The jackknife re-estimates without each block, in the state basis of the whole.
#[test]
fn robust_covariance_agrees_with_the_formula() {
    let plant = van_wingerden_one();
    let log = plant.record(20_000, 3);
    for method in METHODS {
        for stochastic in [None, Some(Stochastic::Innovations)] {
            let deviation = |covariance| {
                let options = Options {
                    covariance,
                    stochastic,
                    order: Order::Fixed(4),
                    past: Some(10),
                    future: Some(6),
                    ..plain(method)
                };
                let model = identify(std::slice::from_ref(&log), &options).unwrap();
                let covariance = model.covariance.as_ref().unwrap();
                let of_input =
                    frequency_response_covariance(&model.system, covariance, 1.5).unwrap();
                let of_noise = noise_response_covariance(&model.system, covariance, 1.5).unwrap();
                [of_input, of_noise].map(|m| m.iter().map(|c| c[0][0] + c[1][1]).sum::<f64>())
            };
            let formula = deviation(CovarianceKind::Model);
            let blocks = deviation(CovarianceKind::Robust);
            for (one, two) in formula.iter().zip(&blocks) {
                let ratio = two / one;
                println!(
                    "{} {stochastic:?}: jackknife over formula {ratio:.2}",
                    method.name()
                );
                // 20 blocks: the variance of one entry has a relative standard error of 32 %, a sum less.
                assert!(
                    (0.4..2.2).contains(&ratio),
                    "{method:?} {stochastic:?}: {ratio}"
                );
            }
        }
    }
}

/// `K` by another step: the noise model is as good as is stated, and the deterministic part is untouched.
#[test]
fn stochastic_step_goes_with_any_method() {
    let plant = van_wingerden_one();
    for method in METHODS {
        let options = |stochastic| Options {
            stochastic,
            order: Order::Fixed(4),
            past: Some(10),
            future: Some(6),
            ..plain(method)
        };
        let ratios: Vec<f64> = (0..60_u64)
            .into_par_iter()
            .map(|seed| {
                let log = plant.record(10_000, 700 + seed);
                let own = identify(std::slice::from_ref(&log), &options(None)).unwrap();
                let step = Some(Stochastic::Innovations);
                let model = identify(&[log], &options(step)).unwrap();
                assert_eq!(own.system.a, model.system.a);
                assert_ne!(own.system.k, model.system.k);
                let covariance = model.covariance.as_ref().unwrap();
                let spread = noise_response_covariance(&model.system, covariance, 1.5).unwrap();
                let truth = plant.system.noise_response(1.5);
                let found = model.system.noise_response(1.5);
                let square: f64 = (0..4).map(|i| (found[i] - truth[i]).norm_sqr()).sum();
                square / spread.iter().map(|c| c[0][0] + c[1][1]).sum::<f64>()
            })
            .collect();
        let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
        println!(
            "{}: squared error of the noise response over variance {mean:.2}",
            method.name()
        );
        // Standard error of a mean of 60 with a few degrees of freedom each: about 0.12.
        assert!((0.65..1.4).contains(&mean), "{method:?}: {mean}");
    }
}
