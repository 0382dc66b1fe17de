//! The user's own hypotheses: terms that the library does not have, or that it should have found.
//!
//! ```text
//! hypothesis = NAME ":" left ( "+=" | "-=" | "=" ) expression { "," bound }
//! left       = a left-hand side as it stands in the plant | "der(" state ")" | variable | input | parameter
//! bound      = c ( "<" | "<=" | ">" | ">=" ) number | number ( "<" | ... ) c [ ( "<" | ... ) number ]
//!            | c "=" number | any of these, or c alone, followed by "[" unit "]"
//! ```
//!
//! Names in the expression that the plant does not declare are new parameters.

mod error;
mod place;
mod shape;
#[cfg(test)]
mod tests;
mod trial;

pub use error::{HypothesisError, HypothesisErrorKind};
pub(crate) use trial::{Ground, Trial, prefer_asked, trials};

use self::place::Target;
use super::fitting::edit::{Edit, NewParameter};
use crate::physics::{
    ModelSpec, Span, SpecErrorKind, Token, Unit, VariableKind, function_names, is_reserved,
    nearest, parse, tokens,
};

/// What happens to the right-hand side.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Change {
    Add,
    Subtract,
    Replace,
}

/// A parameter that a hypothesis brings along.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct NewNumber {
    pub(crate) name: String,
    pub(crate) min: f64,
    pub(crate) max: f64,
    pub(crate) start: Option<f64>,
    pub(crate) unit: Option<String>,
}

/// A term that may be missing in a plant, as a user states it.
#[derive(Debug, Clone, PartialEq)]
pub struct Hypothesis {
    name: String,
    text: String,
    target: Target,
    change: Change,
    expression: String,
    numbers: Vec<NewNumber>,
    /// Variables that it is a function of, and `time`.
    depends: Vec<String>,
    /// Places of the numbers in which it is a sum of multiples: all of them may be 0 at the start.
    strengths: Vec<usize>,
}

/// More new parameters than this are a mistake, or not determined by any recording.
const MOST_NUMBERS: usize = 20;

/// One of the tokens of a text.
type Part = (Token, Span);

impl Hypothesis {
    /// Whether it stands in the place of what the text has there.
    pub(crate) fn replaces(&self) -> bool {
        self.change == Change::Replace
    }

