//! Solves an equation for its unknown: both sides become `factor*unknown + rest`.

use super::{System, oriented, unknown_of};
use crate::physics::error::{SpecError, SpecErrorKind, excerpt};
use crate::physics::expression::{Binary, ExpressionId, Expressions, Node, Span, VariableId};
use crate::physics::spec::Equation;

/// What the unknown is multiplied by.
#[derive(Debug, Clone, Copy)]
enum Factor {
    One,
    MinusOne,
    Is(ExpressionId),
}

/// An expression, seen as a function of the unknown.
#[derive(Debug, Clone, Copy)]
enum Form {
    /// Free of the unknown.
    Free,
    /// `factor*unknown + rest`; no rest is zero.
    Linear {
        factor: Factor,
        rest: Option<ExpressionId>,
    },
}

/// Solves equation number `number` for the one unknown that is left in it.
pub(super) fn solve(
    system: &System,
    expressions: &mut Expressions,
    number: usize,
    variable: VariableId,
) -> Result<Equation, SpecError> {
    let equation = &system.equations[number];
    let first = equation.left.first;
    let mut solver = Solver {
        system,
        expressions,
        first,
        forms: vec![],
        variable,
        number,
    };
    for index in equation.range() {
        let form = solver.form(ExpressionId(index as u32))?;
        solver.forms.push(form);
    }
    let (left, right) = (equation.left.root, equation.right.root);
    let turned = matches!(solver.of(left), Form::Free);
    let (here, there) = if turned { (right, left) } else { (left, right) };
    let (factor, rest) = solver.isolate(here, there, equation.span)?;
    let unknown = system.unknown(variable);
    Ok(oriented(equation, turned, unknown, factor, rest))
}

struct Solver<'a> {
    system: &'a System<'a>,
    expressions: &'a mut Expressions,
    /// Position of the first node of the equation.
    first: usize,
    /// Forms of its nodes, in their order.
    forms: Vec<Form>,
    variable: VariableId,
    number: usize,
}

