//! What can be wrong with a hypothesis, and where.

use crate::physics::{Span, SpecErrorKind};

/// An error in the text of a hypothesis.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("column {}: {kind}", self.column())]
pub struct HypothesisError {
    /// The whole text.
    pub text: String,
    /// The part of it that the error is about.
    pub span: Span,
    /// What is wrong.
    pub kind: HypothesisErrorKind,
}

/// What can be wrong with a hypothesis.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages explain the fields")]
pub enum HypothesisErrorKind {
    #[error(
        "a hypothesis begins with a name of letters, digits and `_`, and a colon, as in `drag: m*der(v) += -c*v*abs(v), c > 0`"
    )]
    Name,
    #[error("two hypotheses are called `{0}`: give one another name")]
    SameName(String),
    #[error(
        "expected `+=` (a term more), `-=` (a term less) or `=` (another right-hand side) behind the left-hand side"
    )]
    Operator,
    #[error(
        "`{left}` is no left-hand side, input or parameter of the plant{}; it has {}",
        .nearest.as_ref().map(|n| format!(" (did you mean `{n}`?)")).unwrap_or_default(),
        .known.join(", ")
    )]
    UnknownLeft {
        left: String,
        nearest: Option<String>,
        known: Vec<String>,
    },
    #[error(
        "`{name}` is a state: write the left-hand side of its equation, `{left}`, or its derivative, `der({name})`"
    )]
    State { name: String, left: String },
    #[error("`{0}` is certain: declare it `parameter` in the plant, and a term can enter it")]
    Certain(String),
    #[error("no equation of the plant uses `{0}`, so that nothing can enter there")]
    Unused(String),
    #[error(
        "`{left}` is not alone on the left-hand side of its equation: write that side as the text does, `{written}`"
    )]
    Implicit { left: String, written: String },
    #[error("an expression is missing here, such as `-c*v*abs(v)`")]
    Empty,
    #[error("`{0}` has no place in a hypothesis")]
    Stray(String),
    #[error("comments have no place in a hypothesis; in a file of hypotheses `#` begins one")]
    Comment,
    #[error("the parentheses do not match")]
    Parentheses,
    #[error(
        "`{name}` is no function{}; functions are {}",
        .nearest.as_ref().map(|n| format!(" (did you mean `{n}`?)")).unwrap_or_default(),
        .known.join(", ")
    )]
    UnknownFunction {
        name: String,
        nearest: Option<String>,
        known: Vec<&'static str>,
    },
    #[error("`{name}` cannot be the name of a new parameter: {instead}")]
    Mistaken { name: String, instead: String },
    #[error(
        "expected a bound of a new parameter (`c > 0`, `0 < c < 3`), its start value (`c = 0.1`) or its unit (`c [N.s/m]`)"
    )]
    Bound,
    #[error("`{name}` is no new parameter of this hypothesis{}", known_numbers(.new))]
    NotNew { name: String, new: Vec<String> },
    #[error("no value of `{0}` is within its bounds")]
    NoValue(String),
    #[error("the start value of `{0}` is given twice")]
    TwoStarts(String),
    #[error("the unit `{0}` is not known: write it as in Modelica, such as `N.s2/m2`")]
    Unit(String),
    #[error("{0}")]
    Language(SpecErrorKind),
    #[error("with this the equations cannot be solved: {0}")]
    Unsolved(SpecErrorKind),
}

fn known_numbers(new: &[String]) -> String {
    if new.is_empty() {
        "; it has none".to_owned()
    } else {
        format!("; it has {}", new.join(", "))
    }
}

impl HypothesisError {
    pub(crate) fn new(text: &str, span: Span, kind: HypothesisErrorKind) -> Self {
        Self {
            text: text.to_owned(),
            span,
            kind,
        }
    }

    /// Characters before the part that is wrong, from 1.
    pub fn column(&self) -> usize {
        let head = self.text.get(..self.span.start).unwrap_or(&self.text);
        head.chars().count() + 1
    }

    /// The message, the text, and marks under the part that is wrong.
    pub fn render(&self, origin: &str) -> String {
        let text: String = self
            .text
            .chars()
            .map(|c| if c.is_control() { ' ' } else { c })
            .collect();
        let before = self.column() - 1;
        let marked = self
            .text
            .get(self.span.start..self.span.end)
            .map_or(0, |part| part.chars().count());
        format!(
            "{origin}, {self}\n   | {text}\n   | {}{}",
            " ".repeat(before),
            "^".repeat(marked.max(1))
        )
    }
}
