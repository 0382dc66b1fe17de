//! Inputs and outputs in a model document.

use std::fmt;

use schemars::JsonSchema;
use serde::Serialize;
use serde::de::{self, Deserialize, Deserializer, MapAccess, Visitor};

use crate::identify::IdentifiedChannel;
use crate::log::Channel;

/// An input of the model.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct InputDocument {
    /// Name, as in the header of a recording.
    pub name: String,
    /// Unit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// Operating point: the matrices describe deviations from it.
    pub level: f64,
    /// Known delay in samples, which the matrices do not contain.
    pub delay: usize,
}

/// An output of the model.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct OutputDocument {
    /// Name, as in the header of a recording.
    pub name: String,
    /// Unit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// Operating point: the matrices describe deviations from it.
    pub level: f64,
}

impl From<&IdentifiedChannel> for InputDocument {
    fn from(of: &IdentifiedChannel) -> Self {
        Self {
            name: of.channel.name.clone(),
            unit: of.channel.unit.clone(),
            level: of.level,
            delay: of.delay,
        }
    }
}

impl From<&IdentifiedChannel> for OutputDocument {
    fn from(of: &IdentifiedChannel) -> Self {
        Self {
            name: of.channel.name.clone(),
            unit: of.channel.unit.clone(),
            level: of.level,
        }
    }
}

impl From<InputDocument> for IdentifiedChannel {
    fn from(document: InputDocument) -> Self {
        Self {
            channel: Channel {
                name: document.name,
                unit: document.unit,
            },
            level: document.level,
            delay: document.delay,
        }
    }
}

impl From<OutputDocument> for IdentifiedChannel {
    fn from(document: OutputDocument) -> Self {
        Self {
            channel: Channel {
                name: document.name,
                unit: document.unit,
            },
            level: document.level,
            delay: 0,
        }
    }
}

/// What a channel may be written as: an object, or a header such as `"force [N]"`.
#[derive(serde::Deserialize)]
struct Written {
    name: String,
    #[serde(default)]
    unit: Option<String>,
    #[serde(default)]
    level: f64,
    #[serde(default)]
    delay: usize,
}

struct WrittenVisitor;

impl<'de> Visitor<'de> for WrittenVisitor {
    type Value = Written;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a channel: an object with a name, or a header such as \"force [N]\"")
    }

    fn visit_str<E: de::Error>(self, header: &str) -> Result<Written, E> {
        let channel = Channel::parse(header);
        Ok(Written {
            name: channel.name,
            unit: channel.unit,
            level: 0.0,
            delay: 0,
        })
    }

    fn visit_map<M: MapAccess<'de>>(self, map: M) -> Result<Written, M::Error> {
        Written::deserialize(de::value::MapAccessDeserializer::new(map))
    }
}

impl<'de> Deserialize<'de> for InputDocument {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let written = deserializer.deserialize_any(WrittenVisitor)?;
        Ok(Self {
            name: written.name,
            unit: written.unit,
            level: written.level,
            delay: written.delay,
        })
    }
}

impl<'de> Deserialize<'de> for OutputDocument {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let written = deserializer.deserialize_any(WrittenVisitor)?;
        Ok(Self {
            name: written.name,
            unit: written.unit,
            level: written.level,
        })
    }
}
