//! Where a hypothesis enters, and the plant with it.

use super::{Change, Hypothesis, HypothesisErrorKind as Kind};
use crate::explain::engine::fitting::candidate::{Candidate, equation_text, free_name};
use crate::explain::engine::fitting::edit::{
    Edit, Place, keep_states_of_effects, literal, sections, with_names,
};
use crate::physics::{
    Equation, ExpressionId, ModelSpec, Node, Span, SpecErrorKind, Unknown, VariableId,
    VariableKind, nearest, parse,
};

/// What an equation determines, by name: the same in every plant that has been changed.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Determined {
    name: String,
    derivative: bool,
}

/// What a hypothesis changes.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Target {
    /// The right-hand side of the equation that determines this.
    Side(Determined),
    /// The derivative or value itself, where a factor stands beside it in the text.
    Itself(Determined),
    Input(String),
    Parameter(String),
}

/// A text without blanks.
fn dense(text: &str) -> String {
    text.chars().filter(|c| !c.is_whitespace()).collect()
}

fn left_text<'a>(spec: &'a ModelSpec, equation: &Equation) -> &'a str {
    let span = spec.expressions.span(equation.left);
    spec.text[span.start..span.end].trim()
}

fn determined(spec: &ModelSpec, unknown: Unknown) -> Determined {
    Determined {
        name: spec.variable(unknown.variable()).name.clone(),
        derivative: matches!(unknown, Unknown::Derivative(_)),
    }
}

/// Whether an expression uses a variable.
fn uses(spec: &ModelSpec, root: ExpressionId, v: VariableId) -> bool {
    let mut stack = vec![root];
    while let Some(id) = stack.pop() {
        let node = spec.expressions.node(id);
        if [Node::Variable(v), Node::Derivative(v), Node::Previous(v)].contains(&node) {
            return true;
        }
        stack.extend(node.operands());
    }
    false
}

impl Target {
    /// What a left-hand side means.
    pub(crate) fn find(left: &str, spec: &ModelSpec) -> Result<Self, Kind> {
        let wanted = dense(left);
        let written = |e: &&Equation| dense(left_text(spec, e)) == wanted;
        if let Some(equation) = spec.equations.iter().find(written) {
            return Ok(Self::Side(determined(spec, equation.unknown)));
        }
        let quoted = format!("'{wanted}'");
        let inner = wanted
            .strip_prefix("der(")
            .and_then(|w| w.strip_suffix(')'));
        let name = inner.unwrap_or(left.trim());
        let Some(v) = spec.find(name).or_else(|| spec.find(&quoted)) else {
            return Err(unknown(left, spec));
        };
        let variable = spec.variable(v);
        let own = |e: &&Equation| e.unknown.variable() == v;
        match (variable.kind, inner) {
            (VariableKind::State, None) => Err(Kind::State {
                name: name.to_owned(),
                left: spec
                    .equations
                    .iter()
                    .find(own)
                    .map_or(String::new(), |e| left_text(spec, e).to_owned()),
            }),
            (VariableKind::State, Some(_)) | (VariableKind::Algebraic, None) => {
                let Some(equation) = spec.equations.iter().find(own) else {
                    return Err(unknown(left, spec));
                };
                Ok(Self::Itself(determined(spec, equation.unknown)))
            }
            (VariableKind::Constant, _) => Err(Kind::Certain(name.to_owned())),
            (_, Some(_)) => Err(unknown(left, spec)),
            (kind, None) => {
                let used = spec
                    .equations
                    .iter()
                    .any(|e| uses(spec, e.left, v) || uses(spec, e.right, v));
                let name = variable.name.clone();
                match kind {
                    _ if !used => Err(Kind::Unused(name)),
                    VariableKind::Input => Ok(Self::Input(name)),
                    _ => Ok(Self::Parameter(name)),
                }
            }
        }
    }

    /// The place in a plant, which may have been changed since.
    fn place(&self, spec: &ModelSpec) -> Option<Place> {
        let equation = |wanted: &Determined| {
            spec.equations
                .iter()
                .position(|e| determined(spec, e.unknown) == *wanted)
                .map(Place::Equation)
        };
        match self {
            Self::Side(d) | Self::Itself(d) => equation(d),
            Self::Input(name) | Self::Parameter(name) => {
                let v = spec.find(name)?;
                // Where something has entered already, that is what acts.
                let acting = Determined {
                    name: format!("{}_acting", spec.variable(v).column()),
                    derivative: false,
                };
                let place = if matches!(self, Self::Input(_)) {
                    Place::Input(v)
                } else {
                    Place::Parameter(v)
                };
                Some(equation(&acting).unwrap_or(place))
            }
        }
    }
}

