//! The page as a whole.

use super::super::tests::{is_sound, opens_offline};
use super::explanation_page;
use super::fixtures::{all, consistent, family, load_step, named, parameters, unexplained};
use crate::explain::{Explanation, FitTable, Location, Verdict};
use crate::report::page::tests;
use crate::report::text::explanation_text;

/// Without the library that draws.
fn page(of: &Explanation) -> String {
    tests::own(&explanation_page(of).unwrap())
}

/// Sections by the id of their heading.
fn has(page: &str, id: &str) -> bool {
    page.contains(&format!("<section id=\"{id}\""))
}

#[test]
fn pages_open_offline_and_say_what_they_are() {
    for (name, e) in all() {
        let page = explanation_page(&e).unwrap();
        opens_offline(name, &page);
        is_sound(name, &page);
        assert_eq!(
            tests::own(&page).matches("<table").count(),
            tests::own(&page).matches("<caption").count(),
            "{name}"
        );
    }
}

#[test]
fn what_comes_from_files_is_escaped() {
    let evil = "<script>alert(1)</script> & \"quoted\" 'single' onload=\"z\"";
    let mut e = unexplained();
    e.effects = named().effects;
    e.detectable = consistent().detectable;
    e.location = load_step().location;
    e.location.regime = named().location.regime;
    let text = serde_json::to_string(&e).unwrap();
    let mut value: serde_json::Value = serde_json::from_str(&text).unwrap();
    poison(&mut value, evil);
    for verdict in ["named", "family", "unexplained", "consistent", "parameters"] {
        value["verdict"] = verdict.into();
        let e: Explanation = serde_json::from_value(value.clone()).unwrap();
        let page = page(&e);
        assert!(!page.contains("<script>alert"));
        assert!(!page.contains("\"quoted\""));
        assert!(!page.contains("'single'"));
        assert!(page.contains("&lt;script&gt;alert"));
        is_sound(verdict, &explanation_page(&e).unwrap());
    }
}

/// Replaces every text.
fn poison(value: &mut serde_json::Value, by: &str) {
    match value {
        serde_json::Value::String(text) => *text = by.to_owned(),
        serde_json::Value::Array(items) => items.iter_mut().for_each(|v| poison(v, by)),
        serde_json::Value::Object(map) => {
            if let Some(parameters) = map.get_mut("parameters").and_then(|p| p.as_object_mut())
                && let Some(fc) = parameters.remove("Fc")
            {
                parameters.insert(by.to_owned(), fc);
            }
            for (key, v) in map.iter_mut() {
                if key != "looks_at" {
                    poison(v, by);
                }
            }
        }
        _ => {}
    }
}

#[test]
fn sections_without_content_are_left_out() {
    let consistent = page(&consistent());
    for id in ["found", "where", "rivals", "parameters", "experiment"] {
        assert!(!has(&consistent, id), "{id}");
        assert!(!consistent.contains(&format!("href=\"#{id}\"")), "{id}");
    }
    for id in ["answer", "pictures", "proof", "left", "provenance"] {
        assert!(has(&consistent, id), "{id}");
    }
    assert!(consistent.contains("smallest effects"));
    assert!(!consistent.contains("Residual after"));
    assert!(!consistent.contains("id=\"curve\""));

    let named = page(&named());
    for id in [
        "answer",
        "pictures",
        "found",
        "where",
        "proof",
        "rivals",
        "parameters",
        "left",
        "provenance",
    ] {
        assert!(has(&named, id), "{id}");
    }
    assert!(named.contains("Residual before") && named.contains("Residual after"));
    assert!(named.contains("id=\"curve\""));
    assert!(!has(&named, "experiment"));
    assert!(has(&page(&family()), "experiment"));
}

