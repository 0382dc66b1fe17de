//! Terms that stand in several equations, such as a force and its reaction or the heat that one body gives another, as variables of
//! their own: what is missing there enters all of them.

use super::fitting::candidate::free_name;
use super::fitting::edit::{Edit, Place, SHARED_TERM, substituted};
use super::terms::summands::{flatten, sums_in};
use crate::physics::{
    Binary, ExpressionId, Function, ModelSpec, Node, Span, Unknown, VariableId, VariableKind,
};

/// Most variables that a plant gets.
const MOST: usize = 8;
/// Larger texts stay as they are: terms are compared each with each.
const MOST_NODES: usize = 2000;

/// The plant with a variable for terms that several rates and outputs share; none where there are no such terms.
pub(crate) fn with_shared_terms(spec: &ModelSpec) -> Option<ModelSpec> {
    let mut found: Option<ModelSpec> = None;
    let most = if spec.expressions.len() > MOST_NODES {
        0
    } else {
        MOST
    };
    for _ in 0..most {
        let now = found.as_ref().unwrap_or(spec);
        match shared(now).or_else(|| shared_product(now)) {
            Some(next) => found = Some(next),
            None => break,
        }
    }
    found
}

/// A term of a sum: its sign, an expression that is the same for the same term in another order, and its text.
struct Part {
    sign: f64,
    key: String,
    text: String,
    /// More than a name, and no number.
    counts: bool,
}

/// A sum in the right-hand side of an equation.
struct Sum {
    equation: usize,
    span: Span,
    parts: Vec<Part>,
}

impl Sum {
    /// The terms that another has as well, all with the same or all with the other sign: the more of them.
    fn common(&self, other: &Self) -> Vec<&Part> {
        let with = |relation: f64| -> Vec<&Part> {
            let same = |a: &Part, b: &Part| a.key == b.key && a.sign * b.sign == relation;
            let parts = self.parts.iter();
            parts
                .filter(|a| other.parts.iter().any(|b| same(a, b)))
                .collect()
        };
        let (same, opposite) = (with(1.0), with(-1.0));
        let common = match same.len() > opposite.len() {
            true => same,
            false => opposite,
        };
        match common.iter().any(|p| p.counts) {
            true => common,
            false => vec![],
        }
    }

    /// The text with a variable in the place of these terms; none where it lacks one, or has them with different signs.
    fn with(&self, terms: &[&Part], (first, name): (f64, &str)) -> Option<String> {
        let of = |term: &&Part| self.parts.iter().find(|p| p.key == term.key);
        let signs = terms.iter().map(|t| Some(of(t)?.sign * t.sign));
        let signs: Vec<f64> = signs.collect::<Option<_>>()?;
        if signs.iter().any(|s| *s != signs[0]) {
            return None;
        }
        let sign = first * signs.first()?;
        let others = self.parts.iter();
        let others = others.filter(|p| !terms.iter().any(|t| t.key == p.key));
        let mut each: Vec<(f64, &str)> = others.map(|p| (p.sign, p.text.as_str())).collect();
        each.push((sign, name));
        Some(match (&self.parts[..], &each[..]) {
            ([_], [(s, only)]) if *s < 0.0 => format!("(-{only})"),
            _ => sum_text(&each),
        })
    }
}

fn sum_text(parts: &[(f64, &str)]) -> String {
    let mut text = String::new();
    for (i, (sign, part)) in parts.iter().enumerate() {
        text.push_str(match (i, *sign < 0.0) {
            (0, false) => "",
            (0, true) => "-",
            (_, false) => " + ",
            (_, true) => " - ",
        });
        text.push_str(part);
    }
    text
}

