//! What the judgement holds, whatever the data.

use super::support::*;
use crate::covariance::ParameterCovariance;
use crate::model::StateSpace;
use crate::systems::{two_by_two, van_wingerden_one};
use crate::validate::Relation::{Estimation, Fresh};
use crate::validate::{RecordView, ValidateError, Validation, ValidationOptions, validate};
use nalgebra::{DMatrix, dmatrix};

/// Moves a fit to the state basis `T x`: parameters and covariance together.
fn moved(
    system: &StateSpace,
    covariance: &ParameterCovariance,
    t: &DMatrix<f64>,
) -> (StateSpace, ParameterCovariance) {
    let transformed = system.transformed(t).unwrap();
    let layout = covariance.layout;
    let theta = layout.pack(system);
    let order = layout.len();
    // The map is linear in theta: its columns are the images of the unit vectors.
    let image = |theta: &[f64]| {
        let mut unit = layout.unpack(theta, system);
        unit.sample_time = 1.0;
        layout.pack(&unit.transformed(t).unwrap())
    };
    let jacobian = DMatrix::from_fn(order, order, |i, j| {
        let mut unit = vec![0.0; order];
        unit[j] = 1.0;
        image(&unit)[i]
    });
    assert_eq!(theta.len(), order);
    let matrix = &jacobian * &covariance.matrix * jacobian.transpose();
    let covariance = ParameterCovariance {
        layout,
        matrix,
        degrees_of_freedom: covariance.degrees_of_freedom,
    };
    (transformed, covariance)
}

#[test]
fn the_state_basis_does_not_matter() {
    let plant = van_wingerden_one();
    let log = plant.record(1000, 5);
    let fresh = plant.record(1000, 6);
    let fit = identified(&log, 4);
    let t =
        dmatrix![2.0, 0.3, 0.0, 0.1; -0.2, 1.0, 0.4, 0.0; 0.0, 0.5, 3.0, -0.3; 0.2, 0.0, 0.1, 0.5];
    let (system, covariance) = moved(&fit.system, &fit.covariance, &t);
    for (log, relation) in [(&log, Estimation), (&fresh, Fresh)] {
        let judge = |system: &StateSpace, covariance: &ParameterCovariance| {
            let stated = Some(&fit.innovation_covariance);
            judged(system, stated, Some(covariance), log, &fit.levels, relation)
        };
        let (a, b) = (
            judge(&fit.system, &fit.covariance),
            judge(&system, &covariance),
        );
        for (a, b) in [
            (&a.whiteness, &b.whiteness),
            (&a.past_inputs, &b.past_inputs),
        ] {
            let (a, b) = (a.as_ref().unwrap(), b.as_ref().unwrap());
            assert_eq!(a.degrees_of_freedom, b.degrees_of_freedom);
            // The inflation on fresh records comes from models drawn along other eigenvectors.
            let (a, b) = (
                a.statistic * a.variance_inflation,
                b.statistic * b.variance_inflation,
            );
            assert!((a / b - 1.0).abs() < 0.02, "{a} {b}");
        }
    }
}

fn finite(value: &serde_json::Value, optional: &[&str]) {
    match value {
        serde_json::Value::Object(map) => {
            for (key, value) in map {
                assert!(
                    !value.is_null() || optional.contains(&key.as_str()),
                    "{key}"
                );
                finite(value, optional);
            }
        }
        serde_json::Value::Array(list) => list.iter().for_each(|v| finite(v, optional)),
        _ => {}
    }
}

/// JSON writes NaN and infinity as null.
fn check_document(validation: &Validation, optional: &[&str]) {
    let text = serde_json::to_string(validation).unwrap();
    finite(&serde_json::from_str(&text).unwrap(), optional);
    assert_eq!(
        &serde_json::from_str::<Validation>(&text).unwrap(),
        validation
    );
}

#[test]
fn the_document_has_numbers_only() {
    let plant = two_by_two();
    let fit = identified(&plant.record(6000, 1), 3);
    for relation in [Estimation, Fresh] {
        let v = judged_fit(
            &fit,
            &plant.record(6000, if relation == Fresh { 2 } else { 1 }),
            relation,
        );
        check_document(&v, &["free_run_unavailable"]);
        assert_eq!(v.autocorrelation.len(), 4);
        assert_eq!(v.cross_correlation.len(), 4);
        assert_eq!(v.cross_correlation[0].values.len(), v.lags);
        assert_eq!(v.findings[0], "the residuals are white at the 1 % level");
        let (one, free) = (v.one_step.fit_percent, v.free_run.unwrap().fit_percent);
        assert!(one > free && free > 50.0 && one < 100.0);
    }
}

