//! Words and signs of a model text.

use crate::physics::error::{SpecError, SpecErrorKind, shortened};
use crate::physics::expression::Span;

/// Kind of a token; what it says is the text of its span.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Token {
    /// A name, dotted or quoted, or a word of the language.
    Name,
    /// A number.
    Number(f64),
    /// A text in quotes.
    Text,
    /// A sign.
    Sign(&'static str),
    /// End of the text.
    End,
}

/// Signs, longer ones before those that they start with.
const SIGNS: [&str; 30] = [
    ":=", "==", "<>", "<=", ">=", ".*", "./", ".^", ".+", ".-", "(", ")", "[", "]", "{", "}", ",",
    ";", ":", "=", "<", ">", "+", "-", "*", "/", "^", ".", "!", "&",
];

/// Characters that word processors and web pages put in the place of signs.
const LOOKALIKES: [(&str, &str); 7] = [
    ("\u{2212}\u{2013}\u{2014}\u{2010}\u{2011}", "`-`"),
    ("\u{d7}\u{b7}\u{2217}\u{22c5}", "`*`"),
    ("\u{f7}\u{2215}", "`/`"),
    ("\u{201c}\u{201d}\u{201e}\u{2018}\u{2019}", "`\"`"),
    ("\u{a0}\u{202f}\u{2009}\u{200b}\u{3000}", "a space"),
    ("\u{2264}", "`<=`"),
    ("\u{2265}", "`>=`"),
];

/// The tokens of a text that is no whole model, without its end.
pub(crate) fn tokens(text: &str) -> Result<Vec<(Token, Span)>, SpecError> {
    let mut lexer = Lexer::new(text);
    let mut all = Vec::new();
    loop {
        match lexer.next()? {
            (Token::End, _) => return Ok(all),
            found => all.push(found),
        }
    }
}

/// Reads token after token.
pub(super) struct Lexer<'a> {
    text: &'a str,
    at: usize,
    /// True behind an error after which signs and words cannot be told from the inside of a text or comment.
    stopped: bool,
}

impl<'a> Lexer<'a> {
    pub(super) fn new(text: &'a str) -> Self {
        let at = if text.starts_with('\u{feff}') { 3 } else { 0 };
        Self {
            text,
            at,
            stopped: false,
        }
    }

    /// The next token.
    pub(super) fn next(&mut self) -> Result<(Token, Span), SpecError> {
        self.skip_blank()?;
        let start = self.at;
        let Some(byte) = self.byte(0) else {
            return Ok((Token::End, Span { start, end: start }));
        };
        let token = match byte {
            b'0'..=b'9' => self.number()?,
            b'"' => {
                self.quoted(b'"', "text")?;
                Token::Text
            }
            b'.' if self.byte(1).is_some_and(|b| b.is_ascii_digit()) => {
                self.at += 1;
                self.digits();
                return Err(self.error(
                    start,
                    format!(
                        "a number starts with a digit: write `0{}`",
                        &self.text[start..self.at]
                    ),
                ));
            }
            b'.' if self.byte(1).is_some_and(starts_name) => {
                self.at += 1;
                self.name()?
            }
            b if starts_name(b) => self.name()?,
            _ => self.sign()?,
        };
        Ok((
            token,
            Span {
                start,
                end: self.at,
            },
        ))
    }

    pub(super) fn is_stopped(&self) -> bool {
        self.stopped
    }

    fn byte(&self, ahead: usize) -> Option<u8> {
        self.text.as_bytes().get(self.at + ahead).copied()
    }

    fn error(&self, start: usize, message: String) -> SpecError {
        let end = self.at.max(start);
        SpecError::new(
            self.text,
            Span { start, end },
            SpecErrorKind::Syntax(message),
        )
    }

    fn skip_blank(&mut self) -> Result<(), SpecError> {
        loop {
            match (self.byte(0), self.byte(1)) {
                (Some(b' ' | b'\t' | b'\r' | b'\n' | 0x0b | 0x0c), _) => self.at += 1,
                (Some(b'/'), Some(b'/')) => {
                    let rest = &self.text[self.at..];
                    self.at += rest.find(['\n', '\r']).unwrap_or(rest.len());
                }
                (Some(b'/'), Some(b'*')) => {
                    let start = self.at;
                    match self.text[start + 2..].find("*/") {
                        Some(length) => self.at = start + 2 + length + 2,
                        None => {
                            self.at = start + 2;
                            self.stopped = true;
                            return Err(self
                                .error(start, "this comment has no end: `*/` is missing".into()));
                        }
                    }
                }
                _ => return Ok(()),
            }
        }
    }

    fn digits(&mut self) {
        while self.byte(0).is_some_and(|b| b.is_ascii_digit()) {
            self.at += 1;
        }
    }

