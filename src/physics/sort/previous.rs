//! What `pre` may be of: a variable that follows from inputs, parameters and its own past, so that it changes at samples only.

use crate::physics::error::{SpecError, SpecErrorKind, shortened};
use crate::physics::expression::{ExpressionId, Expressions, Node, VariableId};
use crate::physics::spec::{Equation, VariableKind};

/// The first `pre` that is of something else.
pub(super) fn check(
    text: &str,
    names: &[&str],
    kinds: &[VariableKind],
    expressions: &Expressions,
    equations: &[Equation],
) -> Result<(), SpecError> {
    if !expressions.any(|node| matches!(node, Node::Previous(_))) {
        return Ok(());
    }
    // Why a variable changes between samples.
    let mut moves: Vec<Option<String>> = vec![None; kinds.len()];
    let quoted = |v: VariableId| format!("`{}`", shortened(names[v.index()]));
    for equation in equations {
        let v = equation.unknown.variable();
        let parts = [Some(equation.rest), equation.coefficient];
        let mut stack: Vec<ExpressionId> = parts.into_iter().flatten().collect();
        while let Some(id) = stack.pop() {
            let node = expressions.node(id);
            let why = match node {
                Node::Variable(x) if kinds[x.index()] == VariableKind::State => {
                    Some(format!("the state {}", quoted(x)))
                }
                Node::Variable(x) => moves[x.index()].clone(),
                Node::Time => Some("`time`".to_owned()),
                Node::Derivative(x) => Some(format!("`der({})`", shortened(names[x.index()]))),
                Node::Delay { .. } => Some("a delay".to_owned()),
                _ => None,
            };
            if why.is_some() {
                moves[v.index()] = why;
                break;
            }
            stack.extend(node.operands());
        }
    }
    for index in 0..expressions.len() {
        let id = ExpressionId(index as u32);
        let Node::Previous(v) = expressions.node(id) else {
            continue;
        };
        let why = match kinds[v.index()] {
            VariableKind::Algebraic => {
                let why = moves[v.index()].clone();
                why.map(|why| format!("{} follows from {why}", quoted(v)))
            }
            VariableKind::State => Some(format!("{} is a state", quoted(v))),
            _ => Some(format!(
                "write `q = {0}` and `pre(q)`",
                shortened(names[v.index()])
            )),
        };
        if let Some(why) = why {
            let message = format!(
                "`pre({})` is the value at the sample before, and needs a variable whose equation has inputs, parameters and \
                 `pre` only; {why}",
                shortened(names[v.index()]),
            );
            let span = expressions.span(id);
            return Err(SpecError::new(text, span, SpecErrorKind::Value(message)));
        }
    }
    Ok(())
}
