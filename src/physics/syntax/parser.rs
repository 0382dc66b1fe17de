//! The current token of a text, what was found so far, and errors at the place that is read.

use super::names::{Imports, Symbols};
use super::tokens::{Lexer, Token};
use crate::physics::error::{MOST_ERRORS, SpecError, SpecErrorKind, excerpt};
use crate::physics::expression::{ExpressionId, Expressions, Node, Span};
use std::collections::HashSet;

/// Nodes of all expressions together.
const MOST_NODES: usize = 2_000_000;

/// How to get rid of what the subset does not have.
pub(super) const FLATTEN: &str = "flatten the model with OpenModelica (`instantiateModel`, or `omc --flatModelica`) and use what it prints";
/// Words that start a declaration or another section, and stand in no expression: reading can go on there after an error.
const STARTS: [&str; 11] = [
    "constant",
    "end",
    "equation",
    "final",
    "import",
    "input",
    "output",
    "parameter",
    "protected",
    "public",
    "Real",
];

/// Words whose construct does not end with the next `;`.
const BLOCKS: [&str; 18] = [
    "algorithm",
    "block",
    "class",
    "connector",
    "expandable",
    "for",
    "function",
    "if",
    "impure",
    "initial",
    "model",
    "operator",
    "package",
    "pure",
    "record",
    "type",
    "when",
    "while",
];

pub(super) const ARRAYS: &str = "write one variable for each element, as in `x1`, `x2`, `x3`";

/// An operand: its node and its type.
#[derive(Debug, Clone, Copy)]
pub(super) struct Typed {
    pub(super) id: ExpressionId,
    /// True for a condition, false for a number.
    pub(super) condition: bool,
}

impl Typed {
    pub(super) fn number(id: ExpressionId) -> Self {
        Typed {
            id,
            condition: false,
        }
    }

    pub(super) fn condition(id: ExpressionId) -> Self {
        Typed {
            id,
            condition: true,
        }
    }
}

/// Reads a text: the current token, and what was found so far.
pub(super) struct Parser<'a> {
    pub(super) text: &'a str,
    lexer: Lexer<'a>,
    pub(super) token: Token,
    pub(super) span: Span,
    /// Where the token before the current one ends.
    pub(super) previous_end: usize,
    pub(super) expressions: Expressions,
    pub(super) symbols: Symbols<'a>,
    pub(super) imports: Imports<'a>,
    /// How deep the current expression is nested.
    pub(super) depth: usize,
    /// Names that are declared so far.
    pub(super) declared: HashSet<&'a str>,
    /// Errors behind which reading went on.
    pub(super) errors: Vec<SpecError>,
    /// Names in parts that could not be read, which may be declarations.
    pub(super) unread: HashSet<&'a str>,
}

impl<'a> Parser<'a> {
    pub(super) fn new(text: &'a str) -> Result<Self, SpecError> {
        let mut parser = Self {
            text,
            lexer: Lexer::new(text),
            token: Token::End,
            span: Span::default(),
            previous_end: 0,
            expressions: Expressions::default(),
            symbols: Symbols::default(),
            imports: Imports::default(),
            depth: 0,
            declared: HashSet::new(),
            errors: vec![],
            unread: HashSet::new(),
        };
        parser.advance()?;
        Ok(parser)
    }

    pub(super) fn advance(&mut self) -> Result<(), SpecError> {
        self.previous_end = self.span.end;
        (self.token, self.span) = self.lexer.next()?;
        Ok(())
    }