fn unknown(left: &str, spec: &ModelSpec) -> Kind {
    const MOST: usize = 24;
    let sides = spec.equations.iter().map(|e| left_text(spec, e));
    let names = spec
        .variables
        .iter()
        .filter(|v| matches!(v.kind, VariableKind::Input | VariableKind::Parameter))
        .map(|v| v.name.as_str());
    let mut known: Vec<String> = Vec::new();
    for name in sides.chain(names) {
        if !known.iter().any(|k| k == name) {
            known.push(name.to_owned());
        }
    }
    let nearest = nearest(left, known.iter().map(String::as_str));
    let more = known.len().saturating_sub(MOST);
    known.truncate(MOST);
    let mut known: Vec<String> = known.into_iter().map(|k| format!("`{k}`")).collect();
    if more > 0 {
        known.push(format!("and {more} more"));
    }
    Kind::UnknownLeft {
        left: left.to_owned(),
        nearest,
        known,
    }
}

impl Hypothesis {
    /// The expression with other words for its new parameters.
    pub(crate) fn expression_with(&self, word: impl Fn(&str) -> Option<String>) -> String {
        with_names(&self.expression, word)
    }

    /// What it adds to a right-hand side as a function of `variable`; none where it adds nothing, or depends on more.
    pub(crate) fn as_law(
        &self,
        variable: &str,
        value: impl Fn(&str) -> Option<String>,
    ) -> Option<String> {
        let [own] = self.depends.as_slice() else {
            return None;
        };
        if own == "time" {
            return None;
        }
        if self.change == Change::Replace || !matches!(self.target, Target::Side(_)) {
            return None;
        }
        let text = self.expression_with(|word| {
            if word == own {
                Some(variable.to_owned())
            } else {
                value(word)
            }
        });
        Some(match self.change {
            Change::Subtract => format!("-({text})"),
            _ => text,
        })
    }

    pub(super) fn place(&self, spec: &ModelSpec) -> Option<Place> {
        self.target.place(spec)
    }

    /// Whether all of the right-hand side is replaced, and what stands there now; none where only a term is added.
    pub(super) fn replaced(&self, spec: &ModelSpec) -> Option<String> {
        if self.change != Change::Replace || matches!(self.target, Target::Itself(_)) {
            return None;
        }
        Some(match self.place(spec)? {
            Place::Equation(at) => {
                let span = spec.expressions.span(spec.equations[at].right);
                spec.text[span.start..span.end].to_owned()
            }
            Place::Input(v) | Place::Parameter(v) => spec.variable(v).name.clone(),
        })
    }

    /// The plant with it, its new parameters at these values.
    pub(super) fn candidate(&self, spec: &ModelSpec, values: &[f64]) -> Result<Candidate, Kind> {
        let place = self
            .place(spec)
            .ok_or_else(|| Kind::Unused(self.name.clone()))?;
        let names: Vec<String> = self
            .numbers
            .iter()
            .map(|n| free_name(spec, &n.name))
            .collect();
        let expression = self.expression_with(|word| {
            let at = self.numbers.iter().position(|n| n.name == word)?;
            Some(names[at].clone())
        });
        let form = match (&self.target, place) {
            (Target::Itself(_), Place::Equation(at)) => {
                self.beside_factor(spec, at, &expression)?
            }
            _ => match self.change {
                Change::Add if expression.starts_with('-') && !is_sum(&expression) => {
                    format!("{{v}} - {}", factor(expression[1..].trim_start()))
                }
                Change::Add => format!("{{v}} + {}", grouped(&expression)),
                Change::Subtract => format!("{{v}} - {}", factor(&expression)),
                Change::Replace => expression.clone(),
            },
        };
        let declared = self.numbers.iter().zip(&names).zip(values);
        let edit = Edit {
            declarations: declared
                .map(|((number, name), &value)| {
                    let mut attributes: Vec<String> = Vec::new();
                    attributes.extend(number.unit.as_ref().map(|u| format!("unit=\"{u}\"")));
                    for (word, bound) in [("min", number.min), ("max", number.max)] {
                        if bound.is_finite() {
                            attributes.push(format!("{word}={}", literal(bound)));
                        }
                    }
                    let attributes = if attributes.is_empty() {
                        String::new()
                    } else {
                        format!("({})", attributes.join(", "))
                    };
                    format!("parameter Real {name}{attributes} = {};", literal(value))
                })
                .collect(),
            changes: vec![(place, form)],
            ..Edit::default()
        };
        let text = edit.text(spec);
        let mut changed = parse(&text).map_err(|e| {
            let new = edit.declarations.len() + usize::from(!matches!(place, Place::Equation(_)));
            Kind::Unsolved(in_lines_of(&spec.text, new, *e.kind))
        })?;
        keep_states_of_effects(&mut changed, spec);
        Ok(Candidate {
            equation: equation_text(&changed, spec, place),
            plant: crate::physics::Plant::new(changed),
            names,
            values: values.to_vec(),
            new_states: 0,
            own_starts: 0,
            starts: vec![],
        })
    }

