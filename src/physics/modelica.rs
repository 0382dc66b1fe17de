//! The text of a plant with other values.

use super::expression::VariableId;
use super::simulation::{Plant, Point};
use super::spec::{ModelSpec, VariableKind};

impl Plant {
    /// The text with the parameters of `point`; those that have their value already stay as they were written.
    pub fn text_at(&self, point: &Point) -> String {
        let written = Self::new(self.spec.clone()).nominal().parameters;
        let values: Vec<(VariableId, f64)> = self
            .spec
            .parameters()
            .into_iter()
            .zip(point.parameters.iter().zip(written))
            .filter(|(_, (value, written))| **value != *written)
            .map(|(v, (value, _))| (v, *value))
            .collect();
        self.spec.text_with(&values)
    }
}

impl ModelSpec {
    /// The text with these values of parameters, all else as it was written.
    pub(crate) fn text_with(&self, values: &[(VariableId, f64)]) -> String {
        let mut text = self.text.clone();
        let mut changes: Vec<(usize, usize, f64)> = values
            .iter()
            .filter(|(v, _)| self.variable(*v).kind == VariableKind::Parameter)
            .filter_map(|&(v, value)| {
                let span = self.expressions.span(self.variable(v).value?);
                Some((span.start, span.end, value))
            })
            .collect();
        // From the end, so that the places before stay where they are.
        changes.sort_by_key(|change| std::cmp::Reverse(change.0));
        for (from, to, value) in changes {
            if text.is_char_boundary(from) && text.is_char_boundary(to) && from <= to {
                text.replace_range(from..to, &format!("{value:?}"));
            }
        }
        text
    }
}
