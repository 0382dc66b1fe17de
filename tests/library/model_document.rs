//! The document `innovant-model/1`: round trips, and the published schema.

use innovant::identify::{CovarianceKind, Order};
use innovant::internal::systems;
use innovant::report::{ModelDocument, parse_model, schema};
use innovant::{Model, Options, identify};
use serde_json::Value;

/// Models of every kind.
fn models() -> Vec<(&'static str, Model)> {
    let identified = |system: &systems::TestSystem, options: &Options| {
        identify(&[system.record(1500, 11)], options).unwrap()
    };
    let mut direct = systems::servo();
    direct.system.d[(0, 0)] = 0.2;
    vec![
        (
            "default",
            identified(&systems::van_wingerden_one(), &Options::default()),
        ),
        (
            "with D",
            identified(
                &direct,
                &Options {
                    feedthrough: true,
                    ..Options::default()
                },
            ),
        ),
        (
            "robust",
            identified(
                &systems::two_by_two(),
                &Options {
                    covariance: CovarianceKind::Robust,
                    ..Options::default()
                },
            ),
        ),
        (
            "compared, delayed, stable",
            identified(
                &systems::servo(),
                &Options {
                    order: Order::Compare(vec![2, 3, 4]),
                    input_delay: vec![1],
                    stable: true,
                    ..Options::default()
                },
            ),
        ),
        (
            "bare",
            parse_model(
                "bare",
                r#"{"A": [[0.5, 0], [0, 1]], "B": [[1], [0]], "C": [[1, 1]], "dt": 2}"#,
            )
            .unwrap()
            .model,
        ),
        (
            "a gain",
            parse_model(
                "gain",
                r#"{"A": [], "B": [], "C": [[]], "D": [[2, 3]], "dt": 2}"#,
            )
            .unwrap()
            .model,
        ),
    ]
}

#[test]
fn documents_are_read_back_bit_by_bit() {
    for (name, model) in models() {
        let text = ModelDocument::new(&model).unwrap().to_json().unwrap();
        let read = parse_model(name, &text).unwrap();
        assert_eq!(read.model, model, "{name}");
        assert_eq!(read.document.to_json().unwrap(), text, "{name}");
        assert!(!text.contains("NaN") && !text.contains("inf"), "{name}");
    }
}

#[test]
fn documents_keep_to_the_schema() {
    let schema: Value = serde_json::from_str(&schema::<ModelDocument>().unwrap()).unwrap();
    let validator = jsonschema::draft202012::new(&schema).unwrap();
    for (name, model) in models() {
        let text = ModelDocument::new(&model).unwrap().to_json().unwrap();
        let document: Value = serde_json::from_str(&text).unwrap();
        let errors: Vec<String> = validator
            .iter_errors(&document)
            .map(|error| format!("{}: {error}", error.instance_path()))
            .collect();
        assert!(errors.is_empty(), "{name}: {errors:?}");
    }
    // And it is not a schema that anything keeps to.
    let text = ModelDocument::new(&models()[0].1)
        .unwrap()
        .to_json()
        .unwrap();
    let document: Value = serde_json::from_str(&text).unwrap();
    for (key, wrong) in [
        ("format", "innovant-model/2".into()),
        ("A", 3.into()),
        ("outputs", Value::Null),
        ("covariance", Value::String("none".into())),
    ] {
        let mut spoilt = document.clone();
        spoilt[key] = wrong;
        assert!(!validator.is_valid(&spoilt), "{key}");
    }
}

#[test]
fn models_print_well() {
    for (name, model) in models() {
        let text = model.to_string();
        assert!(text.starts_with("Order "), "{name}: {text}");
        assert!(
            text.lines().all(|line| line.chars().count() <= 100),
            "{name}: {text}"
        );
        assert!(text.is_ascii(), "{name}: {text}");
    }
}
