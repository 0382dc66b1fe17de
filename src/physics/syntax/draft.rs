//! What a text says, before it is settled which equation determines what.

use crate::physics::expression::{ExpressionId, Expressions, Span};
use crate::physics::units::Unit;

/// What the words before a declaration say about it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Role {
    /// `constant` or `final parameter`.
    Constant,
    /// `parameter`
    Parameter,
    /// `input`
    Input,
    /// Neither: an equation determines it.
    Determined,
}

/// An expression: all nodes from `first` to `root`, and none of another expression.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DraftExpression {
    pub(crate) first: usize,
    pub(crate) root: ExpressionId,
}

impl DraftExpression {
    /// Positions of its nodes in the arena, operands first.
    pub(crate) fn range(self) -> std::ops::RangeInclusive<usize> {
        self.first..=self.root.index()
    }
}

/// A declaration.
#[derive(Debug)]
pub(crate) struct Declaration {
    pub(crate) name: String,
    pub(crate) description: String,
    pub(crate) role: Role,
    pub(crate) output: bool,
    pub(crate) unit: Option<Unit>,
    pub(crate) unit_text: Option<String>,
    pub(crate) min: Option<DraftExpression>,
    pub(crate) max: Option<DraftExpression>,
    pub(crate) nominal: Option<DraftExpression>,
    pub(crate) start: Option<DraftExpression>,
    pub(crate) fixed: bool,
    /// Value of a constant or parameter; the binding of another variable is an equation.
    pub(crate) value: Option<DraftExpression>,
    /// Its name.
    pub(crate) span: Span,
}

/// `left = right`: the nodes of the right side follow those of the left one.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DraftEquation {
    pub(crate) left: DraftExpression,
    pub(crate) right: DraftExpression,
    pub(crate) span: Span,
}

impl DraftEquation {
    /// Positions of its nodes in the arena, operands first.
    pub(crate) fn range(self) -> std::ops::RangeInclusive<usize> {
        self.left.first..=self.right.root.index()
    }
}

/// A text that is well formed and whose names are known.
#[derive(Debug)]
pub(crate) struct Draft<'a> {
    pub(crate) text: &'a str,
    pub(crate) name: String,
    pub(crate) description: String,
    pub(crate) declarations: Vec<Declaration>,
    pub(crate) equations: Vec<DraftEquation>,
    pub(crate) expressions: Expressions,
}
