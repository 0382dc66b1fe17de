//! A plant as equations: its variables, and what determines each.

use super::expression::{ExpressionId, Expressions, Span, VariableId};
use super::units::Unit;

/// What determines a variable.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VariableKind {
    /// A number that is certain: `constant`, `final parameter`, or a parameter computed from others.
    Constant,
    /// A number that may differ from its value, within its bounds.
    Parameter,
    /// Given from outside, sample by sample.
    Input,
    /// Its derivative is determined by an equation.
    State,
    /// Determined by an equation.
    Algebraic,
}

/// A declared variable.
#[derive(Debug, Clone, PartialEq)]
pub struct Variable {
    /// As declared.
    pub name: String,
    /// The string behind the declaration.
    pub description: String,
    /// What determines it.
    pub kind: VariableKind,
    /// True for `output`: it is recorded, or could be.
    pub output: bool,
    /// Unit, where one is stated.
    pub unit: Option<Unit>,
    /// Unit as written.
    pub unit_text: Option<String>,
    /// Lower bound; `-inf` where none is stated.
    pub min: f64,
    /// Upper bound; `inf` where none is stated.
    pub max: f64,
    /// Magnitude that is usual, where stated.
    pub nominal: Option<f64>,
    /// Value at the start: numbers and parameters only.
    pub(crate) start: Option<ExpressionId>,
    /// True when the start is certain (`fixed = true`).
    pub fixed: bool,
    /// Value of a constant or parameter: numbers and other parameters only.
    pub(crate) value: Option<ExpressionId>,
    /// What that value is, where parameters have the values of the text.
    pub number: Option<f64>,
    /// Where it is declared: the name.
    pub span: Span,
    /// A state that an observer does not correct, such as the memory of an effect: corrected, it would stand for any
    /// disturbance.
    pub(crate) uncorrected: bool,
    /// Where such a memory starts in each recording, where that is known.
    pub(crate) starts: Vec<f64>,
}

impl Variable {
    /// The name as a column of a recording has it: without the quotes of a quoted name.
    pub fn column(&self) -> &str {
        let inner = self
            .name
            .strip_prefix('\'')
            .and_then(|n| n.strip_suffix('\''));
        inner.filter(|n| !n.contains('\'')).unwrap_or(&self.name)
    }
}

/// What an equation determines.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Unknown {
    /// The derivative of a state.
    Derivative(VariableId),
    /// The value of an algebraic variable.
    Value(VariableId),
}

impl Unknown {
    /// The variable.
    pub fn variable(self) -> VariableId {
        let (Self::Derivative(v) | Self::Value(v)) = self;
        v
    }
}

/// `coefficient * unknown = rest`, as `left = right` was written. The unknown stands on the left: an equation written the
/// other way round is turned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Equation {
    /// The side that holds the unknown.
    pub(crate) left: ExpressionId,
    /// The other side.
    pub(crate) right: ExpressionId,
    /// What it determines.
    pub unknown: Unknown,
    /// Factor of the unknown; none where it is 1.
    pub(crate) coefficient: Option<ExpressionId>,
    /// What the product is equal to.
    pub(crate) rest: ExpressionId,
    /// Where it stands in the text.
    pub span: Span,
}

/// A plant as equations, in an order in which each needs only what stands before it.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelSpec {
    /// Name of the model.
    pub name: String,
    /// The string behind the name.
    pub description: String,
    /// The text it was read from.
    pub text: String,
    /// Variables in the order of declaration.
    pub variables: Vec<Variable>,
    /// All expressions.
    pub(crate) expressions: Expressions,
    /// Equations, sorted: every value and derivative that one uses is determined by one before it.
    pub equations: Vec<Equation>,
    /// Constants and parameters in an order in which each needs only those before it.
    pub constants: Vec<VariableId>,
}

impl ModelSpec {
    /// The variable.
    pub fn variable(&self, id: VariableId) -> &Variable {
        &self.variables[id.index()]
    }

    /// Variables of a kind, in the order of declaration.
    pub fn of_kind(&self, kind: VariableKind) -> impl Iterator<Item = VariableId> {
        self.ids().filter(move |&v| self.variable(v).kind == kind)
    }

    /// States, in the order of declaration.
    pub fn states(&self) -> Vec<VariableId> {
        self.of_kind(VariableKind::State).collect()
    }

    /// Inputs, in the order of declaration.
    pub fn inputs(&self) -> Vec<VariableId> {
        self.of_kind(VariableKind::Input).collect()
    }

    /// Parameters that may be estimated, in the order of declaration.
    pub fn parameters(&self) -> Vec<VariableId> {
        self.of_kind(VariableKind::Parameter).collect()
    }

    /// Outputs, in the order of declaration.
    pub fn outputs(&self) -> Vec<VariableId> {
        self.ids().filter(|&v| self.variable(v).output).collect()
    }

    /// The variable of this name.
    pub fn find(&self, name: &str) -> Option<VariableId> {
        self.ids().find(|&v| self.variable(v).name == name)
    }

    /// Names of variables.
    pub(crate) fn names(&self, variables: &[VariableId]) -> Vec<String> {
        let names = variables.iter().map(|&v| self.variable(v).name.clone());
        names.collect()
    }

    fn ids(&self) -> impl Iterator<Item = VariableId> + use<> {
        (0..self.variables.len() as u32).map(VariableId)
    }
}
