//! The targets of `fuzz/` with drawn bytes, and what fuzzing has found.
//!
//! `fuzz/run.sh` searches longer, led by coverage and under the address sanitizer.

#[path = "hostile/mod.rs"]
mod hostile;

use std::io::Cursor;

use innovant::explain::{ExplainError, Simulation, explain};
use innovant::identify::{Method, Options, Order};
use innovant::internal::systems::{servo, two_by_two};
use innovant::log::{Log, LogError, Roles};
use innovant::report::{is_explanation, parse_explanation, parse_model};
use innovant::{IdentifyError, identify};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use serde_json::{Value, json};

fn bytes(most: usize) -> impl Strategy<Value = Vec<u8>> {
    prop::collection::vec(any::<u8>(), 0..most)
}

/// What fails is written below as a test with a name, and not into a file of seeds. The same bytes in every run: a search is what
/// `fuzz/run.sh` is for, or `PROPTEST_RNG_SEED` with another number.
fn config(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        rng_seed: match std::env::var("PROPTEST_RNG_SEED") {
            Ok(seed) => seed.parse().expect("PROPTEST_RNG_SEED is a number"),
            Err(_) => RngSeed::Fixed(6),
        },
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

proptest! {
    #![proptest_config(config(1500))]

    #[test]
    fn any_file_is_a_recording_or_refused(bytes in bytes(120)) {
        hostile::csv_reader(&bytes);
    }

    #[test]
    fn any_document_is_a_model_or_refused(bytes in bytes(120)) {
        hostile::model_json(&bytes);
    }
}

proptest! {
    #![proptest_config(config(400))]

    #[test]
    fn any_document_is_an_explanation_or_refused(bytes in bytes(160)) {
        hostile::explanation_json(&bytes);
    }

    #[test]
    fn any_small_log_is_identified_or_refused(bytes in bytes(240)) {
        hostile::identify(&bytes);
    }
}

proptest! {
    #![proptest_config(config(12))]

    #[test]
    fn any_small_log_is_explained_or_refused(bytes in bytes(160)) {
        hostile::explain(&bytes);
    }
}

// What was found. Each was a panic, a hang, an allocation beyond the bound of `fuzz/bound.rs`, or nonsense that was accepted.

/// A document's own words fill no screen: a format of 100 000 letters came back whole.
#[test]
fn messages_repeat_little_of_a_document() {
    let long = "x".repeat(100_000);
    for text in [
        json!({"format": long}).to_string(),
        json!({"A": long, "B": [], "C": [], "dt": 1}).to_string(),
        json!({&long: {&long: 1}, "A": {&long: 0}}).to_string(),
    ] {
        let message = parse_model("model.json", &text).unwrap_err().to_string();
        assert!(message.len() < 2000, "{} bytes", message.len());
    }
    let header = format!("{long},{long}2\n1,2\n");
    let read = Log::from_reader("run.csv", Cursor::new(header), &Roles::default());
    let message = read.unwrap_err().to_string();
    assert!(message.len() < 2000, "{} bytes", message.len());
}

/// Two rows of 50 000 columns took room for 16 384 rows, 6.5 GB, and a time that grew with the square of the columns.
#[test]
fn wide_files_take_memory_for_the_rows_they_have() {
    let columns = 50_000;
    let names: Vec<String> = (1..columns).map(|i| format!("u{i}")).collect();
    let row = vec!["1"; columns].join(",");
    let file = format!("{},y\n{row}\n{row}\n", names.join(","));
    let roles = Roles {
        sample_time: Some(1.0),
        ..Roles::default()
    };
    let log = Log::from_reader("wide.csv", Cursor::new(file), &roles).unwrap();
    assert_eq!((log.inputs.len(), log.samples()), (columns - 1, 2));
}

/// A sample time of 1e-300 s made frequencies infinite, and documents that were not read back.
#[test]
fn sample_times_are_those_of_some_clock() {
    let file = "t,u,y\n0,1,2\n1e-300,2,3\n2e-300,1,1\n";
    let read = Log::from_reader("run.csv", Cursor::new(file), &Roles::default());
    assert!(
        matches!(read, Err(LogError::InvalidSampleTime { .. })),
        "{read:?}"
    );
    for dt in [1e-300, 1e300] {
        let text = json!({"A": 0.5, "B": 1, "C": 1, "dt": dt}).to_string();
        let message = parse_model("model.json", &text).unwrap_err().to_string();
        assert!(message.contains("sample time"), "{message}");
    }
}

/// Eigenvalues of entries near the end of the range are no numbers: such a model is not described, rather than wrongly.
#[test]
fn models_at_the_end_of_the_range_are_not_described() {
    let large = f64::MAX;
    for a in [
        json!([[large, -large], [large, large]]),
        json!([
            [large, large, 0],
            [-large, large, large],
            [large, 0, -large]
        ]),
    ] {
        let n = a.as_array().unwrap().len();
        let text = json!({"A": a, "B": vec![[1.0]; n], "C": [vec![1.0; n]], "dt": 1}).to_string();
        hostile::parse_model(&text);
    }
}

/// A model of no inputs divided by their number; so did one of no outputs.
#[test]
fn recordings_of_one_side_are_refused() {
    let log = servo().record(100, 1);
    let answer = Log {
        inputs: Vec::new(),
        input_data: Vec::new(),
        ..log.clone()
    };
    let drive = Log {
        outputs: Vec::new(),
        output_data: Vec::new(),
        ..log.clone()
    };
    for log in [answer, drive] {
        for method in Method::all() {
            let options = Options {
                method: *method,
                ..Options::default()
            };
            let error = identify(std::slice::from_ref(&log), &options).unwrap_err();
            assert!(matches!(error, IdentifyError::NoChannel { .. }), "{error}");
        }
        let simulation = Simulation::Outputs(vec![log.clone()]);
        let decays = log.inputs.is_empty();
        let error = explain(&[log], &simulation, &Default::default()).unwrap_err();
        // Without inputs columns are explained by equations alone, and these are of a driven plant.
        let refused = match decays {
            true => matches!(error, ExplainError::NoEquations { .. }),
            false => matches!(error, ExplainError::NoChannels { .. }),
        };
        assert!(refused, "{error}");
    }
}

/// A future window longer than the past, which some methods allow, cut a matrix where it had no columns.
#[test]
fn methods_that_look_further_ahead_than_back() {
    let log = two_by_two().record(200, 1);
    for method in Method::all().iter().filter(|m| m.allows_longer_future()) {
        for order in [Order::Auto, Order::Fixed(1), Order::Compare(vec![1, 2])] {
            let options = Options {
                method: *method,
                order,
                past: Some(2),
                future: Some(6),
                ..Options::default()
            };
            hostile::run_identify(std::slice::from_ref(&log), &options);
        }
    }
}

/// No order to compare was an index into nothing; windows beyond any memory overflowed.
#[test]
fn options_far_out_of_bounds() {
    let log = two_by_two().record(200, 1);
    let refused = |options: Options| {
        let error = identify(std::slice::from_ref(&log), &options).unwrap_err();
        assert!(!error.to_string().is_empty());
    };
    refused(Options {
        order: Order::Compare(Vec::new()),
        ..Options::default()
    });
    for method in Method::all() {
        for size in [1_000_000_000, usize::MAX] {
            let of = |past, future, order| Options {
                method: *method,
                past,
                future,
                order,
                ..Options::default()
            };
            refused(of(Some(size), None, Order::Auto));
            refused(of(None, Some(size), Order::Auto));
            refused(of(Some(3), Some(size), Order::Fixed(1)));
            refused(of(None, None, Order::Fixed(size)));
        }
    }
}

/// The fields of a log are open: what is put there is looked at before it is used.
#[test]
fn logs_that_were_changed_by_hand_are_checked() {
    let log = servo().record(200, 1);
    let mut short = log.clone();
    short.output_data[0].truncate(10);
    let mut stray = log.clone();
    stray.input_data[0][7] = f64::NAN;
    let stopped = Log {
        sample_time: 0.0,
        ..log.clone()
    };
    for damaged in [short, stray, stopped] {
        let error = identify(std::slice::from_ref(&damaged), &Options::default()).unwrap_err();
        assert!(matches!(error, IdentifyError::Log(_)), "{error}");
        let simulation = Simulation::Outputs(vec![log.clone()]);
        let error = explain(&[damaged], &simulation, &Default::default()).unwrap_err();
        assert!(matches!(error, ExplainError::Log(_)), "{error}");
    }
}

/// Squares of 1e200 are infinite, and those of ever smaller ones at last none: fits and covariances were no numbers, and documents were
/// not read back.
#[test]
fn sizes_that_have_no_squares_are_refused() {
    for size in [1e200, 1e-100] {
        let mut log = servo().record(300, 1);
        log.output_data[0].iter_mut().for_each(|y| *y *= size);
        let error = identify(std::slice::from_ref(&log), &Options::default()).unwrap_err();
        assert!(matches!(error, IdentifyError::Size { .. }), "{error}");
        let simulation = Simulation::Outputs(vec![log.clone()]);
        let error = explain(&[log], &simulation, &Default::default()).unwrap_err();
        assert!(matches!(error, ExplainError::Size { .. }), "{error}");
    }
}

/// The samples in a window of 1e18 s were counted beyond the last number.
#[test]
fn windows_of_any_length() {
    let mut whole: Value = serde_json::from_str(include_str!("hostile/explanation.json")).unwrap();
    let quantity = json!({"value": 1.0, "std": null, "unit": ""});
    for window in [f64::MAX, 1e18, 1e-300, 0.0, -1.0] {
        whole["model"]["mechanics"] = json!({
            "reading": "position", "mass": quantity, "viscous_friction": quantity, "constant_force": quantity,
            "window": window, "sentence": "",
        });
        hostile::parse_explanation(&whole.to_string());
        assert_eq!(
            parse_explanation("e.json", &whole.to_string()).is_ok(),
            window > 0.0
        );
    }
}

/// An explanation whose model does not fit together was accepted, and a second output without a row of C was a panic.
#[test]
fn explanations_hold_models_that_fit_together() {
    let whole: Value = serde_json::from_str(include_str!("hostile/explanation.json")).unwrap();
    hostile::parse_explanation(&whole.to_string());
    hostile::parse_explanation(&format!("\u{feff}{whole}"));
    assert!(is_explanation(&format!("\u{feff}{whole}")));
    for (pointer, wrong) in [
        ("/model/outputs", json!([{"name": "y1"}, {"name": "y2"}])),
        ("/model/inputs", json!([])),
        ("/model/input_delays", json!([0, 1])),
        ("/model/initial_states", json!([[0.0]])),
        ("/model/A", json!([[1.0]])),
        ("/model/effects/0/parameters", json!([])),
        ("/model/effects/0/channel", json!(usize::MAX)),
        ("/model/effects/0/effect", json!("magic")),
        ("/model/sample_time", json!(-1.0)),
    ] {
        let mut damaged = whole.clone();
        *damaged.pointer_mut(pointer).unwrap() = wrong;
        let message = parse_explanation("e.json", &damaged.to_string())
            .unwrap_err()
            .to_string();
        assert!(message.contains("e.json, line 1"), "{pointer}: {message}");
    }
}

/// A covariance with no degrees of freedom, or with a variance below zero, was accepted, and its quantile was a panic.
#[test]
fn covariances_are_some() {
    let whole: Value = serde_json::from_str(include_str!("hostile/model.json")).unwrap();
    hostile::parse_model(&whole.to_string());
    for (key, wrong) in [
        ("degrees_of_freedom", json!(0.0)),
        ("degrees_of_freedom", json!(-3.0)),
        ("degrees_of_freedom", json!(1e300)),
        ("scale", json!(-1.0)),
    ] {
        let mut damaged = whole.clone();
        damaged["covariance"][key] = wrong;
        let text = damaged.to_string();
        if parse_model("model.json", &text).is_ok() {
            panic!("{key} of {} was accepted", damaged["covariance"][key]);
        }
    }
}

/// Damaged gzip data were said to be UTF-16 when they came in small pieces.
#[test]
fn damage_is_named_before_what_it_looks_like() {
    hostile::csv_reader(&[0x07, 0x00, 0xFF, 0x2C, 0x08, 0x00, 0x00, 0x00]);
}

/// A part of a recording was infinitely many times as far off as the rest, which is no number of a document.
#[test]
fn what_is_off_in_one_part_only_is_said_in_numbers() {
    hostile::explain(include_bytes!(
        "hostile/found/explain_nothing_to_compare_with"
    ));
}

/// Steps of a recording whose signals are next to dependent biased its model by what is no number.
#[test]
fn rounding_that_biases_without_bound_is_said_in_numbers() {
    hostile::identify(include_bytes!(
        "hostile/found/identify_rounding_without_bound"
    ));
}

/// A simulation none of whose states shows in an output panicked.
#[test]
fn states_that_no_output_sees_are_left_out() {
    hostile::explain(include_bytes!(
        "hostile/found/explain_states_that_no_output_sees"
    ));
}

/// A model came with a covariance that was beyond the range of numbers.
#[test]
fn a_covariance_beyond_the_range_is_refused() {
    hostile::identify(include_bytes!(
        "hostile/found/identify_covariance_beyond_the_range"
    ));
}
