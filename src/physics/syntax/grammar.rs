//! Expressions, by recursive descent over the nesting and loops over everything else.

use super::draft::DraftExpression;
use super::names::{self, Callee};
use super::parser::{ARRAYS, FLATTEN, Parser, Typed};
use super::tokens::Token;
use crate::physics::error::{SpecError, SpecErrorKind, excerpt, line_of, shortened};
use crate::physics::expression::{Binary, Node, Span};

/// Parentheses, calls and if-expressions inside each other.
const DEEPEST: usize = 200;

/// How strongly an operator binds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Level {
    Or,
    And,
    Not,
    Relation,
    Sum,
    Product,
    Factor,
}

/// An operator whose right operand is not read yet.
#[derive(Debug, Clone, Copy)]
enum Waiting {
    Sign {
        start: usize,
        negative: bool,
    },
    Not {
        start: usize,
    },
    Binary {
        start: usize,
        operator: Binary,
        level: Level,
        left: Typed,
    },
}

impl Waiting {
    fn level(&self) -> Level {
        match *self {
            Self::Sign { .. } => Level::Sum,
            Self::Not { .. } => Level::Not,
            Self::Binary { level, .. } => level,
        }
    }

    /// The weakest operator that its operand may have.
    fn operand(&self) -> Level {
        match self.level() {
            Level::Or => Level::And,
            Level::And => Level::Not,
            Level::Not => Level::Relation,
            Level::Relation => Level::Sum,
            Level::Sum => Level::Product,
            Level::Product | Level::Factor => Level::Factor,
        }
    }
}

impl<'a> Parser<'a> {
    /// An expression that is a number.
    pub(super) fn number(&mut self) -> Result<DraftExpression, SpecError> {
        let first = self.expressions.len();
        let value = self.expression()?;
        let root = self.as_number(value)?;
        Ok(DraftExpression { first, root })
    }

    pub(super) fn expression(&mut self) -> Result<Typed, SpecError> {
        if self.depth >= DEEPEST {
            return Err(self.too_deep());
        }
        self.depth += 1;
        let answer = if self.at_word("if") {
            self.choice()
        } else {
            self.operators()
        };
        self.depth -= 1;
        answer
    }

    fn too_deep(&self) -> SpecError {
        let message = format!(
            "expressions are nested more than {DEEPEST} deep: name parts of this one, or use `elseif`"
        );
        self.error(self.span, SpecErrorKind::Limit(message))
    }

    /// `if a then b elseif c then d else e`, as a choice inside the else-branch of another.
    fn choice(&mut self) -> Result<Typed, SpecError> {
        let mut branches = vec![];
        loop {
            let start = self.span.start;
            self.advance()?;
            let condition = self.expression()?;
            let condition = self.as_condition(condition)?;
            if !self.take_word("then")? {
                return Err(self.expected("`then` behind the condition"));
            }
            let yes = self.expression()?;
            branches.push((start, condition, self.as_number(yes)?));
            if !self.at_word("elseif") {
                break;
            }
        }
        if !self.take_word("else")? {
            return Err(self.expected(
                "an operator, `elseif` or `else`: an if-expression needs a value for every case",
            ));
        }
        let no = self.expression()?;
        let mut no = self.as_number(no)?;
        for (start, condition, yes) in branches.into_iter().rev() {
            let node = Node::If { condition, yes, no };
            no = self.push(node, self.since(start))?;
        }
        Ok(Typed::number(no))
    }

    /// Operators and their operands. Those that wait for their right operand stand in a list, not on the stack.
    fn operators(&mut self) -> Result<Typed, SpecError> {
        let mut waiting: Vec<Waiting> = vec![];
        loop {
            let mut start = self.span.start;
            let least = waiting.last().map_or(Level::Or, Waiting::operand);
            if least <= Level::Sum && (self.at_sign("-") || self.at_sign("+")) {
                let negative = self.at_sign("-");
                self.advance()?;
                waiting.push(Waiting::Sign { start, negative });
                continue;
            }
            if least <= Level::Not && self.take_word("not")? {
                waiting.push(Waiting::Not { start });
                continue;
            }
            let mut left = self.factor()?;
            let next = self.operator()?;
            while let Some(last) = waiting.pop() {
                if next.is_some_and(|n| n.1 > last.level()) {
                    waiting.push(last);
                    break;
                }
                (left, start) = self.complete(last, left)?;
            }
            let Some((operator, level)) = next else {
                return Ok(left);
            };
            self.advance()?;
            waiting.push(Waiting::Binary {
                start,
                operator,
                level,
                left,
            });
        }
    }