#[test]
fn every_verdict_has_its_sentence() {
    let says = |e: &Explanation, text: &str| assert!(page(e).contains(text), "{text}");
    says(
        &named(),
        "The simulation leaves out Coulomb friction at position.",
    );
    says(
        &load_step(),
        "The simulation leaves out a load step at position.",
    );
    says(
        &family(),
        "Coulomb friction at position or, about as likely, Stribeck friction.",
    );
    says(&consistent(), "The simulation agrees with the recording");
    let mut left = consistent();
    left.remaining.adequate = false;
    says(&left, "the residual is not white");
    says(&parameters(), "its parameters are not.");
    says(&unexplained(), "that no known effect explains.");
    assert!(!page(&unexplained()).contains("why they lost"));
}

#[test]
fn windows_are_shaded_and_numbered() {
    let page = page(&load_step());
    assert!(page.contains("differs most, window 1: 17.4 – 25.0\u{a0}s"));
    assert!(page.contains("\"shades\":[{") && page.contains("\"label\":\"1\""));
}

#[test]
fn an_empty_explanation_is_a_page_too() {
    for verdict in [
        Verdict::Consistent,
        Verdict::Parameters,
        Verdict::Named,
        Verdict::Family,
        Verdict::Unexplained,
    ] {
        let mut e = consistent();
        e.verdict = verdict;
        e.summary.clear();
        e.signals.clear();
        e.noise.clear();
        e.detectable.clear();
        e.recordings.clear();
        e.location = Location::default();
        e.fit = FitTable {
            heldout: None,
            heldout_blocks: Vec::new(),
            ..e.fit
        };
        let page = page(&e);
        assert!(!has(&page, "pictures"));
        assert!(!page.contains("Held-out blocks"));
        assert!(page.contains("</html>"));
    }
}

#[test]
fn odd_numbers_and_lengths_do_no_harm() {
    let mut e = named();
    let s = &mut e.signals[0];
    s.recorded[3] = f64::NAN;
    s.simulated[4] = f64::INFINITY;
    s.augmented.truncate(10);
    s.parameters_only.clear();
    s.spectrum[0] = [0.0, f64::NEG_INFINITY, f64::NAN];
    e.probability = f64::NAN;
    e.fit.train.improvement_95 = Some([f64::NAN, 1.0]);
    e.location.time = vec![[f64::NAN, 1.0, 0.0], [5.0, 4.0, 1.0], [-1e300, 1e300, 1.0]];
    if let Some(curve) = &mut e.curve {
        curve.std.truncate(2);
        curve.value[5] = f64::NAN;
    }
    let page = page(&e);
    assert!(!page.contains("NaN") && !page.contains(":inf"));
    e.signals[0].time.clear();
    e.signals[0].spectrum.clear();
    assert!(explanation_page(&e).is_ok());
}

#[test]
fn what_says_nothing_is_left_out() {
    // Found by an exact test: no criterion; and no step from parameters to effect, no interval of one.
    let mut e = named();
    e.effects[0].evidence.criterion_gain = 0.0;
    e.effects[0].evidence.criterion_needed = 0.0;
    e.fit.train.augmented = e.fit.train.parameters_only;
    e.fit.heldout = None;
    let page = page(&e);
    assert!(!page.contains("What speaks for it"));
    assert!(page.contains("by a test of its own"));
    assert!(!page.contains("paired block bootstrap"));
}

#[test]
fn only_the_strongest_bands_carry_a_label() {
    let mut e = named();
    e.location.time.clear();
    let start = |k: u32| 0.1 * f64::from(k + 1);
    e.location.frequency = (0..8)
        .map(|k| [start(k), start(k) + 0.05, f64::from(k)])
        .collect();
    let page = page(&e);
    assert_eq!(page.matches("dB over noise").count(), 8);
    assert_eq!(page.matches("\"label\":\"+").count(), 3);
}

#[test]
fn what_is_not_proven_is_no_name_on_the_terminal() {
    let mut explanation = named();
    let first = |e: &Explanation| explanation_text(e).lines().next().unwrap().to_owned();
    assert!(first(&explanation).starts_with("NAMED: "));
    explanation.verdict = Verdict::Unexplained;
    assert!(first(&explanation).starts_with("UNEXPLAINED (closest: "));
}
