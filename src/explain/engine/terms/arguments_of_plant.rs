//! What a missing term may be a function of: the variables of a plant, and expressions of them that its text or its physics suggests.

use super::argument::{Argument, ArgumentForm, rate};
use super::names::{is_velocity, may_be_velocity};
use crate::explain::engine::fitting::edit::Place;
use crate::physics::{
    Binary, Equation, ExpressionId, ModelSpec, Node, Unknown, VariableId, VariableKind,
};

/// Temperature of a room, 20 degC, as in [`ArgumentForm::Radiation`].
const ROOM: &str = "2.9315^4";
/// Variables of the plant that something may depend on, differences of two of one unit, weighted sums that stand in the text, and products
/// of states and inputs.
pub(crate) fn arguments(spec: &ModelSpec) -> Vec<Argument> {
    let name = |v: VariableId| spec.variable(v).name.clone();
    let simple: Vec<VariableId> = [
        VariableKind::State,
        VariableKind::Input,
        VariableKind::Algebraic,
    ]
    .into_iter()
    .flat_map(|kind| spec.of_kind(kind).collect::<Vec<_>>())
    .collect();
    // What only copies a variable, or is a scale of it, is that variable: a function of one is a function of the other.
    let copies = |v: VariableId| {
        spec.equations.iter().any(|e| {
            e.unknown.variable() == v
                && spec.variable(v).kind == VariableKind::Algebraic
                && e.coefficient.is_none()
                && summed(spec, e.rest).is_some_and(|of| of.len() == 1)
        })
    };
    let simple: Vec<VariableId> = simple.into_iter().filter(|&v| !copies(v)).collect();
    let mut found: Vec<Argument> = simple
        .iter()
        .map(|&v| Argument::new(spec, name(v), vec![v]))
        .collect();
    let source = |v: VariableId| spec.variable(v).kind != VariableKind::Algebraic;
    for (i, &a) in simple.iter().enumerate() {
        for &b in &simple[i + 1..] {
            let unit = |v: VariableId| spec.variable(v).unit_text.clone();
            // What the plant calls by a name keeps that name.
            if let Some(known) = difference_of(spec, a, b)
                && let Some(argument) = found.iter_mut().find(|f| f.variables == [known])
            {
                argument.is_difference = true;
            } else if unit(a).is_some() && unit(a) == unit(b) && source(a) && source(b) {
                let text = format!("({} - {})", name(a), name(b));
                let mut difference = Argument::new(spec, text, vec![a, b]);
                difference.form = ArgumentForm::Difference;
                found.push(difference);
            }
            if source(a) && source(b) {
                let text = format!("{}*{}", name(a), name(b));
                let mut product = Argument::new(spec, text, vec![a, b]);
                (product.form, product.rate) = (ArgumentForm::Product, None);
                found.push(product);
            }
        }
    }
    found.extend(driven(spec, &simple));
    found.extend(from_references(spec, &simple));
    found.extend(sums(spec, &simple, &found));
    // Absolute temperatures, and how many of their units are 1 K.
    let absolute = |v: VariableId| match spec.variable(v).unit_text.as_deref() {
        Some("K") => Some((name(v), 1.0)),
        Some("degC") => Some((format!("({} + 273.15)", name(v)), 1.0)),
        Some("degF") => Some((format!("({} + 459.67)", name(v)), 1.8)),
        _ => None,
    };
    let warm: Vec<(VariableId, String, f64)> = simple
        .iter()
        .filter(|&&v| source(v))
        .filter_map(|&v| absolute(v).map(|(text, of_one)| (v, text, of_one)))
        .collect();
    let mut of_warm: Vec<(String, Vec<VariableId>, ArgumentForm)> = Vec::new();
    // Bodies radiate to each other, and each to a room.
    let fourth = |text: &str, of_one: f64| format!("({text}/{})^4", 100.0 * of_one);
    for (i, (a, text, of_one)) in warm.iter().enumerate() {
        let of_a = fourth(text, *of_one);
        for (b, text, of_one) in &warm[i + 1..] {
            let difference = format!("({of_a} - {})", fourth(text, *of_one));
            of_warm.push((difference, vec![*a, *b], ArgumentForm::Radiation));
        }
        let to_room = format!("({of_a} - {ROOM})");
        of_warm.push((to_room, vec![*a], ArgumentForm::Radiation));
        let reciprocal = format!("{of_one}/{text}");
        of_warm.push((reciprocal, vec![*a], ArgumentForm::Reciprocal));
    }
    found.extend(of_warm.into_iter().map(|(text, variables, form)| {
        let mut argument = Argument::new(spec, text, variables);
        (argument.form, argument.rate) = (form, None);
        argument
    }));
    found
}

