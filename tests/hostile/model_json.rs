//! The reader of models: documents after hostile edits, and any bytes.

use innovant::report::{is_explanation, parse_model};
use serde_json::{Value, json};

use super::bytes::Bytes;
use super::edits::edited;
use super::sound;

/// What `identify data/servo.csv --order 2` wrote, with its long lists cut short.
const MODEL: &str = include_str!("model.json");

/// Reads what a few edits, or the bytes themselves, make; what is accepted is a model.
pub fn model_json(bytes: &[u8]) {
    let mut bytes = Bytes::new(bytes);
    let text = match bytes.byte() {
        0..=31 => bytes.rest().to_vec(),
        32..=127 => edited(bare(&mut bytes), &mut bytes, resize),
        _ => {
            let document: Value = serde_json::from_str(MODEL).expect("a document");
            edited(document, &mut bytes, resize)
        }
    };
    parse(&String::from_utf8_lossy(&text));
}

/// Parses a model and holds it to its word.
pub fn parse(text: &str) {
    let _ = is_explanation(text);
    match parse_model("model.json", text) {
        Ok(read) => sound::model(&read.model),
        Err(error) => sound::refusal(&error),
    }
}

/// What another program may write.
fn bare(bytes: &mut Bytes) -> Value {
    let (n, r, l) = (bytes.below(5), bytes.below(4), bytes.below(4));
    let mut matrix = |rows: usize, columns: usize| -> Value {
        let rows: Vec<Vec<f64>> = (0..rows)
            .map(|_| (0..columns).map(|_| bytes.finite()).collect())
            .collect();
        json!(rows)
    };
    let mut document = json!({"A": matrix(n, n), "B": matrix(n, r), "C": matrix(l, n)});
    let (d, k, covariance) = (matrix(l, r), matrix(n, l), matrix(l, l));
    if bytes.flag() {
        document["D"] = d;
    }
    if bytes.flag() {
        document["K"] = k;
        document["innovation_covariance"] = covariance;
    }
    document["dt"] = json!(super::logs::sample_time(bytes));
    document
}

/// Sizes that do not fit, and numbers far from what any plant has.
fn resize(document: &mut Value, bytes: &mut Bytes) {
    match bytes.below(5) {
        0 => {
            if let Some(input) = document.pointer_mut("/inputs/0/delay") {
                *input = json!(bytes.count());
            }
        }
        1 => {
            let key = if document.get("dt").is_some() {
                "dt"
            } else {
                "sample_time"
            };
            document[key] = json!(bytes.finite());
        }
        2 => {
            let pointer = ["/A/0/0", "/B/0/0", "/C/0/0", "/K/0/0", "/D/0/0", "/x0/0"];
            if let Some(number) = document.pointer_mut(bytes.one_of(&pointer)) {
                *number = json!(bytes.finite());
            }
        }
        3 => {
            let pointers = [
                "/covariance/scale",
                "/covariance/packed_lower_triangle/0",
                "/covariance/degrees_of_freedom",
                "/innovation_covariance/0/0",
                "/inputs/0/level",
                "/outputs/0/level",
            ];
            if let Some(number) = document.pointer_mut(bytes.one_of(&pointers)) {
                *number = json!(bytes.finite());
            }
        }
        _ => {
            for list in ["inputs", "outputs"] {
                if let Some(Value::Array(channels)) = document.get_mut(list)
                    && let Some(first) = channels.first().cloned()
                {
                    channels.push(first);
                }
            }
        }
    }
}
