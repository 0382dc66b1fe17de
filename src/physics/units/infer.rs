//! Units of variables that declare none, from the equations they stand in.

use super::Unit;
use super::check::{Checker, Known};
use crate::physics::expression::{Binary, ExpressionId, Function, Node};
use crate::physics::spec::ModelSpec;

/// Passes over the equations: in each, what is known reaches the next variable of a chain.
const PASSES: usize = 4;

/// The unit of every variable in words, as declared, or as the equations require it; none where they leave it or its scale open. What a
/// literal may carry is taken as a pure number.
pub(crate) fn units_in_words(spec: &ModelSpec) -> Vec<Option<String>> {
    let mut known = spec.clone();
    for _ in 0..PASSES {
        let found = required(&known);
        let mut new = false;
        for (variable, unit) in known.variables.iter_mut().zip(found) {
            if variable.unit.is_none() && variable.unit_text.is_none() && unit.is_some() {
                variable.unit = unit;
                new = true;
            }
        }
        if !new {
            break;
        }
    }
    let words = super::words::Words::new(spec);
    known
        .variables
        .iter()
        .map(|v| match (&v.unit_text, v.unit) {
            (Some(text), _) => Some(text.clone()),
            (None, unit) => unit.and_then(|unit| words.inferred(unit)),
        })
        .collect()
}

/// What the equations require of each variable, from the units that are known.
fn required(spec: &ModelSpec) -> Vec<Option<Unit>> {
    let checker = Checker::examined(spec);
    let own = |id: ExpressionId| checker.known[id.index()].certain();
    let factor = |id: ExpressionId| match checker.known[id.index()] {
        Known::Literal { .. } => Some(Unit::ONE),
        known => known.certain(),
    };
    let mut wanted: Vec<Option<Unit>> = vec![None; spec.expressions.len()];
    let mut of_variable = vec![None; spec.variables.len()];
    for equation in &spec.equations {
        let (left, right) = (equation.left, equation.right);
        wanted[right.index()] = own(left).or(own(right));
        wanted[left.index()] = own(right).or(own(left));
    }
    // Every operator stands behind its operands.
    for index in (0..spec.expressions.len()).rev() {
        let id = ExpressionId(index as u32);
        if !checker.used[index] {
            continue;
        }
        let whole = wanted[index].or(own(id));
        let mut want = |operand: ExpressionId, unit: Option<Unit>| {
            let slot = &mut wanted[operand.index()];
            *slot = slot.or(unit);
        };
        match spec.expressions.node(id) {
            Node::Number(_) | Node::Time | Node::Not(_) => {}
            Node::Variable(v) | Node::Previous(v) => {
                of_variable[v.index()] = of_variable[v.index()].or(whole)
            }
            Node::Derivative(v) => {
                let unit = whole.map(|u| u.times(&Unit::SECOND));
                of_variable[v.index()] = of_variable[v.index()].or(unit);
            }
            Node::Negate(a) | Node::Call(Function::Abs, a) => want(a, whole),
            Node::Call(Function::Sign, _) => {}
            Node::Call(Function::Sqrt, a) => want(a, whole.and_then(|u| u.power(2.0))),
            Node::Call(_, a) => want(a, Some(Unit::ONE)),
            Node::Delay { value, time } => {
                want(value, whole);
                want(time, Some(Unit::SECOND));
            }
            Node::If { yes, no, .. } => {
                let unit = whole.or(own(yes)).or(own(no));
                want(yes, unit);
                want(no, unit);
            }
            Node::Binary(operator, a, b) => match operator {
                Binary::Multiply => {
                    want(b, per(whole, factor(a)));
                    want(a, per(whole, factor(b)));
                }
                Binary::Divide => {
                    want(b, per(factor(a), whole));
                    let product = |u: Unit| factor(b).map(|v| u.times(&v));
                    want(a, whole.and_then(product));
                }
                Binary::Power => {
                    if let Known::Literal { value, .. } = checker.known[b.index()]
                        && value != 0.0
                    {
                        want(a, whole.and_then(|u| u.power(1.0 / value)));
                    }
                }
                Binary::And | Binary::Or => {}
                Binary::Add | Binary::Subtract | Binary::Min | Binary::Max => {
                    let unit = whole.or(own(a)).or(own(b));
                    want(a, unit);
                    want(b, unit);
                }
                // Both sides of a comparison are alike; that of the whole is a truth value.
                _ => {
                    let unit = own(a).or(own(b));
                    want(a, unit);
                    want(b, unit);
                }
            },
        }
    }
    of_variable
}

fn per(a: Option<Unit>, b: Option<Unit>) -> Option<Unit> {
    a.zip(b).map(|(a, b)| a.per(&b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::parse;

    #[test]
    fn units_follow_from_where_a_variable_stands() {
        let text = "model Cart
               parameter Real m(unit=\"kg\") = 2; parameter Real c = 0.1; parameter Real width = 0.1;
               parameter Real t0 = 3; parameter Real k3 = 1; parameter Real share = 0.5;
               parameter Real a = 1; parameter Real odd = 1;
               input Real F(unit=\"N\"); output Real y(unit=\"m\");
               Real x(unit=\"m\"); Real v(unit=\"m/s\"); Real stretch;
             equation
               der(x) = v;
               der(stretch) = v - a*stretch;
               m*der(v) = share*F - c*v*abs(v) - (if time > t0 then 1.0 else 0.0)*c*v*v*tanh(v/width)
                 - k3*x^3 + sin(odd*c);
               y = x;
             end Cart;";
        let spec = parse(text).expect("a plant");
        let units = units_in_words(&spec);
        let of = |name: &str| {
            let v = spec.find(name).expect("a variable");
            units[v.index()].clone().unwrap_or_default()
        };
        assert_eq!(of("c"), "kg/m");
        assert_eq!(of("width"), "m/s");
        assert_eq!(of("t0"), "s");
        assert_eq!(of("k3"), "Pa/m");
        assert_eq!(of("share"), "1");
        assert_eq!(of("stretch"), "m");
        assert_eq!(of("a"), "1/s");
        assert_eq!(of("F"), "N");
        // The inverse of that of `c`.
        assert_eq!(of("odd"), "m/kg");
    }

    #[test]
    fn a_prefix_leaves_the_scale_of_what_follows_open() {
        let text = "model Oven
               parameter Real C(unit=\"kJ/K\") = 5; parameter Real most = 2; parameter Real c = 0.1;
               parameter Real lag = 3; input Real Q(unit=\"kW\"); output Real y(unit=\"K\");
               Real T(unit=\"K\"); Real q;
             equation
               lag*der(q) = Q - q; C*der(T) = min(q, most) - c*T^2; y = T;
             end Oven;";
        let spec = parse(text).expect("a plant");
        let units = units_in_words(&spec);
        let of = |name: &str| units[spec.find(name).expect("a variable").index()].clone();
        assert_eq!(of("most").as_deref(), Some("kW"));
        assert_eq!(of("lag").as_deref(), Some("s"));
        assert_eq!(of("c"), None);
    }
}