#[test]
fn unstable_models_have_no_free_run() {
    let mut plant = two_by_two();
    plant.system = StateSpace::new(
        dmatrix![1.05],
        dmatrix![1.0],
        dmatrix![1.0],
        dmatrix![0.0],
        dmatrix![0.4],
        1.0,
    )
    .unwrap();
    plant.innovation_covariance = dmatrix![0.1];
    plant.feedback = dmatrix![-0.3];
    let log = plant.record(800, 3);
    let v = judged(&plant.system, None, None, &log, &[], Fresh);
    assert!(!v.rejected && v.free_run.is_none());
    check_document(&v, &["free_run", "innovation_size"]);
    assert!(v.free_run_unavailable.unwrap().contains("unstable"));
    let (u, y): (Vec<&[f64]>, Vec<&[f64]>) = (
        log.input_data.iter().map(Vec::as_slice).collect(),
        log.output_data.iter().map(Vec::as_slice).collect(),
    );
    let record = RecordView {
        inputs: &u,
        outputs: &y,
    };
    let error = validate(
        &bare(&plant),
        None,
        None,
        &[record],
        Fresh,
        &ValidationOptions::default(),
    );
    assert!(matches!(
        error,
        Err(ValidateError::PredictorDiverges { .. })
    ));
}

#[test]
fn records_without_noise_and_inputs_that_rest() {
    let mut plant = two_by_two();
    plant.innovation_covariance.fill(0.0);
    let v = judged(&plant.system, None, None, &plant.record(600, 1), &[], Fresh);
    assert!(!v.rejected && v.whiteness.is_none() && v.one_step.fit_percent > 99.999_999);
    check_document(
        &v,
        &[
            "whiteness",
            "past_inputs",
            "same_sample",
            "feedback",
            "innovation_size",
            "free_run_unavailable",
        ],
    );

    let plant = two_by_two();
    let still = plant.record_with(
        800,
        2,
        |_, channel, white| {
            if channel == 0 { white } else { 0.0 }
        },
    );
    let v = judged(&plant.system, None, None, &still, &[], Fresh);
    assert!(!v.rejected);
    assert_eq!(
        v.past_inputs.as_ref().unwrap().degrees_of_freedom,
        2 * v.lags
    );
    // One sine a channel: sines, cosines and a constant are all they offer, however many lags.
    let sine = plant.record_with(800, 2, |k, channel, _| {
        (0.3 * (channel + 1) as f64 * k as f64).sin()
    });
    let v = judged(&plant.system, None, None, &sine, &[], Fresh);
    assert!(!v.rejected, "{:?}", v.findings);
    assert!(v.past_inputs.as_ref().unwrap().degrees_of_freedom <= 10);
    check_document(
        &v,
        &[
            "same_sample",
            "feedback",
            "innovation_size",
            "free_run_unavailable",
        ],
    );
}

#[test]
fn several_records_count_as_one() {
    let plant = two_by_two();
    let logs = [
        plant.record(700, 1),
        plant.record(300, 2),
        plant.record(900, 3),
    ];
    let columns: Vec<[Vec<&[f64]>; 2]> = logs
        .iter()
        .map(|log| {
            [
                log.input_data.iter().map(Vec::as_slice).collect(),
                log.output_data.iter().map(Vec::as_slice).collect(),
            ]
        })
        .collect();
    let records: Vec<RecordView<'_>> = columns
        .iter()
        .map(|[inputs, outputs]| RecordView { inputs, outputs })
        .collect();
    let fit = identified(&plant.record(3000, 9), 3);
    let v = validate(
        &fit.system,
        Some(&fit.innovation_covariance),
        Some(&fit.covariance),
        &records,
        Fresh,
        &ValidationOptions::default(),
    )
    .unwrap();
    assert_eq!(v.samples, 1900);
    assert!(v.tested_samples < 1900 && !v.rejected);
}

#[test]
fn data_that_cannot_be_judged() {
    let plant = two_by_two();
    let run = |u: &[&[f64]], y: &[&[f64]], options: &ValidationOptions| {
        let record = RecordView {
            inputs: u,
            outputs: y,
        };
        validate(&plant.system, None, None, &[record], Fresh, options)
            .unwrap_err()
            .to_string()
    };
    let default = ValidationOptions::default();
    let wave: Vec<f64> = (0..400).map(|k| (k as f64).sin()).collect();
    let flat = vec![2.5; 400];
    let mut holed = wave.clone();
    holed[7] = f64::NAN;
    let w = wave.as_slice();
    assert_eq!(
        run(&[w, w], &[w, &flat], &default),
        "output y2 is constant in the recording: there is nothing that a model could explain; leave it \
         out or use a recording in which it moves"
    );
    assert_eq!(
        run(&[w, &holed], &[w, w], &default),
        "u2 holds NaN at sample 8 of recording 1 (counted from 1)"
    );
    assert!(run(&[w, w], &[w, &w[..9]], &default).contains("has 9 samples"));
    assert!(run(&[w], &[w, w], &default).contains("the model has 2 inputs"));
    let short = [&w[..12], &w[..12]];
    assert!(run(&short, &short, &default).contains("too few"));
    let many = ValidationOptions {
        lags: Some(usize::MAX / 2),
        ..ValidationOptions::default()
    };
    assert!(run(&[w, w], &[w, w], &many).contains("fewer lags"));
    let level = ValidationOptions {
        level: 5.0,
        ..ValidationOptions::default()
    };
    assert!(run(&[w, w], &[w, w], &level).contains("between 0 and 0.5"));
    assert!(run(&[], &[], &default).contains("no recording"));
}