    /// Gives an operator its right operand; the answer stands from the second value on.
    fn complete(&mut self, waiting: Waiting, right: Typed) -> Result<(Typed, usize), SpecError> {
        let (node, start) = match waiting {
            Waiting::Sign { start, negative } => {
                let operand = self.as_number(right)?;
                if !negative {
                    return Ok((right, start));
                }
                (Node::Negate(operand), start)
            }
            Waiting::Not { start } => (Node::Not(self.as_condition(right)?), start),
            Waiting::Binary {
                start,
                operator,
                level,
                left,
            } => return Ok((self.combine(start, operator, level, left, right)?, start)),
        };
        let id = self.push(node, self.since(start))?;
        let condition = matches!(node, Node::Not(_));
        Ok((Typed { id, condition }, start))
    }

    fn combine(
        &mut self,
        start: usize,
        operator: Binary,
        level: Level,
        left: Typed,
        right: Typed,
    ) -> Result<Typed, SpecError> {
        let logical = level <= Level::And;
        let chained =
            matches!(self.expressions.node(left.id), Node::Binary(b, ..) if is_relation(b));
        if level == Level::Relation && left.condition && chained {
            return Err(self.mistyped(
                left.id,
                "is compared once more: comparisons are joined with `and`, as in `a < b and b < c`",
            ));
        }
        let (a, b) = if logical {
            (self.as_condition(left)?, self.as_condition(right)?)
        } else {
            (self.as_number(left)?, self.as_number(right)?)
        };
        let id = self.push(Node::Binary(operator, a, b), self.since(start))?;
        let condition = level <= Level::Relation;
        Ok(Typed { id, condition })
    }

    /// The operator that the current token is.
    fn operator(&self) -> Result<Option<(Binary, Level)>, SpecError> {
        Ok(Some(match self.token {
            Token::Name => match self.word() {
                "or" => (Binary::Or, Level::Or),
                "and" => (Binary::And, Level::And),
                _ => return Ok(None),
            },
            Token::Sign(sign) => match sign {
                "<" => (Binary::Less, Level::Relation),
                "<=" => (Binary::LessOrEqual, Level::Relation),
                ">" => (Binary::Greater, Level::Relation),
                ">=" => (Binary::GreaterOrEqual, Level::Relation),
                "==" => (Binary::Equal, Level::Relation),
                "<>" => (Binary::NotEqual, Level::Relation),
                "+" => (Binary::Add, Level::Sum),
                "-" => (Binary::Subtract, Level::Sum),
                "*" => (Binary::Multiply, Level::Product),
                "/" => (Binary::Divide, Level::Product),
                ".*" | "./" | ".^" | ".+" | ".-" => {
                    let advice = format!("write `{}`", &sign[1..]);
                    return Err(self.unsupported(self.span, &format!("`{sign}` is"), &advice));
                }
                "!" | "&" => {
                    return Err(self.syntax(
                        self.span,
                        "conditions are joined with `and`, `or` and `not`; unequal is `<>`",
                    ));
                }
                _ => return Ok(None),
            },
            _ => return Ok(None),
        }))
    }

    /// `a` or `a ^ b`; neither operand of `^` may hold a sign or another power without parentheses.
    fn factor(&mut self) -> Result<Typed, SpecError> {
        let start = self.span.start;
        let base = self.primary()?;
        if !self.take_sign("^")? {
            return Ok(base);
        }
        let exponent = self.primary()?;
        if self.at_sign("^") {
            return Err(self.syntax(
                self.span,
                "a power of a power needs parentheses: write `(a^b)^c` or `a^(b^c)`",
            ));
        }
        let (a, b) = (self.as_number(base)?, self.as_number(exponent)?);
        let node = Node::Binary(Binary::Power, a, b);
        Ok(Typed::number(self.push(node, self.since(start))?))
    }

