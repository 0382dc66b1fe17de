//! What must not change the answer: units, state basis, order of experiments, the way a recording was cut
//! into files or blocks; and what must be found exactly.

use innovant::covariance::frequency_response_covariance;
use innovant::identify::Detrend;
use innovant::identify::{Method, Order, Polish, Weight};
use innovant::internal::systems::{TestSystem, servo, two_by_two, van_wingerden_one};
use innovant::log::Log;
use innovant::model::StateSpace;
use innovant::{IdentifyError, Model, Options, identify};
use nalgebra::DMatrix;
use proptest::prelude::*;

fn fixed(order: usize, past: usize) -> Options {
    Options {
        order: Order::Fixed(order),
        past: Some(past),
        ..Options::default()
    }
}

/// Largest relative difference of frequency responses and of their covariances.
fn difference(
    a: &Model,
    b: &Model,
    frequencies: &[f64],
    scale: impl Fn(usize, usize) -> f64,
) -> f64 {
    let mut largest = 0.0_f64;
    for &w in frequencies {
        let (ga, gb) = (
            a.system.frequency_response(w),
            b.system.frequency_response(w),
        );
        let va =
            frequency_response_covariance(&a.system, a.covariance.as_ref().unwrap(), w).unwrap();
        let vb =
            frequency_response_covariance(&b.system, b.covariance.as_ref().unwrap(), w).unwrap();
        for i in 0..ga.nrows() {
            for j in 0..ga.ncols() {
                let s = scale(i, j);
                largest =
                    largest.max((gb[(i, j)] - ga[(i, j)] * s).norm() / (ga[(i, j)] * s).norm());
                let trace = |v: &[[f64; 2]; 2]| v[0][0] + v[1][1];
                let expected = trace(&va[(i, j)]) * s * s;
                largest = largest.max((trace(&vb[(i, j)]) - expected).abs() / expected);
            }
        }
    }
    largest
}

const FREQUENCIES: [f64; 4] = [0.1, 0.7, 1.5, 2.5];

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    /// Units of the channels, from 1e-9 to 1e9, and offsets up to a million times the signal.
    #[test]
    fn units_and_offsets_do_not_matter(
        powers in prop::array::uniform4(-9.0..9.0_f64),
        offsets in prop::array::uniform4(-1e6..1e6_f64),
    ) {
        let log = van_wingerden_one().record(1500, 11);
        let mut scaled = log.clone();
        for (c, column) in scaled.input_data.iter_mut().chain(&mut scaled.output_data).enumerate() {
            for value in column.iter_mut() {
                *value = (*value + offsets[c]) * 10_f64.powf(powers[c]);
            }
        }
        // The polish ends at the same minimum whatever the weight it started from.
        let a = identify(&[log], &fixed(4, 12)).unwrap();
        let b = identify(&[scaled], &fixed(4, 12)).unwrap();
        let scale = |i: usize, j: usize| 10_f64.powf(powers[2 + i] - powers[j]);
        let error = difference(&a, &b, &FREQUENCIES, scale);
        prop_assert!(error < 1e-4, "{error:e}");
        prop_assert_eq!(a.system.states(), b.system.states());
    }

    /// Knudsen's weights are made of the outputs as they are; scaling every channel to unit rms takes their units out.
    #[test]
    fn units_of_the_outputs_do_not_matter_to_the_deterministic_part_of_knudsen(
        powers in prop::array::uniform4(-6.0..6.0_f64),
    ) {
        let log = two_by_two().record(1200, 7);
        let mut scaled = log.clone();
        for (column, power) in scaled.input_data.iter_mut().chain(&mut scaled.output_data).zip(powers) {
            column.iter_mut().for_each(|value| *value *= 10_f64.powf(power));
        }
        for method in [Method::Knudsen, Method::Subid] {
            let options = Options { method, ..fixed(3, 20) };
            let a = identify(std::slice::from_ref(&log), &options).unwrap();
            let b = identify(std::slice::from_ref(&scaled), &options).unwrap();
            let scale = |i: usize, j: usize| 10_f64.powf(powers[2 + i] - powers[j]);
            let error = difference(&a, &b, &[0.05, 0.3, 1.0], scale);
            prop_assert!(error < 1e-6, "{}: {error:e}", method.name());
        }
    }

    /// Order of the experiments, and of the channels.
    #[test]
    fn order_of_experiments_does_not_matter(seeds in prop::array::uniform3(0_u64..1000)) {
        let logs: Vec<Log> = seeds.iter().map(|s| two_by_two().record(700, *s)).collect();
        let turned = vec![logs[2].clone(), logs[0].clone(), logs[1].clone()];
        let options = Options { polish: Polish::Never, weight: Some(Weight::Cva), ..fixed(3, 8) };
        let a = identify(&logs, &options).unwrap();
        let b = identify(&turned, &options).unwrap();
        let error = difference(&a, &b, &[0.05, 0.3, 1.0], |_, _| 1.0);
        prop_assert!(error < 1e-9, "{error:e}");
    }
}

