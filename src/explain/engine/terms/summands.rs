//! The terms of the sums in an equation.

use crate::physics::{Binary, ExpressionId, ModelSpec, Node, VariableId, VariableKind};

/// The sums that an expression consists of, each with its terms and their signs: those that products and quotients hold, too.
pub(in crate::explain::engine) fn sums_in(
    spec: &ModelSpec,
    root: ExpressionId,
) -> Vec<(ExpressionId, Vec<(f64, ExpressionId)>)> {
    let mut found = Vec::new();
    let mut waiting = vec![root];
    while let Some(id) = waiting.pop() {
        match spec.expressions.node(id) {
            Node::Binary(Binary::Divide, a, _) => waiting.push(a),
            Node::Binary(Binary::Multiply, a, b) if is_sum(spec, a) != is_sum(spec, b) => {
                // A term by itself, and a sum with a factor.
                found.push((id, vec![(1.0, id)]));
                waiting.push(if is_sum(spec, a) { a } else { b });
            }
            _ => {
                let mut parts = Vec::new();
                flatten(spec, id, 1.0, &mut parts);
                found.push((id, parts));
            }
        }
    }
    found
}

/// Whether a parameter only multiplies a function of these variables, in one equation: a curve of them in its place is one in that
/// equation, which says the same without it.
pub(in crate::explain::engine) fn multiplies_only(
    spec: &ModelSpec,
    parameter: VariableId,
    variables: &[VariableId],
) -> bool {
    let uses = |id: ExpressionId| spec.expressions.variables(id).contains(&parameter);
    let of = |v: &VariableId| {
        let kind = spec.variable(*v).kind;
        matches!(kind, VariableKind::Parameter | VariableKind::Constant) || variables.contains(v)
    };
    let mut users = spec
        .equations
        .iter()
        .filter(|e| uses(e.left) || uses(e.right));
    let (Some(only), None) = (users.next(), users.next()) else {
        return false;
    };
    let terms = sums_in(spec, only.right);
    let with = terms
        .iter()
        .flat_map(|(_, parts)| parts)
        .filter(|(_, id)| uses(*id));
    let mut with = with.peekable();
    !uses(only.left)
        && with.peek().is_some()
        && with.all(|(_, id)| spec.expressions.variables(*id).iter().all(of))
}

fn is_sum(spec: &ModelSpec, id: ExpressionId) -> bool {
    let node = spec.expressions.node(id);
    matches!(node, Node::Binary(Binary::Add | Binary::Subtract, _, _))
}

/// The terms of a sum with their signs.
pub(in crate::explain::engine) fn flatten(
    spec: &ModelSpec,
    id: ExpressionId,
    sign: f64,
    parts: &mut Vec<(f64, ExpressionId)>,
) {
    let mut waiting = vec![(id, sign)];
    while let Some((id, sign)) = waiting.pop() {
        match spec.expressions.node(id) {
            Node::Negate(a) => waiting.push((a, -sign)),
            Node::Binary(Binary::Add, a, b) => waiting.extend([(b, sign), (a, sign)]),
            Node::Binary(Binary::Subtract, a, b) => waiting.extend([(b, -sign), (a, sign)]),
            _ => parts.push((sign, id)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::parse;

    #[test]
    fn a_spring_multiplies_its_stretch_only() {
        let text = "model M parameter Real k = 1; parameter Real c = 1; parameter Real m = 2; input Real u; output Real y; Real s; Real v;
             equation der(s) = v; der(v) = (u*c - k*s)/m; y = s; end M;";
        let spec = parse(text).unwrap();
        let of = |name: &str| spec.find(name).unwrap();
        assert!(multiplies_only(&spec, of("k"), &[of("s")]));
        assert!(!multiplies_only(&spec, of("k"), &[of("v")]));
        assert!(!multiplies_only(&spec, of("c"), &[of("s")]));
        assert!(!multiplies_only(&spec, of("m"), &[of("s")]));
    }
}