/// The plant with one variable more, for the largest group of terms that two rates share.
fn shared(spec: &ModelSpec) -> Option<ModelSpec> {
    let sums = sums(spec);
    let mut best: Vec<&Part> = vec![];
    for (i, a) in sums.iter().enumerate() {
        for b in sums[i + 1..].iter().filter(|b| b.equation != a.equation) {
            let common = a.common(b);
            if common.len() > best.len() {
                best = common;
            }
        }
    }
    // As a sum that begins with a plus.
    let first = best.first()?.sign;
    let name = free_name(spec, SHARED_TERM);
    let parts = best.iter().map(|p| (first * p.sign, p.text.as_str()));
    let parts: Vec<(f64, &str)> = parts.collect();
    let mut edit = Edit {
        declarations: vec![format!("Real {name};")],
        equations: vec![format!("{name} = {};", sum_text(&parts))],
        ..Edit::default()
    };
    for at in 0..spec.equations.len() {
        let of_equation = sums.iter().filter(|s| s.equation == at);
        let pieces = of_equation.filter_map(|s| Some((s.span, s.with(&best, (first, &name))?)));
        let pieces: Vec<(Span, String)> = pieces.collect();
        if !pieces.is_empty() {
            let right = spec.expressions.span(spec.equations[at].right);
            let text = substituted(&spec.text, right, pieces);
            edit.changes.push((Place::Equation(at), text));
        }
    }
    edit.apply(spec).ok()
}

/// A factor of a product: an expression that is the same for the same factor, and its text.
#[derive(Clone)]
struct Factor {
    below: bool,
    /// That of the factor with its sign.
    key: String,
    sign: f64,
    /// As it stands, without the sign.
    text: String,
    moves: bool,
}

/// The same product of several rates and outputs, each with factors of its own, such as what flows out of a store and what a
/// gauge shows of it: one variable more in the place of what they have in common.
fn shared_product(spec: &ModelSpec) -> Option<ModelSpec> {
    let products = products(spec);
    let inputs = spec.inputs().into_iter();
    let inputs: Vec<&str> = inputs.map(|v| spec.variable(v).name.as_str()).collect();
    let mut best: Vec<Factor> = vec![];
    for (i, a) in products.iter().enumerate() {
        for b in products[i + 1..]
            .iter()
            .filter(|b| b.equation != a.equation)
        {
            let common = a.common(b);
            // A name and a number, or what is shared already, is no term; what scales an input is that input.
            let moves = |f: &Factor| f.moves && !inputs.contains(&f.key.as_str());
            let term = common.iter().any(moves) && common.iter().any(|f| !f.moves);
            if term && common.len() > best.len() {
                best = common;
            }
        }
    }
    best.first()?;
    let name = free_name(spec, SHARED_TERM);
    for factor in best.iter_mut().filter(|f| f.sign < 0.0) {
        factor.text = format!("(-{})", factor.text);
    }
    let mut edit = Edit {
        declarations: vec![format!("Real {name};")],
        equations: vec![format!("{name} = {};", product_text(&best, None))],
        ..Edit::default()
    };
    for at in 0..spec.equations.len() {
        let of_equation = products.iter().filter(|p| p.equation == at);
        let pieces = of_equation.filter_map(|p| Some((p.span, p.with(&best, &name)?)));
        let pieces: Vec<(Span, String)> = pieces.collect();
        if !pieces.is_empty() {
            let right = spec.expressions.span(spec.equations[at].right);
            let text = substituted(&spec.text, right, pieces);
            edit.changes.push((Place::Equation(at), text));
        }
    }
    edit.apply(spec).ok()
}

/// A product that is a term of a sum.
struct Product {
    equation: usize,
    span: Span,
    sign: f64,
    factors: Vec<Factor>,
}

impl Product {
    /// The factors that both have.
    fn common(&self, other: &Self) -> Vec<Factor> {
        let mut rest: Vec<&Factor> = other.factors.iter().collect();
        let mut both = self.factors.clone();
        both.retain(|f| {
            let same = |o: &&Factor| o.below == f.below && o.key == f.key;
            let at = rest.iter().position(same);
            at.map(|at| rest.swap_remove(at)).is_some()
        });
        both
    }