    fn primary(&mut self) -> Result<Typed, SpecError> {
        let span = self.span;
        match self.token {
            Token::Number(value) => {
                self.advance()?;
                Ok(Typed::number(self.push(Node::Number(value), span)?))
            }
            Token::Text => Err(self.syntax(span, "a text stands where a number is needed")),
            Token::Sign("(") => {
                self.advance()?;
                let inner = self.expression()?;
                if self.at_sign(",") {
                    return Err(self.unsupported(
                        self.span,
                        "lists in parentheses are",
                        "write one equation for each value",
                    ));
                }
                if !self.take_sign(")")? {
                    return Err(self.expected(&format!("`)` {}", self.opened(span))));
                }
                Ok(inner)
            }
            Token::Sign("{" | "[") => Err(self.no_arrays()),
            Token::Sign("*") if self.text[..span.start].ends_with('*') => {
                Err(self.syntax(span, "a power is written with `^`, as in `x^2`"))
            }
            Token::Sign(sign @ ("-" | "+")) => Err(self.syntax(
                span,
                format!("a sign behind an operator needs parentheses: write `({sign}a)`"),
            )),
            Token::Name => self.named(),
            _ => Err(self.expected("a number, a name or `(`")),
        }
    }

    fn opened(&self, bracket: Span) -> String {
        let line = line_of(self.text, bracket.start);
        format!("that closes the `(` of line {line}, or an operator")
    }

    /// What starts with a name or a word of the language.
    fn named(&mut self) -> Result<Typed, SpecError> {
        let (name, span) = (self.word(), self.span);
        match name {
            "true" | "false" => {
                self.advance()?;
                let value = f64::from(u8::from(name == "true"));
                return Ok(Typed::condition(self.push(Node::Number(value), span)?));
            }
            "time" => {
                self.advance()?;
                return Ok(Typed::number(self.push(Node::Time, span)?));
            }
            "der" => return self.derivative(),
            "if" => {
                return Err(self.syntax(span, "an if-expression behind an operator needs parentheses: write `(if a then b else c)`"));
            }
            "initial" | "function" => {
                return Err(self.unsupported(span, &format!("`{name}` is"), FLATTEN));
            }
            _ if names::is_reserved(name) => return Err(self.expected("a number, a name or `(`")),
            _ => self.advance()?,
        }
        if self.at_sign("[") {
            return Err(self.no_arrays());
        }
        if self.at_sign("(") {
            return self.call(name, span);
        }
        if !self.declared.contains(name) && names::function(name, &self.imports).is_some() {
            let message = format!(
                "`{name}` is a function: its argument stands in parentheses, as in `{name}(x)`"
            );
            return Err(self.syntax(span, message));
        }
        let variable = self
            .symbols
            .number(name.strip_prefix('.').unwrap_or(name), span);
        Ok(Typed::number(self.push(Node::Variable(variable), span)?))
    }

    fn derivative(&mut self) -> Result<Typed, SpecError> {
        let start = self.span.start;
        self.advance()?;
        self.require_sign("(", "behind `der`")?;
        let (name, span) = (self.word(), self.span);
        let one_name = self.token == Token::Name && !names::is_reserved(name);
        if one_name {
            self.advance()?;
        }
        if self.at_sign("[") {
            return Err(self.no_arrays());
        }
        if one_name && (self.at_sign(",") || self.at_sign("(")) {
            let name = shortened(name);
            let message = if self.at_sign(",") {
                format!(
                    "`der` is the derivative with respect to time and takes one name: write `der({name})`"
                )
            } else {
                format!("variables are written without `(t)`: write `der({name})`")
            };
            return Err(self.error(span, SpecErrorKind::Derivative(message)));
        }
        if !one_name || !self.at_sign(")") {
            return Err(self.error(span, SpecErrorKind::Derivative(
                "`der` takes the name of one variable: give the expression a name of its own, as in `v = der(x)`, and write \
                 `der` of that name"
                    .into(),
            )));
        }
        self.advance()?;
        let variable = self
            .symbols
            .number(name.strip_prefix('.').unwrap_or(name), span);
        let node = Node::Derivative(variable);
        Ok(Typed::number(self.push(node, self.since(start))?))
    }