/// The algebraic variable that is the difference of two others, in either order.
fn difference_of(spec: &ModelSpec, a: VariableId, b: VariableId) -> Option<VariableId> {
    let is = |e: &&Equation| match spec.expressions.node(e.rest) {
        Node::Binary(Binary::Subtract, x, y) => {
            let pair = (spec.expressions.node(x), spec.expressions.node(y));
            let (a, b) = (Node::Variable(a), Node::Variable(b));
            e.coefficient.is_none() && (pair == (a, b) || pair == (b, a))
        }
        _ => false,
    };
    let equation = spec.equations.iter().find(is)?;
    let variable = equation.unknown.variable();
    (spec.variable(variable).kind == VariableKind::Algebraic).then_some(variable)
}

/// Sizes of inputs and states that drive a velocity, with its sign.
fn driven(spec: &ModelSpec, variables: &[VariableId]) -> Vec<Argument> {
    let velocity = |v: VariableId| {
        let state = spec.variable(v).kind == VariableKind::State;
        state && (is_velocity(spec, &[v]) || may_be_velocity(spec, &[v]))
    };
    let equation = |v: VariableId| {
        let of = |e: &Equation| e.unknown == Unknown::Derivative(v);
        spec.equations.iter().position(of)
    };
    let mut found = Vec::new();
    for &v in variables.iter().filter(|&&v| velocity(v)) {
        let Some(at) = equation(v) else { continue };
        let drives = |&&u: &&VariableId| {
            let source = spec.variable(u).kind != VariableKind::Algebraic;
            u != v && source && Place::Equation(at).uses(spec, u)
        };
        found.extend(variables.iter().filter(drives).map(|&u| {
            let name = |v: VariableId| &spec.variable(v).name;
            let text = format!("abs({})*sign({})", name(u), name(v));
            let mut argument = Argument::new(spec, text, vec![u, v]);
            (argument.form, argument.rate) = (ArgumentForm::Driven, None);
            argument
        }));
    }
    found
}

/// Differences of variables and numbers or parameters that stand in the text, such as of a temperature and that of a room.
fn from_references(spec: &ModelSpec, variables: &[VariableId]) -> Vec<Argument> {
    let is_number = |id: ExpressionId| match spec.expressions.node(id) {
        Node::Number(_) => true,
        Node::Variable(v) => matches!(
            spec.variable(v).kind,
            VariableKind::Parameter | VariableKind::Constant
        ),
        _ => false,
    };
    let mut found: Vec<Argument> = Vec::new();
    for node in spec.expressions.nodes() {
        let &Node::Binary(Binary::Subtract, a, b) = node else {
            continue;
        };
        let (variable, number) = match (spec.expressions.node(a), spec.expressions.node(b)) {
            (Node::Variable(v), _) if is_number(b) => (v, b),
            (_, Node::Variable(v)) if is_number(a) => (v, a),
            _ => continue,
        };
        let name = &spec.variable(variable).name;
        let text = format!("({name} - {})", text_of(spec, number));
        let known = found.iter().any(|f| f.expression == text);
        if variables.contains(&variable) && !known {
            let mut argument = Argument::new(spec, text, vec![variable]);
            argument.form = ArgumentForm::FromReference;
            found.push(argument);
        }
    }
    found
}