impl Solver<'_> {
    fn of(&self, id: ExpressionId) -> Form {
        self.forms[id.index() - self.first]
    }

    fn error(&self, at: Span, reason: &str) -> SpecError {
        let kind = SpecErrorKind::NonLinear {
            unknown: self.system.unknown_name(self.variable.index()),
            equation: excerpt(self.system.text, self.system.equations[self.number].span),
            reason: reason.to_string(),
        };
        SpecError::new(self.system.text, at, kind)
    }

    fn nonlinear(&self, id: ExpressionId, place: &str) -> SpecError {
        let span = self.expressions.span(id);
        self.error(
            span,
            &format!("{place} `{}`", excerpt(self.system.text, span)),
        )
    }

    fn form(&mut self, id: ExpressionId) -> Result<Form, SpecError> {
        let node = self.expressions.node(id);
        if unknown_of(node, self.system.kinds) == Some(self.variable) {
            let factor = Factor::One;
            return Ok(Form::Linear { factor, rest: None });
        }
        if node.operands().all(|o| matches!(self.of(o), Form::Free)) {
            return Ok(Form::Free);
        }
        let span = self.expressions.span(id);
        match node {
            Node::Negate(a) => Ok(self.negated(self.of(a), span)),
            Node::Binary(Binary::Add, a, b) => self.sum(a, b, false, span),
            Node::Binary(Binary::Subtract, a, b) => self.sum(a, b, true, span),
            Node::Binary(Binary::Multiply, a, b) => match (self.of(a), self.of(b)) {
                (Form::Linear { factor, rest }, Form::Free) => {
                    Ok(self.scaled(factor, rest, b, Binary::Multiply, span))
                }
                (Form::Free, Form::Linear { factor, rest }) => {
                    Ok(self.scaled(factor, rest, a, Binary::Multiply, span))
                }
                _ => Err(self.nonlinear(id, "it is multiplied by itself in")),
            },
            Node::Binary(Binary::Divide, a, b) => match (self.of(a), self.of(b)) {
                (Form::Linear { factor, rest }, Form::Free) => {
                    Ok(self.scaled(factor, rest, b, Binary::Divide, span))
                }
                _ => Err(self.nonlinear(id, "it stands in the denominator of")),
            },
            Node::If { condition, yes, no } => self.choice(id, condition, yes, no),
            Node::Delay { .. } => Err(self.nonlinear(id, "its present value is needed by")),
            _ => Err(self.nonlinear(id, "it stands inside")),
        }
    }

    fn push(&mut self, node: Node, span: Span) -> ExpressionId {
        self.expressions.push(node, span)
    }

    fn binary(
        &mut self,
        operator: Binary,
        a: ExpressionId,
        b: ExpressionId,
        span: Span,
    ) -> ExpressionId {
        self.push(Node::Binary(operator, a, b), span)
    }

    fn negative(&mut self, id: ExpressionId, span: Span) -> ExpressionId {
        match self.expressions.node(id) {
            Node::Number(value) => self.push(Node::Number(-value), span),
            Node::Negate(inner) => inner,
            _ => self.push(Node::Negate(id), span),
        }
    }

    fn negated(&mut self, form: Form, span: Span) -> Form {
        let Form::Linear { factor, rest } = form else {
            return form;
        };
        let factor = match factor {
            Factor::One => Factor::MinusOne,
            Factor::MinusOne => Factor::One,
            Factor::Is(id) => Factor::Is(self.negative(id, span)),
        };
        let rest = rest.map(|r| self.negative(r, span));
        Form::Linear { factor, rest }
    }

    fn sum(
        &mut self,
        a: ExpressionId,
        b: ExpressionId,
        minus: bool,
        span: Span,
    ) -> Result<Form, SpecError> {
        let operator = if minus { Binary::Subtract } else { Binary::Add };
        let (left, right) = (self.of(a), self.of(b));
        Ok(match (left, right) {
            (Form::Linear { factor, rest }, Form::Free) => {
                let rest = match (rest, minus) {
                    (Some(rest), _) => self.binary(operator, rest, b, span),
                    (None, false) => b,
                    (None, true) => self.negative(b, span),
                };
                let rest = Some(rest);
                Form::Linear { factor, rest }
            }
            (Form::Free, Form::Linear { .. }) => {
                let right = if minus {
                    self.negated_factor(right, span)
                } else {
                    right
                };
                let Form::Linear { factor, rest } = right else {
                    return Ok(right);
                };
                let rest = match rest {
                    Some(rest) => self.binary(operator, a, rest, span),
                    None => a,
                };
                let rest = Some(rest);
                Form::Linear { factor, rest }
            }
            (Form::Linear { factor: f, rest: r }, Form::Linear { factor: g, rest: s }) => {
                let factor = self.factor_sum(f, g, operator, span);
                let rest = self.rest_sum(r, s, operator, span);
                Form::Linear { factor, rest }
            }
            (Form::Free, Form::Free) => Form::Free,
        })
    }

    /// Negates the factor and leaves the rest.
    fn negated_factor(&mut self, form: Form, span: Span) -> Form {
        let Form::Linear { factor, rest } = form else {
            return form;
        };
        match self.negated(Form::Linear { factor, rest: None }, span) {
            Form::Linear { factor, .. } => Form::Linear { factor, rest },
            Form::Free => Form::Free,
        }
    }

    fn factor_sum(&mut self, f: Factor, g: Factor, operator: Binary, span: Span) -> Factor {
        let a = self.factor_node(f, span);
        let b = self.factor_node(g, span);
        if let (Node::Number(x), Node::Number(y)) =
            (self.expressions.node(a), self.expressions.node(b))
        {
            let value = if operator == Binary::Add {
                x + y
            } else {
                x - y
            };
            return Factor::Is(self.push(Node::Number(value), span));
        }
        Factor::Is(self.binary(operator, a, b, span))
    }

    fn rest_sum(
        &mut self,
        r: Option<ExpressionId>,
        s: Option<ExpressionId>,
        operator: Binary,
        span: Span,
    ) -> Option<ExpressionId> {
        match (r, s) {
            (Some(r), Some(s)) => Some(self.binary(operator, r, s, span)),
            (None, Some(s)) if operator == Binary::Subtract => Some(self.negative(s, span)),
            (r, s) => r.or(s),
        }
    }

    fn factor_node(&mut self, factor: Factor, span: Span) -> ExpressionId {
        match factor {
            Factor::One => self.push(Node::Number(1.0), span),
            Factor::MinusOne => self.push(Node::Number(-1.0), span),
            Factor::Is(id) => id,
        }
    }

    /// Product with, or quotient by, an expression that is free of the unknown.
    fn scaled(
        &mut self,
        factor: Factor,
        rest: Option<ExpressionId>,
        by: ExpressionId,
        operator: Binary,
        span: Span,
    ) -> Form {
        let factor = match (factor, operator) {
            (Factor::One, Binary::Multiply) => Factor::Is(by),
            (Factor::MinusOne, Binary::Multiply) => Factor::Is(self.negative(by, span)),
            _ => {
                let node = self.factor_node(factor, span);
                Factor::Is(self.binary(operator, node, by, span))
            }
        };
        let rest = rest.map(|r| self.binary(operator, r, by, span));
        Form::Linear { factor, rest }
    }

    fn choice(
        &mut self,
        id: ExpressionId,
        condition: ExpressionId,
        yes: ExpressionId,
        no: ExpressionId,
    ) -> Result<Form, SpecError> {
        let span = self.expressions.span(id);
        if !matches!(self.of(condition), Form::Free) {
            return Err(self.nonlinear(condition, "it decides the condition"));
        }
        let mut part = |branch: ExpressionId| match self.of(branch) {
            Form::Free => (self.push(Node::Number(0.0), span), Some(branch)),
            Form::Linear { factor, rest } => (self.factor_node(factor, span), rest),
        };
        let (a, r) = part(yes);
        let (b, s) = part(no);
        let node = Node::If {
            condition,
            yes: a,
            no: b,
        };
        let factor = Factor::Is(self.push(node, span));
        let rest = if r.is_none() && s.is_none() {
            None
        } else {
            let mut or_zero = |e: Option<ExpressionId>| match e {
                Some(e) => e,
                None => self.push(Node::Number(0.0), span),
            };
            let (yes, no) = (or_zero(r), or_zero(s));
            Some(self.push(Node::If { condition, yes, no }, span))
        };
        Ok(Form::Linear { factor, rest })
    }

    /// From `here = there`, where `here` holds the unknown: the coefficient and what the product is equal to.
    fn isolate(
        &mut self,
        here: ExpressionId,
        there: ExpressionId,
        span: Span,
    ) -> Result<(Option<ExpressionId>, ExpressionId), SpecError> {
        let (Form::Linear { factor, rest }, other) = (self.of(here), self.of(there)) else {
            return Err(self.error(span, "it cancels out"));
        };
        let (factor, right) = match other {
            Form::Free => (factor, Some(there)),
            Form::Linear { factor: g, rest: s } => {
                (self.factor_sum(factor, g, Binary::Subtract, span), s)
            }
        };
        let zero =
            |e: &Expressions, id: ExpressionId| matches!(e.node(id), Node::Number(v) if v == 0.0);
        let total = match (right.filter(|&r| !zero(self.expressions, r)), rest) {
            (Some(right), Some(rest)) => self.binary(Binary::Subtract, right, rest, span),
            (Some(right), None) => right,
            (None, Some(rest)) => self.negative(rest, span),
            (None, None) => self.push(Node::Number(0.0), span),
        };
        let number = match factor {
            Factor::One => Some(1.0),
            Factor::MinusOne => Some(-1.0),
            Factor::Is(id) => match self.expressions.node(id) {
                Node::Number(value) => Some(value),
                _ => None,
            },
        };
        match (number, factor) {
            (Some(1.0), _) => Ok((None, total)),
            (Some(-1.0), _) => Ok((None, self.negative(total, span))),
            (Some(0.0), _) => Err(self.error(span, "it cancels out")),
            (_, Factor::Is(id)) => Ok((Some(id), total)),
            _ => Ok((None, total)),
        }
    }
}
