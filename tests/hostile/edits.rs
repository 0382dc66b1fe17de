//! Edits of a JSON document: its tree first (values, keys, lengths), then its text.

use serde_json::{Map, Value, json};

use super::bytes::Bytes;

/// One place of a document after the other, each a list of steps from the top.
fn places(value: &Value) -> Vec<Vec<String>> {
    fn walk(value: &Value, path: &mut Vec<String>, out: &mut Vec<Vec<String>>) {
        out.push(path.clone());
        let mut below = |key: String, value: &Value| {
            path.push(key);
            walk(value, path, out);
            path.pop();
        };
        match value {
            Value::Array(list) => list
                .iter()
                .enumerate()
                .for_each(|(i, v)| below(i.to_string(), v)),
            Value::Object(map) => map.iter().for_each(|(k, v)| below(k.clone(), v)),
            _ => {}
        }
    }
    let mut out = Vec::new();
    walk(value, &mut Vec::new(), &mut out);
    out
}

fn at<'a>(value: &'a mut Value, path: &[String]) -> Option<&'a mut Value> {
    path.iter().try_fold(value, |value, key| match value {
        Value::Array(list) => key.parse::<usize>().ok().and_then(|i| list.get_mut(i)),
        Value::Object(map) => map.get_mut(key),
        _ => None,
    })
}

/// A value out of place.
fn value(bytes: &mut Bytes) -> Value {
    match bytes.below(12) {
        0 => Value::Null,
        1 => json!(bytes.flag()),
        2 => json!([]),
        3 => json!({}),
        4 => json!(""),
        5 => json!("x".repeat(bytes.count().min(5000))),
        6 => json!(bytes.count()),
        7 => json!(-(bytes.byte() as i64)),
        8 => {
            let (rows, columns) = (bytes.below(20), bytes.below(20));
            let number = bytes.finite();
            json!(vec![vec![number; columns]; rows])
        }
        9 => json!(vec![bytes.finite(); bytes.below(40)]),
        _ => json!(bytes.finite()),
    }
}

/// One edit of the tree at a place that the bytes choose.
fn edit(document: &mut Value, bytes: &mut Bytes) {
    let all = places(document);
    let place = all[bytes.below(all.len())].clone();
    let other = all[bytes.below(all.len())].clone();
    let choice = bytes.below(9);
    let elsewhere = at(document, &other).cloned().unwrap_or(Value::Null);
    let Some(here) = at(document, &place) else {
        return;
    };
    match (choice, here) {
        (0..=2, here) => *here = value(bytes),
        (3, here) => *here = elsewhere,
        (4, Value::Array(list)) => {
            list.truncate(bytes.below(list.len() + 1));
        }
        (5, Value::Array(list)) => {
            let more = list.last().cloned().unwrap_or_else(|| value(bytes));
            list.extend(std::iter::repeat_n(more, bytes.below(40)));
        }
        (4 | 5, Value::Object(map)) => {
            let keys: Vec<String> = map.keys().cloned().collect();
            if let Some(key) = keys.get(bytes.below(keys.len().max(1))) {
                map.remove(key);
            }
        }
        (6, Value::Object(map)) => {
            let (from, fresh) = (bytes.below(map.len().max(1)), value(bytes));
            if let Some((key, old)) = map.iter().nth(from).map(|(k, v)| (k.clone(), v.clone())) {
                map.insert(format!("{key}x"), old);
                map.insert(key, fresh);
            }
        }
        (7, here) => {
            for _ in 0..bytes.byte() {
                *here = json!([here.take()]);
            }
        }
        (8, Value::Number(number)) => {
            let scaled =
                number.as_f64().unwrap_or(1.0) * 10_f64.powi(i32::from(bytes.byte() as i8));
            *number = serde_json::Number::from_f64(scaled).unwrap_or_else(|| 0.into());
        }
        (_, here) => *here = value(bytes),
    }
}

/// One edit of the text: what no tree can say.
fn scratch(text: &mut Vec<u8>, bytes: &mut Bytes) {
    const PIECES: [&str; 16] = [
        "NaN",
        "Infinity",
        "1e999",
        "-1e999",
        "1e-999",
        "-0.0",
        "\u{feff}",
        "\u{0}",
        "\"",
        "\\u0000",
        "{",
        "]",
        ",",
        "\n",
        "\"A\":1,",
        "\"sample_time\":2,",
    ];
    let place = bytes.below(text.len() + 1);
    match bytes.below(5) {
        0 => text.truncate(place),
        1 => {
            let piece = bytes.one_of(&PIECES).as_bytes().to_vec();
            text.splice(place..place, piece);
        }
        // The number that begins next becomes another.
        2 => {
            let digit = |b: &u8| b.is_ascii_digit() || b"+-.eE".contains(b);
            let from = place
                + text[place..]
                    .iter()
                    .position(digit)
                    .unwrap_or(text.len() - place);
            let to = from
                + text[from..]
                    .iter()
                    .position(|b| !digit(b))
                    .unwrap_or(text.len() - from);
            let number = match bytes.below(4) {
                0 => "9".repeat(1 << (bytes.byte() % 17)),
                1 => format!("0.{}1", "0".repeat(1 << (bytes.byte() % 12))),
                2 => bytes.one_of(&PIECES[..6]).to_owned(),
                _ => bytes.number().to_string(),
            };
            text.splice(from..to, number.into_bytes());
        }
        3 => {
            let piece = bytes.one_of(&["[", "{\"a\":", "[[", "\"", " "]);
            text.splice(
                place..place,
                piece.repeat(1 << (bytes.byte() % 15)).into_bytes(),
            );
        }
        _ => {
            if let Some(byte) = text.get_mut(place) {
                *byte = bytes.byte();
            }
        }
    }
}

/// The document after the edits that the bytes say; `own` are edits of the kind of document.
pub fn edited(mut document: Value, bytes: &mut Bytes, own: fn(&mut Value, &mut Bytes)) -> Vec<u8> {
    let (edits, scratches) = match bytes.byte() {
        few @ 0..=199 => (usize::from(few % 4), 0),
        many => (usize::from(many % 4), usize::from(many % 3)),
    };
    for _ in 0..bytes.below(3) {
        own(&mut document, bytes);
    }
    for _ in 0..edits {
        edit(&mut document, bytes);
    }
    let mut text = document.to_string().into_bytes();
    for _ in 0..scratches {
        scratch(&mut text, bytes);
    }
    text
}

/// The object at a key, made if it is not there.
pub fn object<'a>(document: &'a mut Value, key: &str) -> Option<&'a mut Map<String, Value>> {
    document.get_mut(key).and_then(Value::as_object_mut)
}