    /// Reads a hypothesis about a plant.
    ///
    /// # Errors
    /// The first thing that is wrong in the text, with its place.
    pub fn parse(text: &str, spec: &ModelSpec) -> Result<Self, HypothesisError> {
        use HypothesisErrorKind as Kind;
        let error = |span: Span, kind: Kind| HypothesisError::new(text, span, kind);
        if let Some(start) = text.find("//").or_else(|| text.find("/*")) {
            let end = start + 2;
            return Err(error(Span { start, end }, Kind::Comment));
        }
        let parts = tokens(text).map_err(|e| error(e.span(), Kind::Language((*e.kind).clone())))?;
        let end = Span {
            start: text.len(),
            end: text.len(),
        };
        let of = |span: Span| &text[span.start..span.end];
        let name = match parts.as_slice() {
            [(Token::Name, name), (Token::Sign(":"), _), ..] if plain(of(*name)) => of(*name),
            _ => return Err(error(parts.first().map_or(end, |p| p.1), Kind::Name)),
        };
        let rest = &parts[2..];
        let at = rest.iter().position(|p| {
            matches!(
                p.0,
                Token::Sign("=" | "==" | ":=" | "<" | ">" | "<=" | ">=" | ",")
            )
        });
        let Some(at) = at.filter(|&at| rest[at].0 == Token::Sign("=")) else {
            let wrong = at.map(|at| rest[at].1);
            let span = wrong.or(rest.last().map(|p| p.1)).unwrap_or(end);
            return Err(error(span, Kind::Operator));
        };
        let (change, left) = match rest[..at].split_last() {
            Some(((Token::Sign("+"), _), left)) => (Change::Add, left),
            Some(((Token::Sign("-"), _), left)) => (Change::Subtract, left),
            _ => (Change::Replace, &rest[..at]),
        };
        let (Some(first), Some(last)) = (left.first(), left.last()) else {
            return Err(error(rest[at].1, Kind::Operator));
        };
        let left_span = Span {
            start: first.1.start,
            end: last.1.end,
        };
        let target = Target::find(of(left_span), spec).map_err(|kind| error(left_span, kind))?;
        // The expression, and behind each comma a bound.
        let pieces = split(&rest[at + 1..]).map_err(|(span, kind)| {
            let kind = kind.unwrap_or_else(|| Kind::Stray(of(span).to_owned()));
            error(span, kind)
        })?;
        let expression_span = match pieces[0] {
            [] => {
                return Err(error(
                    Span {
                        start: rest[at].1.end,
                        ..end
                    },
                    Kind::Empty,
                ));
            }
            [first, .., last] => Span {
                start: first.1.start,
                end: last.1.end,
            },
            [only] => only.1,
        };
        for pair in pieces[0].windows(2) {
            let callee = of(pair[0].1);
            if pair[0].0 == Token::Name && pair[1].0 == Token::Sign("(") {
                let short = callee.strip_prefix("Modelica.Math.").unwrap_or(callee);
                let known = function_names().any(|f| f == short)
                    || is_reserved(callee)
                    || callee.contains('.');
                if !known {
                    let kind = Kind::UnknownFunction {
                        name: callee.to_owned(),
                        nearest: nearest(callee, function_names()),
                        known: function_names().collect(),
                    };
                    return Err(error(pair[0].1, kind));
                }
            }
        }
        let mut found = Self {
            name: name.to_owned(),
            text: text.trim().to_owned(),
            target,
            change,
            expression: of(expression_span).to_owned(),
            numbers: vec![],
            depends: vec![],
            strengths: vec![],
        };
        let probe = found.declared(spec, text, expression_span)?;
        for piece in &pieces[1..] {
            found.bound(text, piece, spec).map_err(|(span, kind)| {
                let span = span.or(piece.first().map(|p| p.1)).unwrap_or(end);
                error(span, kind)
            })?;
        }
        found.look(spec, &probe);
        let values: Vec<f64> = found.numbers.iter().map(|n| n.at(1.0)).collect();
        found.candidate(spec, &values).map_err(|kind| {
            let span = match kind {
                Kind::Unsolved(_) => expression_span,
                _ => left_span,
            };
            error(span, kind)
        })?;
        Ok(found)
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// As it was written.
    pub fn text(&self) -> &str {
        &self.text
    }

    pub(crate) fn numbers(&self) -> &[NewNumber] {
        &self.numbers
    }

    /// Declares the names that the plant does not have; gives the plant in which the expression has a variable of its own.
    fn declared(
        &mut self,
        spec: &ModelSpec,
        text: &str,
        span: Span,
    ) -> Result<ModelSpec, HypothesisError> {
        loop {
            let edit = self.probe();
            let whole = edit.text(spec);
            let error = match parse(&whole) {
                Ok(probe) => return Ok(probe),
                Err(error) => error,
            };
            // Where the expression stands there, and the part of it that the error is about.
            let shift = whole.rfind(&self.probe_equation()).map_or(0, |at| {
                at + self.probe_equation().len() - self.expression.len() - 2
            });
            let length = self.expression.len();
            // What is missing at the end is found missing behind it.
            let inside = error.span().start >= shift && error.span().start <= shift + length;
            let within = |position: usize| span.start + (position - shift).min(length);
            let at = if inside {
                Span {
                    start: within(error.span().start),
                    end: within(error.span().end.max(shift)),
                }
            } else {
                span
            };
            let name = &text[at.start..at.end];
            let kind = match &*error.kind {
                SpecErrorKind::Undeclared { .. } if inside => match mistaken(name) {
                    None if self.numbers.len() < MOST_NUMBERS => {
                        self.numbers.push(NewNumber {
                            name: name.to_owned(),
                            min: f64::NEG_INFINITY,
                            max: f64::INFINITY,
                            start: None,
                            unit: None,
                        });
                        continue;
                    }
                    instead => HypothesisErrorKind::Mistaken {
                        name: name.to_owned(),
                        instead: instead.unwrap_or_else(|| {
                            format!("a hypothesis has at most {MOST_NUMBERS} new parameters")
                        }),
                    },
                },
                kind => HypothesisErrorKind::Language(kind.clone()),
            };
            return Err(HypothesisError::new(text, at, kind));
        }
    }

    fn probe_equation(&self) -> String {
        format!("{PROBE} = ({});", self.expression)
    }

    /// A plant with a variable that is the expression.
    fn probe(&self) -> Edit {
        Edit {
            parameters: self.numbers.iter().map(NewNumber::parameter).collect(),
            declarations: vec![format!("Real {PROBE};")],
            equations: vec![self.probe_equation()],
            changes: vec![],
        }
    }

    /// Reads what stands behind a comma.
    fn bound(
        &mut self,
        text: &str,
        piece: &[Part],
        spec: &ModelSpec,
    ) -> Result<(), (Option<Span>, HypothesisErrorKind)> {
        use HypothesisErrorKind as Kind;
        let of = |span: Span| &text[span.start..span.end];
        let (piece, unit) = match piece.iter().position(|p| p.0 == Token::Sign("[")) {
            Some(open) if piece.last().is_some_and(|p| p.0 == Token::Sign("]")) => {
                let (start, end) = (piece[open].1.end, piece[piece.len() - 1].1.start);
                (&piece[..open], Some(Span { start, end }))
            }
            _ => (piece, None),
        };
        let mut terms: Vec<(Option<f64>, Span)> = vec![];
        let mut relations: Vec<&str> = vec![];
        let mut rest = piece;
        loop {
            let (value, span, behind) = match rest {
                [
                    (Token::Sign("-"), sign),
                    (Token::Number(v), at),
                    behind @ ..,
                ] => {
                    let (start, end) = (sign.start, at.end);
                    (Some(-v), Span { start, end }, behind)
                }
                [(Token::Number(v), at), behind @ ..]
                | [(Token::Sign("+"), _), (Token::Number(v), at), behind @ ..] => {
                    (Some(*v), *at, behind)
                }
                [(Token::Name, at), behind @ ..] => (None, *at, behind),
                _ => return Err((rest.first().map(|p| p.1), Kind::Bound)),
            };
            terms.push((value, span));
            match behind {
                [] => break,
                [
                    (Token::Sign(s @ ("<" | "<=" | ">" | ">=" | "=")), _),
                    behind @ ..,
                ] => {
                    relations.push(s);
                    rest = behind;
                }
                [other, ..] => return Err((Some(other.1), Kind::Bound)),
            }
        }
        let names: Vec<Span> = terms
            .iter()
            .filter(|t| t.0.is_none())
            .map(|t| t.1)
            .collect();
        let [at] = names.as_slice() else {
            return Err((names.get(1).copied(), Kind::Bound));
        };
        let name = of(*at);
        let new: Vec<String> = self.numbers.iter().map(|n| n.name.clone()).collect();
        let Some(number) = self.numbers.iter_mut().find(|n| n.name == name) else {
            if spec.find(name).is_some() {
                let instead = "it is the plant's, and its bounds stand in the text of the plant";
                let kind = Kind::Mistaken {
                    name: name.to_owned(),
                    instead: instead.to_owned(),
                };
                return Err((Some(*at), kind));
            }
            let name = name.to_owned();
            return Err((Some(*at), Kind::NotNew { name, new }));
        };
        match (terms.as_slice(), relations.as_slice()) {
            ([_], []) if unit.is_some() => {}
            ([(None, _), (Some(v), _)], ["="]) => {
                if number.start.replace(*v).is_some() {
                    return Err((Some(*at), Kind::TwoStarts(name.to_owned())));
                }
            }
            ([(None, _), (Some(v), _)], [s]) => number.bounded(s, *v),
            ([(Some(v), _), (None, _)], [s]) if *s != "=" => number.bounded(turned(s), *v),
            ([(Some(low), _), (None, _), (Some(high), _)], [a, b])
                if a.starts_with('<') == b.starts_with('<') && *a != "=" && *b != "=" =>
            {
                number.bounded(turned(a), *low);
                number.bounded(b, *high);
            }
            _ => return Err((None, Kind::Bound)),
        }
        if let Some(span) = unit {
            let unit = of(span).trim();
            if Unit::parse(unit).is_none() {
                return Err((Some(span), Kind::Unit(unit.to_owned())));
            }
            number.unit = Some(unit.to_owned());
        }
        let within = number
            .start
            .is_none_or(|s| number.min <= s && s <= number.max);
        if number.min >= number.max || !within {
            return Err((Some(*at), Kind::NoValue(name.to_owned())));
        }
        Ok(())
    }

    /// What it is a function of, and which numbers are strengths.
    fn look(&mut self, spec: &ModelSpec, probe: &ModelSpec) {
        let Some(root) = shape::root(probe, PROBE) else {
            return;
        };
        self.depends = shape::variables(probe, root)
            .into_iter()
            .filter(|name| {
                spec.find(name).is_none_or(|v| {
                    !matches!(
                        spec.variable(v).kind,
                        VariableKind::Parameter | VariableKind::Constant
                    )
                }) && !self.numbers.iter().any(|n| n.name == *name)
            })
            .collect();
        let ids: Vec<_> = self.numbers.iter().map(|n| probe.find(&n.name)).collect();
        let mut chosen = vec![];
        for (i, id) in ids.iter().enumerate() {
            let Some(id) = *id else { continue };
            chosen.push(id);
            if shape::is_affine(probe, root, &chosen) {
                self.strengths.push(i);
            } else {
                chosen.pop();
            }
        }
    }
}

/// The variable that is the expression; no plant has a name like this.
const PROBE: &str = "innovant_hypothesis_";

impl NewNumber {
    fn bounded(&mut self, relation: &str, value: f64) {
        if relation.starts_with('<') {
            self.max = self.max.min(value);
        } else {
            self.min = self.min.max(value);
        }
    }