    /// The text with a variable in the place of these factors; none where it lacks one.
    fn with(&self, factors: &[Factor], name: &str) -> Option<String> {
        let mut rest = self.factors.clone();
        for factor in factors {
            let same = |o: &Factor| o.below == factor.below && o.key == factor.key;
            rest.swap_remove(rest.iter().position(same)?);
        }
        let text = product_text(&rest, Some(name));
        // The others stand as they did, each with its own sign.
        let sign = rest.iter().map(|f| f.sign).product::<f64>() * self.sign;
        Some(match sign < 0.0 {
            true => format!("(-{text})"),
            false => text,
        })
    }
}

fn product_text(factors: &[Factor], name: Option<&str>) -> String {
    let part = |below: bool| -> Vec<&str> {
        let those = factors.iter().filter(|f| f.below == below);
        those.map(|f| f.text.as_str()).collect()
    };
    let mut above = part(false);
    above.extend(name);
    let above = match above.is_empty() {
        true => "1".to_owned(),
        false => above.join("*"),
    };
    let below = part(true)
        .iter()
        .map(|text| format!("/{text}"))
        .collect::<String>();
    format!("{above}{below}")
}

/// The products of all rates and outputs that have several factors.
fn products(spec: &ModelSpec) -> Vec<Product> {
    let outputs = spec.outputs();
    let counts = |unknown: Unknown| match unknown {
        Unknown::Derivative(_) => true,
        Unknown::Value(v) => outputs.contains(&v),
    };
    let mut found = Vec::new();
    for (equation, e) in spec.equations.iter().enumerate() {
        if !counts(e.unknown) {
            continue;
        }
        for (_, parts) in sums_in(spec, e.right) {
            for (_, id) in parts {
                let (sign, factors) = factors(spec, id);
                if factors.len() > 1 {
                    let span = spec.expressions.span(id);
                    found.push(Product {
                        equation,
                        span,
                        sign,
                        factors,
                    });
                }
            }
        }
    }
    found
}

/// The factors of a product, and its sign.
fn factors(spec: &ModelSpec, id: ExpressionId) -> (f64, Vec<Factor>) {
    let mut sign = 1.0;
    let mut factors = Vec::new();
    let mut waiting = vec![(id, false)];
    while let Some((id, below)) = waiting.pop() {
        match spec.expressions.node(id) {
            Node::Binary(Binary::Multiply, a, b) => waiting.extend([(a, below), (b, below)]),
            Node::Binary(Binary::Divide, a, b) => waiting.extend([(a, below), (b, !below)]),
            node => {
                let (own, key) = canonical(spec, id);
                sign *= own;
                let span = spec.expressions.span(id);
                let text = &spec.text[span.start..span.end];
                let text = match node {
                    Node::Number(_) | Node::Variable(_) | Node::Call(..) => text.to_owned(),
                    _ => format!("({text})"),
                };
                let moves = |v: &VariableId| {
                    let kind = spec.variable(*v).kind;
                    !matches!(kind, VariableKind::Parameter | VariableKind::Constant)
                };
                let moves = spec.expressions.variables(id).iter().any(moves);
                factors.push(Factor {
                    below,
                    key,
                    sign: own,
                    text,
                    moves,
                });
            }
        }
    }
    (sign, factors)
}

/// The sums of all rates.
fn sums(spec: &ModelSpec) -> Vec<Sum> {
    let mut found = Vec::new();
    for (equation, e) in spec.equations.iter().enumerate() {
        if !matches!(e.unknown, Unknown::Derivative(_)) {
            continue;
        }
        for (id, parts) in sums_in(spec, e.right) {
            let parts = parts.into_iter().map(|(sign, id)| part(spec, sign, id));
            let parts: Vec<Part> = parts.collect();
            let twice = |p: &Part| parts.iter().filter(|o| o.key == p.key).count() > 1;
            // A term that stands twice in one sum is left alone.
            if !parts.iter().any(twice) {
                let span = spec.expressions.span(id);
                found.push(Sum {
                    equation,
                    span,
                    parts,
                });
            }
        }
    }
    found
}

