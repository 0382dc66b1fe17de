//! Units of expressions in the words of the model.

use super::{Unit, symbols};
use crate::physics::error::shortened;
use crate::physics::expression::{Binary, ExpressionId, Function, Node};
use crate::physics::spec::ModelSpec;
use crate::physics::syntax::constant;
use std::collections::HashSet;

/// Factors of a product that a message lists.
const MOST_FACTORS: usize = 6;

/// The units that a model declares.
pub(super) struct Words<'a> {
    spec: &'a ModelSpec,
    /// Units without a prefix or another scale, each once, in the order of declaration.
    declared: Vec<(Unit, &'a str)>,
}

impl<'a> Words<'a> {
    pub(super) fn new(spec: &'a ModelSpec) -> Self {
        let mut seen = HashSet::new();
        let units = spec
            .variables
            .iter()
            .filter_map(|v| Some((v.unit?, v.unit_text.as_deref()?)));
        let declared = units
            .filter(|(_, text)| seen.insert(*text) && symbols::is_coherent(text))
            .collect();
        Self { spec, declared }
    }

    /// As the model writes this unit, else as it is usual.
    pub(super) fn readable(&self, unit: Unit) -> String {
        let declared = self.declared.iter().find(|d| d.0.same(&unit));
        declared.map_or_else(|| unit.to_string(), |d| shortened(d.1))
    }

    /// The same of a unit that follows from others. Where some have a prefix or another scale, its dimension says no factor: it is
    /// known only where the model has one unit of that dimension; a time is in seconds.
    pub(super) fn inferred(&self, unit: Unit) -> Option<String> {
        let texts = self
            .spec
            .variables
            .iter()
            .filter_map(|v| Some((v.unit?, v.unit_text.as_deref()?)));
        // Differences in degC are those in K.
        let scaled = |text: &str| !symbols::is_coherent(&text.replace("degC", "K"));
        let mut scaled = texts.clone().filter(|(_, text)| scaled(text));
        // A pure number is one beside lengths in millimetres, and may be an angle beside degrees.
        let is_coherent = match unit.is_one() {
            true => scaled.all(|(u, _)| !u.is_one()),
            false => scaled.next().is_none(),
        };
        if is_coherent {
            return Some(self.readable(unit));
        }
        let alike: HashSet<&str> = texts
            .filter(|(u, _)| u.same(&unit))
            .map(|(_, text)| text)
            .collect();
        match alike.len() {
            0 if unit.same(&Unit::SECOND) => Some("s".to_owned()),
            1 if !unit.is_one() => alike.into_iter().next().map(str::to_owned),
            _ => None,
        }
    }

    /// The unit of an expression: as declared where it has one, else the nearest one that reads well.
    pub(super) fn unit_text(&self, id: ExpressionId, unit: Unit) -> String {
        match self.product(id).as_deref() {
            Some([(text, exponent)]) if *exponent == 1.0 => text.clone(),
            _ => self.readable(unit),
        }
    }

    /// "N/m times m", or none where the expression is no product of several units.
    pub(super) fn factors(&self, id: ExpressionId) -> Option<String> {
        let factors = self.product(id)?;
        if factors.len() < 2 {
            return None;
        }
        let mut answer = String::new();
        for (text, exponent) in &factors {
            let word = match (answer.is_empty(), *exponent < 0.0) {
                (true, false) => "",
                (true, true) => "1 per ",
                (false, false) => " times ",
                (false, true) => " per ",
            };
            answer += word;
            let size = exponent.abs();
            if size == 1.0 {
                answer += text;
            } else if text.chars().all(char::is_alphabetic) {
                answer += &format!("{text}^{size}");
            } else {
                answer += &format!("({text})^{size}");
            }
        }
        Some(answer)
    }

    /// Units of the factors and their exponents; none where there are too many, or where one has no unit.
    fn product(&self, id: ExpressionId) -> Option<Vec<(String, f64)>> {
        let mut answer = vec![];
        let mut waiting = vec![(id, 1.0)];
        while let Some((id, exponent)) = waiting.pop() {
            match self.spec.expressions.node(id) {
                Node::Negate(a) => waiting.push((a, exponent)),
                Node::Binary(Binary::Multiply, a, b) => {
                    waiting.extend([(b, exponent), (a, exponent)]);
                }
                Node::Binary(Binary::Divide, a, b) => {
                    waiting.extend([(b, -exponent), (a, exponent)]);
                }
                Node::Binary(Binary::Power, a, b) => match self.spec.expressions.node(b) {
                    Node::Number(power) => waiting.push((a, exponent * power)),
                    _ => return None,
                },
                Node::Variable(v) | Node::Previous(v) => {
                    let text = self.spec.variable(v).unit_text.as_deref()?;
                    answer.push((shortened(text), exponent));
                }
                Node::Derivative(v) => {
                    let text = self.spec.variable(v).unit_text.as_deref()?;
                    answer.push((per_second(&shortened(text)), exponent));
                }
                Node::Number(_) => {
                    answer.extend(self.constant_unit(id).map(|unit| (unit, exponent)));
                }
                Node::Call(Function::Abs, a) => waiting.push((a, exponent)),
                Node::Call(Function::Sqrt, a) => waiting.push((a, 0.5 * exponent)),
                // The value of any other function is a pure number.
                Node::Call(..) => {}
                Node::Time => answer.push(("s".into(), exponent)),
                _ => return None,
            }
            // Factors that are pure numbers explain nothing.
            answer.retain(|(text, _)| text != "1");
            if answer.len() > MOST_FACTORS || waiting.len() > MOST_FACTORS {
                return None;
            }
        }
        Some(answer)
    }

    /// Unit of a constant of the library, as `Modelica.Constants.g_n`.
    fn constant_unit(&self, id: ExpressionId) -> Option<String> {
        let span = self.spec.expressions.span(id);
        let written = self.spec.text.get(span.start..span.end)?;
        let short = written.rsplit('.').next()?;
        let unit = constant(&format!("Modelica.Constants.{short}"))?.1?;
        Some(unit.to_string())
    }
}

/// Unit of a derivative: `rad/s` becomes `rad/s2`.
fn per_second(text: &str) -> String {
    if let Some(above) = text.strip_suffix("/s") {
        format!("{above}/s2")
    } else if text.contains('/') {
        format!("({text})/s")
    } else {
        format!("{text}/s")
    }
}