#[test]
fn channels_in_another_order_give_the_same_model() {
    let log = van_wingerden_one().record(1500, 5);
    let mut swapped = log.clone();
    swapped.input_data.swap(0, 1);
    swapped.output_data.swap(0, 1);
    let a = identify(&[log], &fixed(4, 10)).unwrap();
    let b = identify(&[swapped], &fixed(4, 10)).unwrap();
    for w in FREQUENCIES {
        let (ga, gb) = (
            a.system.frequency_response(w),
            b.system.frequency_response(w),
        );
        for i in 0..2 {
            for j in 0..2 {
                assert!((ga[(i, j)] - gb[(1 - i, 1 - j)]).norm() < 1e-6 * ga[(i, j)].norm());
            }
        }
    }
}

/// A noise-free record of a linear system is identified to rounding, whatever its order.
#[test]
fn noise_free_recordings_are_identified_exactly() {
    for plant in [servo(), two_by_two(), van_wingerden_one()] {
        let quiet = TestSystem {
            innovation_covariance: DMatrix::zeros(plant.system.outputs(), plant.system.outputs()),
            feedback: DMatrix::zeros(plant.system.inputs(), plant.system.outputs()),
            ..plant
        };
        let options = Options {
            detrend: Detrend::None,
            ..Options::default()
        };
        let model = identify(&[quiet.record(1000, 3)], &options).unwrap();
        let truth = &quiet.system;
        assert_eq!(model.system.states(), truth.states());
        for share in [0.01, 0.1, 0.5, 0.9] {
            let w = share * std::f64::consts::PI / truth.sample_time;
            let (g, expected) = (
                model.system.frequency_response(w),
                truth.frequency_response(w),
            );
            let error = (&g - &expected).norm() / expected.norm();
            assert!(
                error < 1e-6,
                "{} states, {share}: {error:e}",
                truth.states()
            );
        }
    }
}

#[test]
fn known_delays_are_taken_out_and_kept() {
    let mut log = two_by_two().record(3000, 7);
    let prompt = identify(std::slice::from_ref(&log), &fixed(3, 12)).unwrap();
    // Delay the inputs' effect by advancing the recorded inputs: u_recorded[k - 4] acts at k.
    for (input, delay) in log.input_data.iter_mut().zip([4, 1]) {
        input.drain(..delay);
        input.extend(std::iter::repeat_n(0.0, delay));
    }
    let samples = 2996;
    for column in log.input_data.iter_mut().chain(&mut log.output_data) {
        column.truncate(samples);
    }
    let options = Options {
        input_delay: vec![4, 1],
        ..fixed(3, 12)
    };
    let delayed = identify(&[log], &options).unwrap();
    assert_eq!(delayed.inputs[0].delay, 4);
    assert_eq!(delayed.inputs[1].delay, 1);
    for w in [0.02, 0.2, 1.0] {
        let (a, b) = (
            prompt.system.frequency_response(w),
            delayed.system.frequency_response(w),
        );
        assert!((&a - &b).norm() < 0.02 * a.norm());
    }
}