    fn call(&mut self, name: &'a str, span: Span) -> Result<Typed, SpecError> {
        if name == "pre" && !self.declared.contains(name) {
            return self.previous(span);
        }
        let Some(callee) = names::function(name, &self.imports) else {
            return Err(self
                .called_variable(name, span)
                .unwrap_or_else(|| self.unknown_function(name, span)));
        };
        let opening = self.span;
        self.advance()?;
        let mut given: Vec<Typed> = vec![];
        // Where the nodes of the arguments end that are kept.
        let mut kept = self.expressions.len();
        while !self.at_sign(")") {
            if !given.is_empty() && !self.take_sign(",")? {
                return Err(self.expected(&format!("`,` or `)` {}", self.opened(opening))));
            }
            given.push(self.expression()?);
            if given.len() == 2 {
                kept = self.expressions.len();
            }
        }
        self.advance()?;
        let whole = self.since(span.start);
        let takes = match callee {
            Callee::One(_) | Callee::NoEvent => 1,
            Callee::Delay if given.len() == 3 => 3,
            Callee::Two(_) | Callee::Smooth | Callee::Delay => 2,
        };
        if given.len() != takes {
            let (function, given) = (excerpt(self.text, span), given.len());
            let kind = SpecErrorKind::Arguments {
                function,
                takes,
                given,
            };
            return Err(self.error(whole, kind));
        }
        let node = match (callee, given.as_slice()) {
            (Callee::NoEvent, &[value]) => return Ok(value),
            (Callee::Smooth, &[order, value]) => {
                if !matches!(self.expressions.node(order.id), Node::Number(p) if p >= 0.0 && p.fract() == 0.0)
                {
                    return Err(self.mistyped(
                        order.id,
                        "is the order of `smooth`, and must be a whole number",
                    ));
                }
                return Ok(value);
            }
            (Callee::One(f), &[a]) => Node::Call(f, self.as_number(a)?),
            (Callee::Two(f), &[a, b]) => Node::Binary(f, self.as_number(a)?, self.as_number(b)?),
            (Callee::Delay, &[value, time, ..]) => {
                if let Some(&longest) = given.get(2) {
                    self.as_number(longest)?;
                    self.expressions.truncate(kept);
                }
                let (value, time) = (self.as_number(value)?, self.as_number(time)?);
                Node::Delay { value, time }
            }
            _ => return Err(self.expected("arguments")),
        };
        Ok(Typed::number(self.push(node, whole)?))
    }

    /// What stands behind `pre`: the name of one variable.
    fn previous(&mut self, start: Span) -> Result<Typed, SpecError> {
        self.advance()?;
        let (name, span) = (self.word(), self.span);
        if self.token != Token::Name || names::is_reserved(name) {
            return Err(self.syntax(span, "`pre` takes the name of one variable"));
        }
        self.advance()?;
        self.require_sign(")", "behind the name: `pre` takes one variable")?;
        let variable = self.symbols.number(name, span);
        let node = Node::Previous(variable);
        Ok(Typed::number(self.push(node, self.since(start.start))?))
    }

    /// The error for the name of a variable before the `(` that stands here.
    fn called_variable(&self, name: &str, span: Span) -> Option<SpecError> {
        let behind = self.text.get(self.span.end..).unwrap_or("");
        let argument = behind.split([')', ';']).next().unwrap_or("").trim();
        let of_time = matches!(argument, "t" | "time");
        let declared = self.declared.contains(name);
        let name = shortened(name);
        let message = if of_time && (declared || names::nearest_function(&name).is_none()) {
            format!("variables are written without `({argument})`: write `{name}`")
        } else if declared {
            format!("`{name}` is a variable and no function: a product is written `{name}*(...)`")
        } else {
            return None;
        };
        Some(self.syntax(span, message))
    }

    fn unknown_function(&self, name: &str, span: Span) -> SpecError {
        let advice = match name {
            "edge" | "change" | "sample" | "reinit" | "terminal" | "assert" | "terminate" => {
                "there are no events: write a condition with `if`, or leave it out"
            }
            "floor" | "ceil" | "integer" | "mod" | "rem" | "div" => {
                "rounding is an event: write a condition with `if`"
            }
            "fill" | "zeros" | "ones" | "sum" | "product" | "vector" | "matrix" | "transpose"
            | "cross" | "size" | "linspace" | "cat" | "scalar" => ARRAYS,
            _ => {
                let (name, nearest) = (excerpt(self.text, span), names::nearest_function(name));
                let what = "a known function";
                return self.error(
                    span,
                    SpecErrorKind::UnknownWord {
                        name,
                        what,
                        nearest,
                    },
                );
            }
        };
        self.unsupported(span, &format!("`{name}` is"), advice)
    }
}

fn is_relation(operator: Binary) -> bool {
    use Binary::*;
    matches!(
        operator,
        Less | LessOrEqual | Greater | GreaterOrEqual | Equal | NotEqual
    )
}