    fn number(&mut self) -> Result<Token, SpecError> {
        let start = self.at;
        self.digits();
        if self.byte(0) == Some(b'.') {
            self.at += 1;
            self.digits();
        }
        if matches!(self.byte(0), Some(b'e' | b'E')) {
            let signed = usize::from(matches!(self.byte(1), Some(b'+' | b'-')));
            if self.byte(1 + signed).is_some_and(|b| b.is_ascii_digit()) {
                self.at += 1 + signed;
                self.digits();
            }
        }
        if self.byte(0).is_some_and(starts_name) {
            let number_end = self.at;
            self.at += 1;
            return Err(self.error(
                start,
                format!(
                    "a letter directly behind the number `{}`: a product is written with `*`",
                    shortened(&self.text[start..number_end])
                ),
            ));
        }
        let written = &self.text[start..self.at];
        match written.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(Token::Number(value)),
            _ => Err(self.error(
                start,
                format!(
                    "the number `{}` is too large: the largest is 1.8e308",
                    shortened(written)
                ),
            )),
        }
    }

    /// A dotted name, whose parts may be quoted.
    fn name(&mut self) -> Result<Token, SpecError> {
        loop {
            if self.byte(0) == Some(b'\'') {
                self.quoted(b'\'', "quoted name")?;
            } else {
                while self
                    .byte(0)
                    .is_some_and(|b| b == b'_' || b.is_ascii_alphanumeric())
                {
                    self.at += 1;
                }
            }
            if self.byte(0) == Some(b'.') && self.byte(1).is_some_and(starts_name) {
                self.at += 1;
            } else {
                return Ok(Token::Name);
            }
        }
    }

    fn quoted(&mut self, quote: u8, what: &str) -> Result<(), SpecError> {
        let start = self.at;
        self.at += 1;
        loop {
            match self.byte(0) {
                Some(b'\\') => self.at += 2,
                Some(b) if b == quote => {
                    self.at += 1;
                    return Ok(());
                }
                Some(_) => self.at += 1,
                None => {
                    self.at = start + 1;
                    self.stopped = true;
                    let hint = if quote == b'\'' {
                        "; a derivative is written `der(x)`"
                    } else {
                        ""
                    };
                    let quote = char::from(quote);
                    return Err(self.error(
                        start,
                        format!("this {what} has no end: a closing `{quote}` is missing{hint}"),
                    ));
                }
            }
        }
    }

    fn sign(&mut self) -> Result<Token, SpecError> {
        let rest = &self.text[self.at..];
        if let Some(sign) = SIGNS.iter().find(|s| rest.starts_with(**s)) {
            self.at += sign.len();
            return Ok(Token::Sign(sign));
        }
        let start = self.at;
        let c = rest.chars().next().unwrap_or('?');
        self.at += c.len_utf8();
        let message = if c.is_control() || c == '\u{fffd}' {
            self.stopped = true;
            format!(
                "the character U+{:04X} is in no Modelica text: this looks like a binary file",
                u32::from(c)
            )
        } else if c.is_alphabetic() {
            format!(
                "the letter `{c}` is not allowed in a name: names have letters a-z and A-Z, digits and `_`, or stand in \
                 single quotes"
            )
        } else if matches!(c, '%' | '#') {
            format!("the character `{c}` has no meaning here: comments start with `//`")
        } else if let Some((_, plain)) = LOOKALIKES.iter().find(|l| l.0.contains(c)) {
            format!(
                "the character `{c}` (U+{:04X}) only looks like {plain}: write {plain}",
                u32::from(c)
            )
        } else {
            format!("the character `{c}` has no meaning here")
        };
        Err(self.error(start, message))
    }
}

fn starts_name(byte: u8) -> bool {
    byte == b'_' || byte == b'\'' || byte.is_ascii_alphabetic()
}

/// What a text in quotes says.
pub(super) fn unescape(quoted: &str) -> String {
    let inner = quoted
        .strip_prefix('"')
        .and_then(|q| q.strip_suffix('"'))
        .unwrap_or(quoted);
    let mut answer = String::with_capacity(inner.len());
    let mut chars = inner.chars();
    while let Some(c) = chars.next() {
        match c {
            '\\' => match chars.next() {
                Some('n') => answer.push('\n'),
                Some('t') => answer.push('\t'),
                Some('r') => answer.push('\r'),
                Some('a' | 'b' | 'f' | 'v') | None => {}
                Some(other) => answer.push(other),
            },
            c => answer.push(c),
        }
    }
    answer
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<(Token, &str)>, String> {
        let mut lexer = Lexer::new(text);
        let mut answer = vec![];
        loop {
            match lexer.next() {
                Ok((Token::End, _)) => return Ok(answer),
                Ok((token, span)) => answer.push((token, &text[span.start..span.end])),
                Err(error) => return Err(error.to_string()),
            }
        }
    }

    #[test]
    fn names_numbers_texts_and_signs() {
        let tokens = read("\u{feff}a.b 'x y'.c .d // c\n 1.5e-3*2. /* x */ \"s\\\"t\"<>").unwrap();
        let texts: Vec<&str> = tokens.iter().map(|t| t.1).collect();
        assert_eq!(
            texts,
            [
                "a.b",
                "'x y'.c",
                ".d",
                "1.5e-3",
                "*",
                "2.",
                "\"s\\\"t\"",
                "<>"
            ]
        );
        assert_eq!(tokens[3].0, Token::Number(1.5e-3));
        assert_eq!(unescape("\"s\\\"t\\n\""), "s\"t\n");
    }

    #[test]
    fn what_is_no_token() {
        for (text, message) in [
            (
                "1e999",
                "line 1, column 1: the number `1e999` is too large: the largest is 1.8e308",
            ),
            (
                ".5",
                "line 1, column 1: a number starts with a digit: write `0.5`",
            ),
            (
                "2x",
                "line 1, column 1: a letter directly behind the number `2`: a product is written with `*`",
            ),
            (
                "a\n /* b",
                "line 2, column 2: this comment has no end: `*/` is missing",
            ),
            (
                "\"b\\",
                "line 1, column 1: this text has no end: a closing `\"` is missing",
            ),
            (
                "'b",
                "line 1, column 1: this quoted name has no end: a closing `'` is missing; a derivative is written `der(x)`",
            ),
            (
                "\u{0}",
                "line 1, column 1: the character U+0000 is in no Modelica text: this looks like a binary file",
            ),
            (
                "é",
                "line 1, column 1: the letter `é` is not allowed in a name: names have letters a-z and A-Z, digits and `_`, or stand in single quotes",
            ),
            (
                "§",
                "line 1, column 1: the character `§` has no meaning here",
            ),
        ] {
            assert_eq!(read(text), Err(message.to_string()));
        }
    }
}