/// A slow plant whose estimate comes out unstable in some records: `stable` keeps it inside the circle, says
/// what it cost, and stays near the free estimate where that is stable.
#[test]
fn stable_models_are_stable_and_say_what_it_cost() {
    let plant = TestSystem {
        system: StateSpace {
            a: DMatrix::from_row_slice(2, 2, &[0.9995, 0.05, 0.0, 0.8]),
            b: DMatrix::from_row_slice(2, 1, &[0.1, 1.0]),
            c: DMatrix::from_row_slice(1, 2, &[1.0, 0.0]),
            d: DMatrix::zeros(1, 1),
            k: DMatrix::from_row_slice(2, 1, &[0.4, 0.1]),
            sample_time: 1.0,
        },
        innovation_covariance: DMatrix::from_element(1, 1, 0.5),
        feedback: DMatrix::zeros(1, 1),
    };
    let mut made_stable = 0;
    for seed in 0..25 {
        let log = plant.record(300, seed);
        let free = identify(std::slice::from_ref(&log), &fixed(2, 8)).unwrap();
        let options = Options {
            stable: true,
            ..fixed(2, 8)
        };
        let stable = identify(&[log], &options).unwrap();
        let radius = stable.summary.as_ref().unwrap().diagnostics.spectral_radius;
        assert!(radius < 1.0, "seed {seed}: {radius}");
        let free_radius = free.summary.as_ref().unwrap().diagnostics.spectral_radius;
        let cost = &stable.summary.as_ref().unwrap().diagnostics.stability;
        if free_radius < 0.99 {
            assert!(cost.is_none());
            assert_eq!(free.system, stable.system);
        }
        if free_radius >= 1.0 {
            made_stable += 1;
            let cost = cost.as_ref().unwrap();
            assert!(cost.spectral_radius_before >= 1.0 && cost.chi_square_increase.is_finite());
            // The plant is stable, so the data cannot object much: chi-square with one degree of freedom.
            assert!(cost.chi_square_increase < 20.0, "seed {seed}: {cost:?}");
        }
    }
    assert!(made_stable > 0, "no record of these came out unstable");
}

#[test]
fn direct_feedthrough_is_estimated_when_asked() {
    let mut plant = two_by_two();
    plant.system.d = DMatrix::from_row_slice(2, 2, &[0.5, 0.0, -0.3, 0.2]);
    let options = Options {
        feedthrough: true,
        ..fixed(3, 12)
    };
    let model = identify(&[plant.record(4000, 9)], &options).unwrap();
    let layout = model.covariance.as_ref().unwrap().layout;
    for i in 0..4 {
        let index = layout.d() + i;
        let deviation = model.covariance.as_ref().unwrap().matrix[(index, index)].sqrt();
        let error = (model.system.d[i] - plant.system.d[i]).abs();
        assert!(
            error < 4.0 * deviation && deviation < 0.05,
            "{i}: {error} {deviation}"
        );
    }
}

const METHODS: [Method; 5] = [
    Method::PbsidOpt,
    Method::Whitening,
    Method::InnovationEstimation,
    Method::Knudsen,
    Method::Subid,
];

/// The number of samples that is asked for is the least that will do.
#[test]
fn as_many_samples_as_are_asked_for_suffice() {
    let plants = [(van_wingerden_one(), 12), (two_by_two(), 9)];
    for ((plant, past), method, feedthrough) in plants.iter().flat_map(|plant| {
        METHODS
            .iter()
            .flat_map(move |method| [false, true].map(|direct| (plant, *method, direct)))
    }) {
        let what = format!("{method:?} {past} {feedthrough}");
        let options = Options {
            method,
            feedthrough,
            // A covariance from blocks would ask for more.
            polish: Polish::Always,
            ..fixed(1, *past)
        };
        let of = |samples: usize| identify(&[plant.record(samples, 2)], &options);
        let mut samples = 2 * past;
        let model = loop {
            match of(samples) {
                Ok(model) => break model,
                Err(
                    IdentifyError::TooShort { needed, .. }
                    | IdentifyError::TooShortForWindows { needed, .. },
                ) => {
                    assert!(needed > samples, "{what}: {needed} {samples}");
                    assert!(of(needed - 1).is_err(), "{what}: {needed}");
                    samples = needed;
                }
                Err(other) => panic!("{what}: {samples}: {other}"),
            }
        };
        let warnings = model.summary.unwrap().warnings;
        assert!(
            warnings.iter().any(|w| w.starts_with("short recording")),
            "{what}: {warnings:?}"
        );
    }
}

