//! A signal's name and unit, as a CSV header writes them.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::unit::is_unit;

/// One signal: its name and, where the header says so, its unit.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
pub struct Channel {
    /// Name, without the unit.
    pub name: String,
    /// Unit as written between the brackets, such as `N` or `rad/s`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
}

impl Channel {
    /// A channel called `name`, without a unit. Brackets are not interpreted: [`Channel::parse`] does that.
    pub fn new(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            unit: None,
        }
    }

    /// Reads a header: `force [N]` and `force (N)` are `force` in `N`; a header without such an ending is all name. What
    /// stands in parentheses and is no unit, as in `speed (filtered)`, is part of the name.
    ///
    /// Nothing is refused: `[N]` alone has no name, so the whole of it is the name.
    pub fn parse(header: &str) -> Self {
        let header = header.trim();
        let split = header
            .strip_suffix(']')
            .and_then(|open| open.rsplit_once('['))
            .or_else(|| {
                let open = header.strip_suffix(')')?;
                open.match_indices('(')
                    .filter_map(|(at, _)| Some((open.get(..at)?, open.get(at + 1..)?)))
                    .find(|(_, unit)| is_unit(unit))
            });
        match split.map(|(name, unit)| (name.trim(), unit.trim())) {
            Some((name, unit)) if !name.is_empty() => Self {
                name: name.to_owned(),
                unit: (!unit.is_empty()).then(|| unit.to_owned()),
            },
            _ => Self::new(header),
        }
    }

    /// Whether `asked` may mean this channel: same name, and no contradiction between the units. A unit missing on
    /// either side contradicts nothing.
    pub(crate) fn answers_to(&self, asked: &Self, ignore_case: bool) -> bool {
        let same_name = if ignore_case {
            self.name.to_lowercase() == asked.name.to_lowercase()
        } else {
            self.name == asked.name
        };
        same_name && self.unit_agrees(asked)
    }

    /// Whether the units agree; an unknown unit agrees with any.
    pub(crate) fn unit_agrees(&self, other: &Self) -> bool {
        match (&self.unit, &other.unit) {
            (Some(mine), Some(theirs)) => mine == theirs,
            _ => true,
        }
    }
}

impl fmt::Display for Channel {
    /// Writes the header back: `force [N]`, or `force` when there is no unit.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.unit {
            Some(unit) => write!(f, "{} [{unit}]", self.name),
            None => f.write_str(&self.name),
        }
    }
}