    /// The current token as written.
    pub(super) fn word(&self) -> &'a str {
        &self.text[self.span.start..self.span.end]
    }

    pub(super) fn at_word(&self, word: &str) -> bool {
        self.token == Token::Name && self.word() == word
    }

    pub(super) fn at_sign(&self, sign: &str) -> bool {
        matches!(self.token, Token::Sign(s) if s == sign)
    }

    /// Steps over a word if it is the current token.
    pub(super) fn take_word(&mut self, word: &str) -> Result<bool, SpecError> {
        let here = self.at_word(word);
        if here {
            self.advance()?;
        }
        Ok(here)
    }

    /// Steps over a sign if it is the current token.
    pub(super) fn take_sign(&mut self, sign: &str) -> Result<bool, SpecError> {
        let here = self.at_sign(sign);
        if here {
            self.advance()?;
        }
        Ok(here)
    }

    /// Keeps an error in a declaration or an equation that starts at `start`, and steps to the next one.
    ///
    /// # Errors
    /// The error itself where what follows would be misread.
    pub(super) fn recover(&mut self, error: SpecError, start: usize) -> Result<(), SpecError> {
        let block = matches!(*error.kind, SpecErrorKind::Unsupported { .. })
            && self.token == Token::Name
            && BLOCKS.contains(&self.word());
        let limit = matches!(*error.kind, SpecErrorKind::Limit(_));
        if block || limit || self.lexer.is_stopped() || self.errors.len() + 1 >= MOST_ERRORS {
            return Err(error);
        }
        self.depth = 0;
        // A reserved word in the place of a name starts nothing.
        let mut moved =
            self.span.start > start && !matches!(*error.kind, SpecErrorKind::Reserved(_));
        loop {
            match self.token {
                Token::End => return Err(error),
                Token::Sign(";") if self.span.start >= error.span().start => {
                    self.note_unread(start);
                    self.errors.push(error);
                    return self.advance();
                }
                Token::Name if moved && STARTS.contains(&self.word()) => {
                    self.note_unread(start);
                    self.errors.push(error);
                    return Ok(());
                }
                // A second error in the same part says nothing new.
                _ => {
                    if self.advance().is_err() && self.lexer.is_stopped() {
                        return Err(error);
                    }
                    moved = true;
                }
            }
        }
    }

    /// Notes the names from `start` to the current token.
    fn note_unread(&mut self, start: usize) {
        let text = self.text;
        let part = text.get(start..self.span.start).unwrap_or("");
        let mut lexer = Lexer::new(part);
        loop {
            match lexer.next() {
                Ok((Token::End, _)) => return,
                Ok((Token::Name, span)) => {
                    self.unread.insert(&part[span.start..span.end]);
                }
                Ok(_) => {}
                Err(_) if lexer.is_stopped() => return,
                Err(_) => {}
            }
        }
    }

    pub(super) fn require_sign(&mut self, sign: &str, place: &str) -> Result<(), SpecError> {
        if self.take_sign(sign)? {
            return Ok(());
        }
        let between = self.text.get(self.previous_end..self.span.start);
        let ends_a_line = between.is_some_and(|b| b.contains('\n'));
        if sign == ";" && ends_a_line && matches!(self.token, Token::Name | Token::End) {
            let (start, end) = (self.previous_end.saturating_sub(1), self.previous_end);
            let span = Span { start, end };
            return Err(self.syntax(span, "a `;` is missing at the end of this line"));
        }
        if sign == ";" && self.at_sign(",") {
            return Err(self.syntax(
                self.span,
                "expected `;`, found `,`: a decimal number is written with a point, as in `0.5`",
            ));
        }
        Err(self.expected(&format!("`{sign}` {place}")))
    }

    pub(super) fn error(&self, span: Span, kind: SpecErrorKind) -> SpecError {
        SpecError::new(self.text, span, kind)
    }

    pub(super) fn syntax(&self, span: Span, message: impl Into<String>) -> SpecError {
        self.error(span, SpecErrorKind::Syntax(message.into()))
    }

    pub(super) fn expected(&self, expected: &str) -> SpecError {
        let found = match self.token {
            Token::End => "the end of the text".to_string(),
            _ => format!("`{}`", excerpt(self.text, self.span)),
        };
        let expected = expected.to_string();
        self.error(self.span, SpecErrorKind::Expected { expected, found })
    }

    pub(super) fn unsupported(&self, span: Span, construct: &str, advice: &str) -> SpecError {
        let (construct, advice) = (construct.to_string(), advice.to_string());
        self.error(span, SpecErrorKind::Unsupported { construct, advice })
    }

    pub(super) fn no_arrays(&self) -> SpecError {
        self.unsupported(self.span, "arrays are", ARRAYS)
    }

    pub(super) fn push(&mut self, node: Node, span: Span) -> Result<ExpressionId, SpecError> {
        if self.expressions.len() >= MOST_NODES {
            let message = format!("the expressions of the model have more than {MOST_NODES} parts");
            return Err(self.error(span, SpecErrorKind::Limit(message)));
        }
        Ok(self.expressions.push(node, span))
    }

    pub(super) fn since(&self, start: usize) -> Span {
        let end = self.previous_end;
        Span { start, end }
    }

    pub(super) fn mistyped(&self, id: ExpressionId, message: &str) -> SpecError {
        let span = self.expressions.span(id);
        let message = format!("`{}` {message}", excerpt(self.text, span));
        self.error(span, SpecErrorKind::Type(message))
    }

    pub(super) fn as_number(&self, value: Typed) -> Result<ExpressionId, SpecError> {
        if value.condition {
            return Err(self.mistyped(value.id, "is a condition, and a number is needed here"));
        }
        Ok(value.id)
    }

    pub(super) fn as_condition(&self, value: Typed) -> Result<ExpressionId, SpecError> {
        if value.condition {
            return Ok(value.id);
        }
        Err(self.mistyped(
            value.id,
            "is a number, and a condition is needed here, such as `x > 0`",
        ))
    }
}
