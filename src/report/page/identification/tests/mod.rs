//! The page of a model.

use super::super::tests::{is_sound, opens_offline, own};
use super::identification_page;
use crate::identify::{MemoryRecords, Model, Options, Order, identify_records};
use crate::log::Log;
use crate::report::{Overview, Watched};
use crate::systems::van_wingerden_one;
use crate::validate::{RecordView, Relation, Validation, ValidationOptions, validate};

fn identified(log: Log, order: Order) -> (Model, Validation, Overview) {
    let options = Options {
        order,
        ..Options::default()
    };
    let logs = [log];
    let mut records = MemoryRecords::new(&logs).unwrap();
    let mut watched = Watched::new(&mut records);
    let model = identify_records(&mut watched, &options).unwrap();
    let overview = watched.overview();
    let centred = |columns: &[Vec<f64>]| -> Vec<Vec<f64>> {
        let mean = |c: &[f64]| c.iter().sum::<f64>() / c.len() as f64;
        let columns = columns.iter();
        columns
            .map(|c| c.iter().map(|v| v - mean(c)).collect())
            .collect()
    };
    let (inputs, outputs) = (centred(&logs[0].input_data), centred(&logs[0].output_data));
    let slices = |columns: &'_ [Vec<f64>]| columns.iter().map(|c| c.to_vec()).collect::<Vec<_>>();
    let (inputs, outputs) = (slices(&inputs), slices(&outputs));
    let inputs: Vec<&[f64]> = inputs.iter().map(Vec::as_slice).collect();
    let outputs: Vec<&[f64]> = outputs.iter().map(Vec::as_slice).collect();
    let tests = validate(
        &model.system,
        model.innovation_covariance.as_ref(),
        model.covariance.as_ref(),
        &[RecordView {
            inputs: &inputs,
            outputs: &outputs,
        }],
        Relation::Estimation,
        &ValidationOptions {
            input_names: logs[0].inputs.iter().map(|c| c.name.clone()).collect(),
            output_names: logs[0].outputs.iter().map(|c| c.name.clone()).collect(),
            ..ValidationOptions::default()
        },
    )
    .unwrap();
    (model, tests, overview)
}

#[test]
fn a_page_has_everything_and_loads_nothing() {
    let (model, tests, overview) = identified(van_wingerden_one().record(1500, 1), Order::Auto);
    let page = identification_page(&model, Some(&tests), Some(&overview)).unwrap();
    opens_offline("identification", &page);
    is_sound("identification", &page);
    let own = own(&page);
    for id in [
        "answer",
        "order",
        "frequency",
        "poles",
        "step",
        "residuals",
        "recordings",
        "provenance",
    ] {
        assert!(own.contains(&format!("<section id=\"{id}\"")), "{id}");
    }
    // The verdict is the first thing said.
    assert!(own.find("<h1").unwrap() < own.find("id=\"order\" ").unwrap());
    assert!(own.contains("The residuals are white"));
    // Magnitude, phase and step of four paths, three kinds of evidence, four and four correlations, map, spectrum and
    // four channels.
    let pictures = own.matches("class=\"drawing\"").count();
    assert!(
        (4 * 3 + 3 + 8 + 1 + 1 + 4..=4 * 3 + 3 + 8 + 2 + 1 + 4).contains(&pictures),
        "{pictures}"
    );
    for words in [
        "95 %",
        "99 %",
        "Magnitude",
        "Singular values",
        "What excites the plant",
    ] {
        assert!(own.contains(words), "{words}");
    }
}

#[test]
fn a_model_alone_is_a_page_too() {
    let (mut model, ..) = identified(van_wingerden_one().record(800, 2), Order::Fixed(2));
    model.covariance = None;
    model.summary = None;
    let page = identification_page(&model, None, None).unwrap();
    is_sound("bare", &page);
    let own = own(&page);
    assert!(own.contains("Not tested"));
    for id in ["order", "residuals", "recordings"] {
        assert!(!own.contains(&format!("<section id=\"{id}\"")), "{id}");
    }
}

#[test]
fn a_rejected_model_says_so_first() {
    let (model, tests, overview) = identified(van_wingerden_one().record(1500, 3), Order::Fixed(1));
    assert!(tests.rejected);
    let page = identification_page(&model, Some(&tests), Some(&overview)).unwrap();
    is_sound("rejected", &page);
    let own = own(&page);
    assert!(own.contains("class=\"is-doubtful\"") && own.contains("Rejected, the recording"));
    assert!(own.contains("beyond"));
}

#[test]
fn what_comes_from_files_is_escaped() {
    let evil = "<script>alert(1)</script><!-- & \"quoted\" 'single' onload=\"z\"";
    let mut log = van_wingerden_one().record(600, 4);
    log.name = evil.to_owned();
    for channel in log.inputs.iter_mut().chain(&mut log.outputs) {
        channel.name = format!("{evil}{}", channel.name);
        channel.unit = Some(evil.to_owned());
    }
    let (model, tests, overview) = identified(log, Order::Fixed(4));
    let page = identification_page(&model, Some(&tests), Some(&overview)).unwrap();
    is_sound("evil", &page);
    let own = own(&page);
    assert!(!own.contains("<script>alert") && !own.contains("<!--"));
    assert!(!own.contains("\"quoted\"") && !own.contains("'single'"));
    assert!(own.contains("&lt;script&gt;alert"));
}