    /// The right-hand side where the term enters the derivative itself: what the left-hand side makes of it.
    fn beside_factor(&self, spec: &ModelSpec, at: usize, expression: &str) -> Result<String, Kind> {
        let equation = &spec.equations[at];
        let v = equation.unknown.variable();
        let left = left_text(spec, equation);
        let wanted = match equation.unknown {
            Unknown::Derivative(_) => Node::Derivative(v),
            Unknown::Value(_) => Node::Variable(v),
        };
        let mut spans: Vec<Span> = Vec::new();
        let mut product = true;
        let mut stack = vec![equation.left];
        while let Some(id) = stack.pop() {
            let node = spec.expressions.node(id);
            if node == wanted {
                spans.push(spec.expressions.span(id));
                continue;
            }
            let inside = uses(spec, id, v);
            product &= !inside
                || matches!(
                    node,
                    Node::Negate(_)
                        | Node::Binary(
                            crate::physics::Binary::Multiply | crate::physics::Binary::Divide,
                            ..
                        )
                );
            if inside {
                stack.extend(node.operands());
            }
        }
        if !product
            || spans.len() != 1
            || uses(spec, equation.right, v) && self.both_sides(spec, at)
        {
            let name = &spec.variable(v).name;
            return Err(Kind::Implicit {
                left: match equation.unknown {
                    Unknown::Derivative(_) => format!("der({name})"),
                    Unknown::Value(_) => name.clone(),
                },
                written: left.to_owned(),
            });
        }
        let start = spec.expressions.span(equation.left).start;
        let whole = &spec.text[start..spec.expressions.span(equation.left).end];
        let (from, to) = (spans[0].start - start, spans[0].end - start);
        let scaled = format!("{}({expression}){}", &whole[..from], &whole[to..]);
        let scaled = scaled.trim();
        Ok(match self.change {
            Change::Add => format!("{{v}} + {}", grouped(scaled)),
            Change::Subtract => format!("{{v}} - {}", factor(scaled)),
            Change::Replace => scaled.to_owned(),
        })
    }

    /// Whether the unknown of an equation stands on its right-hand side too.
    fn both_sides(&self, spec: &ModelSpec, at: usize) -> bool {
        let equation = &spec.equations[at];
        let v = equation.unknown.variable();
        let wanted = match equation.unknown {
            Unknown::Derivative(_) => Node::Derivative(v),
            Unknown::Value(_) => Node::Variable(v),
        };
        let mut stack = vec![equation.right];
        while let Some(id) = stack.pop() {
            let node = spec.expressions.node(id);
            if node == wanted {
                return true;
            }
            stack.extend(node.operands());
        }
        false
    }
}

/// An error of the changed text with the lines of the text before `new` declarations came in, above its equations.
fn in_lines_of(before: &str, new: usize, mut kind: SpecErrorKind) -> SpecErrorKind {
    let above = sections(before).map_or(0, |(at, _)| before[..at].matches('\n').count());
    if let SpecErrorKind::AlgebraicLoop { lines, .. } = &mut kind {
        for line in lines.iter_mut().filter(|l| **l > above) {
            *line = line.saturating_sub(new).max(above);
        }
    }
    kind
}

/// A sign or a word with which an expression means something else behind another sign.
fn grouped(text: &str) -> String {
    let loose = [" if ", " and ", " or ", "<", ">", "="];
    if text.starts_with(['-', '+'])
        || text.starts_with("if")
        || loose.iter().any(|l| text.contains(l))
    {
        format!("({text})")
    } else {
        text.to_owned()
    }
}

/// An expression behind a minus sign: sums need parentheses.
fn factor(text: &str) -> String {
    let plain = grouped(text);
    if is_sum(text) && plain == text {
        format!("({text})")
    } else {
        plain
    }
}

/// Whether a `+` or `-` stands outside parentheses, behind the first sign. The sign of an exponent (`1e-3`) counts too: it
/// costs a pair of parentheses.
fn is_sum(text: &str) -> bool {
    let mut depth = 0i32;
    text.char_indices().any(|(i, c)| {
        match c {
            '(' => depth += 1,
            ')' => depth -= 1,
            _ => {}
        }
        depth == 0 && i > 0 && matches!(c, '+' | '-')
    })
}
