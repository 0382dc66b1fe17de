//! What an expression is made of, and in which parameters it is a sum of multiples.

use crate::physics::{Binary, ExpressionId, ModelSpec, Node, VariableId};

/// The expression that a variable is.
pub(super) fn root(spec: &ModelSpec, name: &str) -> Option<ExpressionId> {
    let v = spec.find(name)?;
    let equation = spec.equations.iter().find(|e| e.unknown.variable() == v)?;
    Some(equation.right)
}

/// Names of the variables of an expression in the order of the text, and `time`.
pub(super) fn variables(spec: &ModelSpec, root: ExpressionId) -> Vec<String> {
    let mut used: Vec<(usize, String)> = Vec::new();
    let mut stack = vec![root];
    while let Some(id) = stack.pop() {
        let node = spec.expressions.node(id);
        let name = match node {
            Node::Variable(v) | Node::Derivative(v) | Node::Previous(v) => {
                Some(spec.variable(v).name.clone())
            }
            Node::Time => Some("time".to_owned()),
            _ => None,
        };
        used.extend(name.map(|n| (spec.expressions.span(id).start, n)));
        stack.extend(node.operands());
    }
    used.sort();
    let mut names: Vec<String> = Vec::new();
    for (_, name) in used {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names
}

/// Whether an expression is a constant and multiples of these parameters, not of their products.
pub(super) fn is_affine(spec: &ModelSpec, root: ExpressionId, of: &[VariableId]) -> bool {
    const MORE: u8 = 2;
    // Operands stand before the operators that use them: no recursion, whatever the depth.
    let mut degree = vec![0u8; root.index() + 1];
    for index in 0..=root.index() {
        let at = |id: ExpressionId| degree.get(id.index()).copied().unwrap_or(MORE);
        let node = spec.expressions.node(ExpressionId(index as u32));
        degree[index] = match node {
            Node::Variable(v) => u8::from(of.contains(&v)),
            Node::Negate(a) => at(a),
            Node::Binary(Binary::Add | Binary::Subtract, a, b) => at(a).max(at(b)),
            Node::Binary(Binary::Multiply, a, b) => (at(a) + at(b)).min(MORE),
            Node::Binary(Binary::Divide, a, b) if at(b) == 0 => at(a),
            Node::If { condition, yes, no } if at(condition) == 0 => at(yes).max(at(no)),
            Node::Delay { value, time } if at(time) == 0 => at(value),
            other if other.operands().all(|o| at(o) == 0) => 0,
            _ => MORE,
        };
    }
    degree[root.index()] < MORE
}
