//! The reader of explanations: documents after hostile edits, and any bytes.

use innovant::explain::{AugmentedError, Explanation};
use innovant::internal::effects::{Port, library};
use innovant::internal::report::explanation_text;
use innovant::report::{explanation_page, is_explanation, parse_explanation, to_json};
use serde_json::{Value, json};

use super::bytes::Bytes;
use super::edits::{edited, object};
use super::logs::white;
use super::sound;

/// What `explain` wrote about `data/concealed/case_002`, with its signals cut short.
const EXPLANATION: &str = include_str!("explanation.json");

/// Samples that an accepted model is run over.
const SAMPLES: usize = 40;

/// Reads what a few edits, or the bytes themselves, make; what is accepted can be simulated on.
pub fn explanation_json(bytes: &[u8]) {
    let mut bytes = Bytes::new(bytes);
    let text = match bytes.byte() {
        0..=15 => bytes.rest().to_vec(),
        _ => {
            let document: Value = serde_json::from_str(EXPLANATION).expect("a document");
            edited(document, &mut bytes, dressed)
        }
    };
    parse(&String::from_utf8_lossy(&text));
}

/// Parses an explanation and holds it to its word.
pub fn parse(text: &str) {
    let _ = is_explanation(text);
    match parse_explanation("explanation.json", text) {
        Ok(read) => explanation(&read),
        Err(error) => sound::refusal(&error),
    }
}

/// An explanation can be written and read back to the same, told, drawn and simulated on; or a model says why not.
pub fn explanation(read: &Explanation) {
    let text = to_json(read).expect("a document is JSON");
    let again = parse_explanation("again", &text)
        .unwrap_or_else(|error| panic!("an explanation is not read back: {error}\n{text}"));
    assert_eq!(to_json(&again).expect("a document is JSON"), text);
    assert!(!explanation_text(read).trim().is_empty());
    if let Err(error) = explanation_page(read) {
        sound::refusal(&error);
    }
    let Some(model) = &read.model else { return };
    let inputs: Vec<Vec<f64>> = (0..model.inputs.len())
        .map(|i| white(i as u64, SAMPLES))
        .collect();
    let columns: Vec<&[f64]> = inputs.iter().map(Vec::as_slice).collect();
    let outputs: Vec<Vec<f64>> = (0..model.outputs.len())
        .map(|i| white(7 + i as u64, SAMPLES))
        .collect();
    let recorded: Vec<&[f64]> = outputs.iter().map(Vec::as_slice).collect();
    let start = match model.estimate_initial_state(&columns, &recorded) {
        Ok(start) => {
            assert!(start.iter().all(|v| v.is_finite()));
            Some(start)
        }
        Err(error) => {
            refused(&error);
            None
        }
    };
    for (initial, simulation) in [(None, None), (start.as_deref(), Some(recorded.as_slice()))] {
        match model.simulate(&columns, initial, simulation) {
            Ok(simulated) => {
                assert_eq!(simulated.len(), model.outputs.len());
                for column in simulated {
                    assert_eq!(column.len(), SAMPLES);
                    assert!(column.iter().all(|v| v.is_finite()));
                }
            }
            Err(error) => refused(&error),
        }
    }
}

/// What was accepted may diverge or lack a simulation, but it is whole.
fn refused(error: &AugmentedError) {
    sound::refusal(error);
    assert!(
        matches!(
            error,
            AugmentedError::Diverges | AugmentedError::SimulationNeeded
        ),
        "accepted, and then: {error}"
    );
}

/// An effect of the library in the place of the one that was found, and the parts that other plants have.
fn dressed(document: &mut Value, bytes: &mut Bytes) {
    let Some(model) = object(document, "model") else {
        return;
    };
    let states = model.get("A").and_then(Value::as_array).map_or(0, Vec::len);
    let outputs = model
        .get("outputs")
        .and_then(Value::as_array)
        .map_or(0, Vec::len);
    match bytes.below(5) {
        0..=2 => {
            let entries: Vec<_> = library().collect();
            let entry = entries[bytes.below(entries.len())];
            let direction = if entry.port() == Port::Force {
                states
            } else {
                0
            };
            let coefficients = bytes.one_of(&[0, 2 * outputs, states, 2 * states]);
            let looks_at = match bytes.below(6) {
                0 => json!({"integral": bytes.below(2)}),
                1 => json!({"difference": [bytes.below(2), bytes.below(2)]}),
                2 => json!({"output": bytes.count()}),
                _ => json!({"output": 0}),
            };
            let parameters: Vec<f64> = entry
                .parameters
                .iter()
                .map(|p| match bytes.byte() {
                    0..=127 => (p.lower.max(0.01) * p.upper.clamp(0.0, 1.0)).sqrt(),
                    128..=159 => p.lower,
                    160..=191 => p.upper,
                    _ => bytes.finite(),
                })
                .collect();
            let effect = json!({
                "effect": entry.id,
                "variant": entry.variant,
                "channel": bytes.below(4) / 3,
                "looks_at": looks_at,
                "direction": (0..direction).map(|_| bytes.finite()).collect::<Vec<f64>>(),
                "parameters": parameters,
                "coefficients": (0..coefficients).map(|_| bytes.finite()).collect::<Vec<f64>>(),
            });
            if bytes.flag() {
                model["effects"] = json!([effect]);
            } else if let Some(Value::Array(effects)) = model.get_mut("effects") {
                effects.push(effect);
            }
        }
        3 => {
            let quantity = json!({"value": bytes.finite(), "std": null, "unit": ""});
            model.insert(
                "mechanics".to_owned(),
                json!({
                    "reading": "position", "mass": quantity, "viscous_friction": quantity, "constant_force": quantity,
                    "window": bytes.finite(), "sentence": "",
                }),
            );
        }
        _ => {
            let mut reference = Value::Object(model.clone());
            reference["effects"] = json!([]);
            model.insert("reference".to_owned(), reference);
            model.insert("substeps".to_owned(), json!(bytes.count()));
            let rows = bytes.below(4);
            if rows == 3
                && let Some(Value::Array(list)) = model.get_mut("outputs")
            {
                list.push(json!({"name": "y2"}));
            }
        }
    }
}