    /// The value nearest to this one within the bounds.
    fn at(&self, value: f64) -> f64 {
        value.max(self.min).min(self.max)
    }

    fn parameter(&self) -> NewParameter {
        NewParameter {
            name: self.name.clone(),
            value: self.at(1.0),
            min: self.min,
            max: self.max,
            description: String::new(),
        }
    }
}

/// Whether a word is letters, digits and `_` only.
fn plain(word: &str) -> bool {
    word.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

/// Why a name is none of a new parameter.
fn mistaken(name: &str) -> Option<String> {
    match name {
        "t" => Some("time is written `time`".to_owned()),
        "pi" | "Pi" | "PI" => Some("write `Modelica.Constants.pi`".to_owned()),
        _ if !plain(name) => Some(
            "it is not declared in the plant, and a new name is of letters, digits and `_`"
                .to_owned(),
        ),
        _ => None,
    }
}

/// `a < c` is `c > a`.
fn turned(relation: &str) -> &'static str {
    if relation.starts_with('<') { ">" } else { "<" }
}

/// The tokens between the commas outside parentheses.
#[allow(clippy::type_complexity, reason = "one error, used once")]
fn split(parts: &[Part]) -> Result<Vec<&[Part]>, (Span, Option<HypothesisErrorKind>)> {
    let (mut pieces, mut depth, mut from) = (vec![], 0usize, 0);
    let unmatched = |span| Err((span, Some(HypothesisErrorKind::Parentheses)));
    for (i, (token, span)) in parts.iter().enumerate() {
        match token {
            Token::Sign("(") => depth += 1,
            Token::Sign(")") if depth == 0 => return unmatched(*span),
            Token::Sign(")") => depth -= 1,
            Token::Sign(",") if depth == 0 => {
                pieces.push(&parts[from..i]);
                from = i + 1;
            }
            Token::Text | Token::Sign(";" | ":" | ":=" | "{" | "}" | "!" | "&") => {
                return Err((*span, None));
            }
            // Behind the expression they enclose a unit, and state a start value.
            Token::Sign("[" | "]" | "=") if pieces.is_empty() => return Err((*span, None)),
            _ => {}
        }
    }
    if depth > 0 {
        let last = parts.last().map_or(Span::default(), |p| p.1);
        return unmatched(last);
    }
    pieces.push(&parts[from..]);
    Ok(pieces)
}
