//! The current token of a text, what was found so far, and errors at the place that is read.

use super::names::{Imports, Symbols};
use super::tokens::{Lexer, Token};
use crate::physics::error::{SpecError, SpecErrorKind, excerpt};
use crate::physics::expression::{ExpressionId, Expressions, Node, Span};

/// Nodes of all expressions together.
const MOST_NODES: usize = 2_000_000;

/// How to get rid of what the subset does not have.
pub(super) const FLATTEN: &str = "flatten the model with OpenModelica (`instantiateModel`, or `omc --flatModelica`) and use what it prints";
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

    pub(super) fn require_sign(&mut self, sign: &str, place: &str) -> Result<(), SpecError> {
        if self.take_sign(sign)? {
            return Ok(());
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