/// Variables of an expression that is their weighted sum, with weights and a constant made of parameters and numbers.
fn summed(spec: &ModelSpec, id: ExpressionId) -> Option<Vec<VariableId>> {
    let of = |id| summed(spec, id);
    match spec.expressions.node(id) {
        Node::Number(_) => Some(vec![]),
        Node::Variable(v) => match spec.variable(v).kind {
            VariableKind::Parameter | VariableKind::Constant => Some(vec![]),
            _ => Some(vec![v]),
        },
        Node::Negate(a) => of(a),
        Node::Binary(Binary::Add | Binary::Subtract, a, b) => {
            let mut all = [of(a)?, of(b)?].concat();
            all.sort();
            all.dedup();
            Some(all)
        }
        Node::Binary(Binary::Multiply, a, b) => match [of(a)?, of(b)?] {
            [one, fixed] | [fixed, one] if fixed.is_empty() => Some(one),
            _ => None,
        },
        Node::Binary(Binary::Divide, a, b) => of(b)?.is_empty().then(|| of(a))?,
        _ => None,
    }
}

/// Whether an expression is made of parameters and numbers alone.
fn is_fixed(spec: &ModelSpec, id: ExpressionId) -> bool {
    summed(spec, id).is_some_and(|variables| variables.is_empty())
}

fn text_of(spec: &ModelSpec, id: ExpressionId) -> &str {
    let span = spec.expressions.span(id);
    spec.text.get(span.start..span.end).unwrap_or_default()
}

/// The derivative of a weighted sum, where the plant has variables for those of its terms.
fn rate_of_sum(spec: &ModelSpec, id: ExpressionId) -> Option<String> {
    let of = |id| rate_of_sum(spec, id);
    match spec.expressions.node(id) {
        _ if is_fixed(spec, id) => Some("0.0".to_owned()),
        Node::Variable(v) => rate(spec, &[v]),
        Node::Negate(a) => Some(format!("(-{})", of(a)?)),
        Node::Binary(Binary::Add, a, b) => Some(format!("({} + {})", of(a)?, of(b)?)),
        Node::Binary(Binary::Subtract, a, b) => Some(format!("({} - {})", of(a)?, of(b)?)),
        Node::Binary(Binary::Multiply, a, b) if is_fixed(spec, a) => {
            Some(format!("({})*{}", text_of(spec, a), of(b)?))
        }
        Node::Binary(Binary::Multiply, a, b) => Some(format!("{}*({})", of(a)?, text_of(spec, b))),
        Node::Binary(Binary::Divide, a, b) => Some(format!("{}/({})", of(a)?, text_of(spec, b))),
        _ => None,
    }
}