fn part(spec: &ModelSpec, sign: f64, id: ExpressionId) -> Part {
    let span = spec.expressions.span(id);
    let text = &spec.text[span.start..span.end];
    let open = text.starts_with('-') || text.contains("if ");
    let (own, key) = canonical(spec, id);
    let moves = |v: &VariableId| {
        let kind = spec.variable(*v).kind;
        !matches!(kind, VariableKind::Parameter | VariableKind::Constant)
    };
    let text = match open {
        true => format!("({text})"),
        false => text.to_owned(),
    };
    let (text, sign) = match own < 0.0 {
        // The same text for both: that of the canonical sign.
        true => (format!("(-{text})"), -sign),
        false => (text, sign),
    };
    Part {
        sign,
        key,
        text,
        counts: !matches!(spec.expressions.node(id), Node::Variable(_))
            && spec.expressions.variables(id).iter().any(moves),
    }
}

/// An expression as text in which sums and products have an order, and its sign.
fn canonical(spec: &ModelSpec, id: ExpressionId) -> (f64, String) {
    let of = |id: ExpressionId| {
        let (sign, key) = canonical(spec, id);
        format!("{}{key}", if sign < 0.0 { "-" } else { "" })
    };
    match spec.expressions.node(id) {
        Node::Number(v) => (v.signum(), format!("{:e}", v.abs())),
        Node::Negate(a) => {
            let (sign, key) = canonical(spec, a);
            (-sign, key)
        }
        Node::Binary(Binary::Add | Binary::Subtract, _, _) => {
            let mut parts = Vec::new();
            flatten(spec, id, 1.0, &mut parts);
            let mut each: Vec<(String, f64)> = Vec::new();
            for (sign, part) in parts {
                let (own, key) = canonical(spec, part);
                each.push((key, sign * own));
            }
            each.sort_by(|a, b| a.0.cmp(&b.0));
            let first = each.first().map_or(1.0, |e| e.1);
            let signed = |(key, sign): &(String, f64)| match sign * first < 0.0 {
                true => format!("-{key}"),
                false => format!("+{key}"),
            };
            let text: String = each.iter().map(signed).collect();
            (first, format!("({text})"))
        }
        Node::Binary(Binary::Multiply | Binary::Divide, _, _) => {
            let (sign, factors) = factors(spec, id);
            let key = |f: &Factor| format!("{}{}", if f.below { '/' } else { '*' }, f.key);
            let mut keys: Vec<String> = factors.iter().map(key).collect();
            keys.sort_unstable();
            (sign, keys.concat())
        }
        Node::Call(Function::Abs, a) => (1.0, format!("abs({})", canonical(spec, a).1)),
        Node::Variable(v) => (1.0, spec.variable(v).name.clone()),
        node => {
            let kind = match node {
                Node::Call(function, _) => format!("{function:?}"),
                Node::Binary(operator, _, _) => format!("{operator:?}"),
                Node::If { .. } => "if".to_owned(),
                Node::Delay { .. } => "delay".to_owned(),
                other => format!("{other:?}"),
            };
            let operands: Vec<String> = node.operands().map(of).collect();
            (1.0, format!("{kind}({})", operands.join(",")))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::parse;

    fn made(equations: &str) -> Option<String> {
        let text = format!(
            "model M parameter Real k = 1; parameter Real c = 1; parameter Real m = 2; parameter Real n = 3; input Real u; output Real y;
             Real s; Real v; Real w; equation {equations} y = s; end M;"
        );
        let spec = with_shared_terms(&parse(&text).unwrap())?;
        let all = spec.equations.iter();
        let all = all.map(|e| {
            let [l, r] = [e.left, e.right].map(|id| spec.expressions.span(id));
            format!(
                "{} = {}",
                &spec.text[l.start..l.end],
                &spec.text[r.start..r.end]
            )
        });
        let mut all: Vec<String> = all.collect();
        all.sort();
        Some(all.join("; "))
    }

    #[test]
    fn a_force_and_its_reaction_are_one_variable() {
        let found = made(
            "der(s) = v - w; m*der(v) = u - k*s - c*(v - w); der(w) = (s*k - (w - v)*c - n*w)/n;",
        );
        let expected = "der(s) = v - w; der(w) = (-n*w + shared_term)/n; m*der(v) = u - shared_term; \
                        shared_term = k*s + c*(v - w); y = s";
        let found = found.unwrap();
        let mean = |text: &str| {
            parse(&format!("model M parameter Real k = 1; parameter Real c = 1; parameter Real m = 2; parameter Real n = 3;
            input Real u; output Real y; Real s; Real v; Real w; Real shared_term; equation {text}; end M;"))
        };
        assert!(mean(&found).is_ok() && mean(expected).is_ok(), "{found}");
        assert_eq!(found.matches("shared_term").count(), 3, "{found}");
        assert!(
            found.contains("u - shared_term") || found.contains("u + shared_term"),
            "{found}"
        );
    }

    #[test]
    fn what_stands_once_and_names_alone_stay() {
        assert_eq!(
            made("der(s) = v; m*der(v) = u - k*s; n*der(w) = u - c*w;"),
            None
        );
    }

    #[test]
    fn what_flows_out_and_what_a_gauge_shows_of_it_share_a_product() {
        let text = "model M parameter Real k = 1; parameter Real a = 2; parameter Real c = 3; input Real u; output Real y;
             Real s; equation der(s) = u - k*sqrt(s)/c; y = -a*k*sqrt(s); end M;";
        let spec = with_shared_terms(&parse(text).unwrap()).unwrap();
        assert!(
            spec.text.contains("= k*sqrt(s)") || spec.text.contains("= sqrt(s)*k"),
            "{}",
            spec.text
        );
        assert_eq!(spec.text.matches("shared_term").count(), 4, "{}", spec.text);
        // Nothing of the plant is changed.
        let runs = [&parse(text).unwrap(), &spec].map(|spec| {
            let plant = crate::physics::Plant::new(spec.clone());
            let input = [1.0; 20];
            let excitation = crate::physics::Excitation {
                inputs: &[&input],
                length: 20,
                sample_time: 0.1,
                start_time: 0.0,
                hold: crate::physics::Hold::Zero,
            };
            plant
                .simulate(&plant.nominal(), &excitation, None)
                .unwrap()
                .outputs
        });
        assert_eq!(runs[0].len(), runs[1].len());
        for (a, b) in runs[0][0].iter().zip(&runs[1][0]) {
            assert!((a - b).abs() < 1e-6, "{a} {b}");
        }
    }

    #[test]
    fn factors_of_a_shared_product_stand_as_they_did() {
        let found = made("der(s) = u - k*v*v*(s - w); der(v) = u - n*v; der(w) = k*v*v*(s - u);");
        let found = found.unwrap();
        let sound = found.contains("(s - w)*shared_term") && found.contains("(s - u)*shared_term");
        assert!(sound && !found.contains("(-"), "{found}");
        // What only scales an input is that input.
        assert_eq!(
            made("der(s) = 4*u*(v - s); der(v) = 4*u*(w - v); der(w) = -c*w;"),
            None
        );
    }

    #[test]
    fn a_heat_between_two_bodies_leaves_a_place_in_each() {
        let found =
            made("der(s) = u - k*(s - v); der(v) = k*(s - v) - c*(v - w); der(w) = c*(v - w);");
        let found = found.unwrap();
        assert_eq!(found.matches("shared_term2").count(), 3, "{found}");
        assert!(found.contains("der(w) = shared_term"), "{found}");
    }
}
