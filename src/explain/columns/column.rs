//! Columns as variables of a text.

use crate::log::Channel;
use crate::physics::{function_names, is_reserved};

/// A column as the text names it.
pub(crate) struct Column(pub(crate) Channel);

/// Names of the states that follow an output.
const STATES: [&str; 2] = ["_state", "_rate"];

impl Column {
    pub(crate) fn unit(&self) -> String {
        let unit = self.0.unit.as_ref().filter(|u| !u.contains(['"', '\\']));
        unit.map_or_else(String::new, |u| format!("(unit=\"{u}\")"))
    }

    /// What follows the start value in the declaration of a state. The rate of a position is a velocity.
    pub(crate) fn unit_of_state(&self, place: usize) -> String {
        let unit = match (self.0.unit.as_deref(), place) {
            (Some(unit), 0) if !unit.contains(['"', '\\']) => unit,
            (Some("m"), 1) => "m/s",
            (Some("rad"), 1) => "rad/s",
            _ => return String::new(),
        };
        format!(", unit=\"{unit}\"")
    }

    pub(crate) fn name(&self) -> String {
        self.suffixed("")
    }

    /// Quoted where it is no plain name.
    pub(crate) fn suffixed(&self, suffix: &str) -> String {
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '_';
        let begins = self
            .0
            .name
            .starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
        let coefficient = self
            .0
            .name
            .strip_prefix('c')
            .is_some_and(|n| n.parse::<usize>().is_ok());
        let reserved = is_reserved(&self.0.name) || function_names().any(|f| f == self.0.name);
        match begins && self.0.name.chars().all(plain) && !coefficient && !reserved {
            true => format!("{}{suffix}", self.0.name),
            false => format!("'{}{suffix}'", self.0.name.replace(['\'', '\\'], "_")),
        }
    }

    pub(crate) fn state(&self, place: usize) -> String {
        match STATES.get(place) {
            Some(suffix) => self.suffixed(suffix),
            None => self.suffixed(&format!("{}{place}", STATES[1])),
        }
    }
}