/// Weighted sums of two and more variables that are factors, divisors or arguments of functions in the text, and are no variable and no
/// difference that is known.
fn sums(spec: &ModelSpec, variables: &[VariableId], arguments: &[Argument]) -> Vec<Argument> {
    let differences = arguments
        .iter()
        .filter(|a| a.form == ArgumentForm::Difference);
    let known: Vec<[VariableId; 2]> = differences
        .filter_map(|a| a.variables[..].try_into().ok())
        .collect();
    let node = |id: ExpressionId| spec.expressions.node(id);
    let is_sum =
        |id: ExpressionId| matches!(node(id), Node::Binary(Binary::Add | Binary::Subtract, ..));
    let is_known = |id: ExpressionId| match node(id) {
        Node::Binary(Binary::Subtract, a, b) => match (node(a), node(b)) {
            (Node::Variable(a), Node::Variable(b)) => {
                known.contains(&[a, b]) || known.contains(&[b, a])
            }
            _ => false,
        },
        _ => false,
    };
    let declared: Vec<&str> = (spec.equations.iter())
        .filter(|e| matches!(e.unknown, Unknown::Value(_)) && e.coefficient.is_none())
        .map(|e| text_of(spec, e.rest))
        .collect();
    let mut found: Vec<Argument> = Vec::new();
    for whole in spec.expressions.nodes() {
        if matches!(whole, Node::Binary(Binary::Add | Binary::Subtract, ..)) {
            continue;
        }
        for part in whole.operands().filter(|&part| is_sum(part)) {
            let Some(of) = summed(spec, part) else {
                continue;
            };
            let text = text_of(spec, part);
            let named = |v: &VariableId| text.contains(&spec.variable(*v).name);
            let is_new = of.len() > 1
                && !is_known(part)
                && of.iter().all(|v| variables.contains(v) && named(v))
                && !declared.contains(&text)
                && found.iter().all(|f| f.expression != format!("({text})"));
            if is_new {
                let mut sum = Argument::new(spec, format!("({text})"), of);
                sum.form = ArgumentForm::Sum;
                sum.is_difference = true;
                sum.rate = rate_of_sum(spec, part);
                found.push(sum);
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explain::engine::terms::term::Needs;
    use crate::physics::parse;

    #[test]
    fn a_scale_of_a_variable_is_no_argument_of_its_own() {
        let spec = parse(
            "model Cell parameter Real E0 = 3; parameter Real E1 = 1; parameter Real R = 0.1;
             input Real i; output Real v; Real soc; Real ocv; Real loss; Real rest;
             equation
               der(soc) = i/3600; ocv = E0 + E1*soc/2; loss = R*i^2; rest = ocv - R*i; v = rest - loss;
             end Cell;",
        )
        .unwrap();
        let known = arguments(&spec);
        let has = |name: &str| known.iter().any(|a| a.expression == name);
        let names: Vec<&String> = known.iter().map(|a| &a.expression).collect();
        assert!(
            has("soc") && has("i") && has("loss") && has("rest"),
            "{names:?}"
        );
        assert!(!has("ocv"));
    }

    #[test]
    fn weighted_sums_of_the_text_are_arguments_with_a_rate() {
        let spec = parse(
            "model Body parameter Real b = 1.4; parameter Real k = 20; parameter Real d = 2; input Real F; input Real r;
             output Real y; Real z; Real v; Real q; Real w; Real f; Real e;
             equation der(z) = v; der(q) = w; f = k*(z + b*q) + d*(v + b*w); e = z - 2*q;
             der(v) = F - f + d*(z - 2*q) + d*(r - z); der(w) = -b*f; y = z;
             end Body;",
        )
        .unwrap();
        let all = arguments(&spec);
        let sums = all.iter().filter(|a| a.form == ArgumentForm::Sum);
        let found: Vec<(&str, Option<&str>)> = sums
            .map(|a| (a.expression.as_str(), a.rate.as_deref()))
            .collect();
        // `e` is a variable of its own.
        let expected = [
            ("(z + b*q)", Some("(v + (b)*w)")),
            ("(v + b*w)", None),
            ("(r - z)", None),
        ];
        assert_eq!(found, expected);
    }

    #[test]
    fn differences_from_numbers_of_the_text_serve_as_differences() {
        let spec = parse(
            "model Block parameter Real Ta = 20; input Real P; output Real y; Real T; Real S;
             equation der(T) = P - (T - 20); der(S) = Ta - S; y = T; end Block;",
        )
        .unwrap();
        let all = arguments(&spec);
        let of = |text: &str| all.iter().find(|a| a.expression == text);
        for text in ["(T - 20)", "(S - Ta)"] {
            let found = of(text).unwrap();
            assert!(
                found.serves(Needs::Difference) && !found.serves(Needs::Anything),
                "{text}"
            );
        }
    }
}
