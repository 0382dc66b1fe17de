//! The parameters of an external simulator: a JSON file of names, values and bounds.

use std::fmt;
use std::path::Path;

use anyhow::Context;
use serde::Deserialize;
use serde::de::{Deserializer, Error, MapAccess, SeqAccess, Visitor};

use crate::physics::external::ExternalParameter;

/// What a file looks like, for messages.
const EXAMPLE: &str =
    r#"{"J": {"value": 0.01, "min": 0.001, "max": 0.1, "unit": "kg.m2"}, "d": 0.02}"#;

/// Value and bounds.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Described {
    /// Only in a list.
    name: Option<String>,
    value: f64,
    min: Option<f64>,
    max: Option<f64>,
    unit: Option<String>,
    #[serde(default)]
    description: String,
}

/// A value, or what is known of it.
#[derive(Debug)]
struct Entry(Described);

impl<'de> Deserialize<'de> for Entry {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct EntryVisitor;
        impl<'de> Visitor<'de> for EntryVisitor {
            type Value = Entry;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a number or an object with `value`")
            }

            fn visit_f64<E: Error>(self, value: f64) -> Result<Entry, E> {
                Ok(Entry(Described {
                    name: None,
                    value,
                    min: None,
                    max: None,
                    unit: None,
                    description: String::new(),
                }))
            }

            fn visit_i64<E: Error>(self, value: i64) -> Result<Entry, E> {
                self.visit_f64(value as f64)
            }

            fn visit_u64<E: Error>(self, value: u64) -> Result<Entry, E> {
                self.visit_f64(value as f64)
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Entry, A::Error> {
                Described::deserialize(serde::de::value::MapAccessDeserializer::new(map)).map(Entry)
            }
        }
        deserializer.deserialize_any(EntryVisitor)
    }
}

/// Parameters in the order of the file.
#[derive(Debug)]
struct List(Vec<(String, Described)>);

impl<'de> Deserialize<'de> for List {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct ListVisitor;
        impl<'de> Visitor<'de> for ListVisitor {
            type Value = List;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("an object of parameters by name, or a list of them")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<List, A::Error> {
                let mut list = Vec::new();
                while let Some((name, Entry(described))) = map.next_entry::<String, Entry>()? {
                    if described.name.as_ref().is_some_and(|n| *n != name) {
                        return Err(A::Error::custom(format!("`{name}` has another `name`")));
                    }
                    list.push((name, described));
                }
                Ok(List(list))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<List, A::Error> {
                let mut list = Vec::new();
                while let Some(described) = seq.next_element::<Described>()? {
                    let name = described.name.clone();
                    list.push((
                        name.ok_or_else(|| A::Error::missing_field("name"))?,
                        described,
                    ));
                }
                Ok(List(list))
            }
        }
        deserializer.deserialize_any(ListVisitor)
    }
}

/// Reads the parameters of a simulator.
pub(crate) fn read(path: &Path) -> anyhow::Result<Vec<ExternalParameter>> {
    let text = std::fs::read_to_string(path)
        .with_context(|| format!("{}: cannot be read", path.display()))
        // The cause belongs into the one message that is shown.
        .map_err(|e| anyhow::anyhow!("{e:#}"))?;
    parse(&text).map_err(|e| anyhow::anyhow!("{}: {e}", path.display()))
}

fn parse(text: &str) -> anyhow::Result<Vec<ExternalParameter>> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let List(list) = serde_json::from_str(text)
        .map_err(|e| anyhow::anyhow!("these are no parameters: {e}; expected is {EXAMPLE}"))?;
    if list.is_empty() {
        anyhow::bail!("there is no parameter in it; expected is {EXAMPLE}");
    }
    let mut parameters: Vec<ExternalParameter> = Vec::new();
    for (name, described) in list {
        let (min, max) = (
            described.min.unwrap_or(f64::NEG_INFINITY),
            described.max.unwrap_or(f64::INFINITY),
        );
        let value = described.value;
        if name.is_empty() {
            anyhow::bail!("a parameter has no name");
        }
        if parameters.iter().any(|p| p.name == name) {
            anyhow::bail!("`{name}` stands in it twice");
        }
        if !(min <= value && value <= max && value.is_finite()) {
            anyhow::bail!("`{name}`: the value {value} is not between `min` {min} and `max` {max}");
        }
        if min == max {
            anyhow::bail!(
                "`{name}`: `min` and `max` are both {min}; use --fix {name} for a value that is certain"
            );
        }
        parameters.push(ExternalParameter {
            name,
            value,
            min,
            max,
            unit: described.unit,
            description: described.description,
        });
    }
    Ok(parameters)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_forms_are_read_in_their_order() {
        let object = parse(r#"{"z": {"value": 1, "min": 0.5, "unit": "s"}, "a": -2}"#).unwrap();
        let list = parse(
            r#"[{"name": "z", "value": 1, "min": 0.5, "unit": "s"}, {"name": "a", "value": -2}]"#,
        );
        assert_eq!(object, list.unwrap());
        assert_eq!(
            (object[0].name.as_str(), object[0].min, object[1].value),
            ("z", 0.5, -2.0)
        );
        assert_eq!(object[0].max, f64::INFINITY);
    }

    #[test]
    fn errors_say_what_is_wrong() {
        for (text, words) in [
            ("[1]", "expected is"),
            ("{}", "no parameter"),
            (r#"{"a": {"min": 1}}"#, "missing field `value`"),
            (r#"{"a": {"value": 1, "mix": 2}}"#, "unknown field `mix`"),
            (
                r#"{"a": {"value": 1, "min": 2}}"#,
                "`a`: the value 1 is not between",
            ),
            (r#"{"a": 1, "a": 2}"#, "twice"),
            (r#"[{"value": 1}]"#, "missing field `name`"),
            (r#"{"a": {"value": 1, "min": 1, "max": 1}}"#, "--fix a"),
            ("model X", "these are no parameters"),
        ] {
            let error = parse(text).unwrap_err().to_string();
            assert!(error.contains(words), "{text}: {error}");
        }
    }
}