/// A warning that always comes is not read.
#[test]
fn good_recordings_bring_no_warnings() {
    for plant in [van_wingerden_one(), two_by_two(), servo()] {
        for seed in 0..3 {
            let model = identify(&[plant.record(4000, seed)], &Options::default()).unwrap();
            assert_eq!(model.summary.unwrap().warnings, [""; 0]);
        }
    }
}

/// What a past window that is too short does to the answer is said, of the answer that was given.
#[test]
fn short_past_windows_are_warned_of() {
    let said = [
        "is too short for the noise dynamics",
        "cuts off a part of the noise dynamics",
        "not polished to maximum likelihood",
    ];
    let mut met = [0; 3];
    let plants = [(van_wingerden_one(), 2), (two_by_two(), 3), (servo(), 4)];
    for ((plant, order), past) in plants
        .iter()
        .flat_map(|p| (4..25).step_by(2).map(move |past| (p, past)))
    {
        for polish in [Polish::Auto, Polish::Always, Polish::Never] {
            let options = Options {
                polish,
                ..fixed(*order, past)
            };
            let log = plant.record(4000, 1);
            let summary = identify(&[log], &options).unwrap().summary.unwrap();
            let lost = summary.diagnostics.truncation.unwrap();
            let expected = match polish {
                _ if lost > 100.0 => Some(0),
                _ if lost <= 1.0 => None,
                _ if summary.polished => Some(1),
                Polish::Auto => Some(2),
                Polish::Always | Polish::Never => None,
            };
            for (i, words) in said.iter().enumerate() {
                let warned = summary.warnings.iter().any(|w| w.contains(words));
                assert_eq!(
                    warned,
                    expected == Some(i),
                    "{past} {polish:?} {lost}: {words}"
                );
            }
            if let Some(i) = expected {
                met[i] += 1;
            }
        }
    }
    assert!(met.iter().all(|n| *n > 0), "{met:?}");
    // As many states as the window has outputs: the model is the regression, and sees nothing cut off.
    let log = van_wingerden_one().record(4000, 1);
    let summary = identify(&[log], &fixed(2, 1)).unwrap().summary.unwrap();
    assert!(summary.diagnostics.truncation.unwrap() < 1e-9);
    let words = "cannot tell what the window cuts off";
    assert!(summary.warnings.iter().any(|w| w.contains(words)));
}

#[test]
fn impossible_requests_are_refused_with_a_reason() {
    let log = van_wingerden_one().record(400, 1);
    let refused = |options: Options| identify(std::slice::from_ref(&log), &options).unwrap_err();
    assert!(matches!(
        refused(Options {
            past: Some(100),
            ..Options::default()
        }),
        IdentifyError::TooShort { .. }
    ));
    assert!(matches!(
        refused(Options {
            past: Some(5),
            future: Some(6),
            ..Options::default()
        }),
        IdentifyError::Horizon { .. }
    ));
    assert!(matches!(
        refused(fixed(11, 5)),
        IdentifyError::Order { largest: 10, .. }
    ));
    assert!(matches!(refused(fixed(0, 5)), IdentifyError::Order { .. }));
    assert!(matches!(
        refused(Options {
            past: Some(usize::MAX),
            ..Options::default()
        }),
        IdentifyError::Limit(_)
    ));
    let mut same = log.clone();
    same.output_data[1] = same.input_data[0].iter().map(|u| 3.0 * u - 7.0).collect();
    assert!(matches!(
        identify(&[same], &Options::default()).unwrap_err(),
        IdentifyError::SameChannel { .. }
    ));
}
