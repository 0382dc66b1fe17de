//! What each variable is: a state when its derivative is used, else what its declaration says.

use crate::physics::error::{SpecError, SpecErrorKind, excerpt, shortened};
use crate::physics::expression::{ExpressionId, Node};
use crate::physics::spec::VariableKind;
use crate::physics::syntax::draft::{Declaration, Draft, DraftExpression, Role};

/// The kind of each variable; parameters that are computed from others are settled later.
pub(super) fn kinds(draft: &Draft) -> Result<Vec<VariableKind>, Vec<SpecError>> {
    let mut errors = vec![];
    let mut kinds: Vec<VariableKind> = draft
        .declarations
        .iter()
        .map(|d| match d.role {
            Role::Constant => VariableKind::Constant,
            Role::Parameter => VariableKind::Parameter,
            Role::Input => VariableKind::Input,
            Role::Determined => VariableKind::Algebraic,
        })
        .collect();
    for index in 0..draft.expressions.len() {
        let id = ExpressionId(index as u32);
        let Node::Derivative(variable) = draft.expressions.node(id) else {
            continue;
        };
        let name = || shortened(&draft.declarations[variable.index()].name);
        let message = match kinds[variable.index()] {
            VariableKind::Input => format!(
                "`der({0})`: `{0}` is an input, whose derivative is not known; give the rate an input of its own, or filter \
                 `{0}` by a state",
                name()
            ),
            VariableKind::Constant | VariableKind::Parameter => {
                format!(
                    "`der({0})`: `{0}` does not change, its derivative is zero",
                    name()
                )
            }
            VariableKind::State | VariableKind::Algebraic => {
                kinds[variable.index()] = VariableKind::State;
                continue;
            }
        };
        let span = draft.expressions.span(id);
        let kind = SpecErrorKind::Derivative(message);
        errors.push(SpecError::new(draft.text, span, kind));
    }
    only_certain(draft, &kinds, &mut errors);
    if errors.is_empty() {
        Ok(kinds)
    } else {
        Err(errors)
    }
}

/// Values, starts, bounds and delays use numbers, constants and parameters only.
fn only_certain(draft: &Draft, kinds: &[VariableKind], errors: &mut Vec<SpecError>) {
    for declared in &draft.declarations {
        for (what, expression) in parts(declared) {
            if let Some((id, found)) = expression.range().find_map(|i| uncertain(draft, kinds, i)) {
                let message = format!(
                    "the {what} of `{}` may use numbers, constants and parameters only: {found}",
                    shortened(&declared.name)
                );
                let span = draft.expressions.span(id);
                errors.push(SpecError::new(
                    draft.text,
                    span,
                    SpecErrorKind::Value(message),
                ));
            }
        }
    }
    let mut marked = vec![false; draft.expressions.len()];
    for index in 0..draft.expressions.len() {
        let id = ExpressionId(index as u32);
        let node = draft.expressions.node(id);
        marked[index] =
            uncertain(draft, kinds, index).is_some() || node.operands().any(|o| marked[o.index()]);
        if let Node::Delay { time, .. } = node
            && marked[time.index()]
        {
            let span = draft.expressions.span(time);
            let message = format!(
                "the time of a delay may use numbers, constants and parameters only: `{}` changes",
                excerpt(draft.text, span)
            );
            errors.push(SpecError::new(
                draft.text,
                span,
                SpecErrorKind::Value(message),
            ));
        }
    }
}

/// What a declaration states by an expression.
pub(super) fn parts(
    declared: &Declaration,
) -> impl Iterator<Item = (&'static str, DraftExpression)> {
    [
        ("value", declared.value),
        ("start", declared.start),
        ("min", declared.min),
        ("max", declared.max),
        ("nominal", declared.nominal),
    ]
    .into_iter()
    .filter_map(|(what, expression)| Some((what, expression?)))
}

/// A node that changes in time, and what it is.
fn uncertain(
    draft: &Draft,
    kinds: &[VariableKind],
    index: usize,
) -> Option<(ExpressionId, String)> {
    let id = ExpressionId(index as u32);
    let found = match draft.expressions.node(id) {
        Node::Variable(v) => {
            let what = match kinds[v.index()] {
                VariableKind::Constant | VariableKind::Parameter => return None,
                VariableKind::Input => "an input",
                VariableKind::State => "a state",
                VariableKind::Algebraic => "determined by an equation",
            };
            format!(
                "`{}` is {what}",
                shortened(&draft.declarations[v.index()].name)
            )
        }
        Node::Time => "`time` changes".to_string(),
        Node::Derivative(_) => "a derivative changes".to_string(),
        Node::Delay { .. } => "a delay needs something that changes".to_string(),
        Node::Previous(_) => "`pre` is of something that changes".to_string(),
        _ => return None,
    };
    Some((id, found))
}
