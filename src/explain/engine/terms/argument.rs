//! What a missing term may be a function of, with its values along the recordings.

use std::f64::consts::TAU;

use crate::physics::{
    Binary, Equation, ExpressionId, ModelSpec, Node, Unknown, VariableId, VariableKind,
};

use crate::explain::engine::fitting::edit::Place;
use crate::explain::engine::terms::names::{
    is_position, is_velocity, may_be_angle, may_be_velocity,
};
use crate::explain::engine::terms::term::Needs;

/// How an argument is made of variables.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ArgumentForm {
    Variable,
    /// A difference of two variables of one unit.
    Difference,
    /// A difference of a variable and a number or parameter that stands in the text.
    FromReference,
    /// A weighted sum of variables that stands in the text, such as how fast a strut on a turning body is compressed.
    Sum,
    Product,
    /// The difference of the fourth powers of two absolute temperatures in 100 K.
    Radiation,
    /// The size of what drives a velocity, with the sign of this: a loss in proportion to the force.
    Driven,
}

/// An expression of the plant's variables.
#[derive(Debug, Clone)]
pub(crate) struct Argument {
    pub(crate) expression: String,
    pub(crate) variables: Vec<VariableId>,
    /// Place of the equation behind which all of it is known; none where states and inputs are enough.
    pub(crate) known_after: Option<usize>,
    pub(crate) form: ArgumentForm,
    /// The plant declares it as the difference of two others, or as the distance of two that move.
    pub(crate) is_difference: bool,
    /// Its derivative, where the plant has variables for that.
    pub(crate) rate: Option<String>,
    /// In radians.
    pub(crate) angle: bool,
    /// One turn of an angle, in its unit.
    pub(crate) turn: Option<f64>,
    pub(crate) velocity: bool,
    pub(crate) position: bool,
    /// Changes at samples only: it is made of inputs.
    pub(crate) held: bool,
    /// Values along each recording.
    pub(crate) values: Vec<Vec<f64>>,
    /// Values at the end of each sample, before anything of the next one is known: inputs that are held have not changed yet, and
    /// an observer has not corrected. Under feedback they would tell of the noise that is to come.
    pub(crate) ends: Vec<Vec<f64>>,
    sorted: Vec<f64>,
}

/// Temperature of a room, 20 degC, as in [`ArgumentForm::Radiation`].
const ROOM: &str = "2.9315^4";
/// What is smaller than this part of the largest value for this part of the time comes down to zero.
const AT_ZERO: f64 = 0.1;
/// Part of its range that an argument must go back for a reversal: noise of a sensor is less.
const BACK: f64 = 0.1;
/// Samples that quantiles are taken of.
const SORTED: usize = 4000;

impl Argument {
    fn new(spec: &ModelSpec, expression: String, variables: Vec<VariableId>) -> Self {
        let known_after = variables
            .iter()
            .filter(|&&v| spec.variable(v).kind == VariableKind::Algebraic)
            .filter_map(|&v| {
                spec.equations
                    .iter()
                    .position(|e| e.unknown.variable() == v)
            })
            .max();
        let unit = |v: VariableId| spec.variable(v).unit_text.as_deref().unwrap_or("");
        let held = variables
            .iter()
            .all(|&v| spec.variable(v).kind == VariableKind::Input);
        let turn = match variables[..] {
            [v] if unit(v) == "rad" || may_be_angle(spec, &[v]) => Some(TAU),
            [v] if unit(v) == "deg" => Some(360.0),
            _ => None,
        };
        Self {
            form: ArgumentForm::Variable,
            velocity: is_velocity(spec, &variables)
                || may_be_velocity(spec, &variables)
                    && variables
                        .iter()
                        .all(|&v| spec.variable(v).kind != VariableKind::Input),
            angle: turn == Some(TAU),
            turn,
            position: is_position(spec, &variables),
            is_difference: variables.len() == 1 && moves_apart(spec, variables[0]),
            rate: rate(spec, &variables),
            held,
            expression,
            variables,
            known_after,
            values: Vec::new(),
            ends: Vec::new(),
            sorted: Vec::new(),
        }
    }

    /// Takes over the values.
    pub(crate) fn set(&mut self, values: Vec<Vec<f64>>, ends: Vec<Vec<f64>>) {
        self.ends = ends;
        let all: Vec<f64> = values.iter().flatten().copied().collect();
        let every = (all.len() / SORTED).max(1);
        self.sorted = all.into_iter().step_by(every).collect();
        self.sorted.sort_by(f64::total_cmp);
        self.values = values;
    }

    /// The same with the values before an observer corrects them: what a sensor is expected to show.
    pub(crate) fn before_correction(&self) -> Self {
        let before = |(values, ends): (&Vec<f64>, &Vec<f64>)| -> Vec<f64> {
            let first = values.first().copied();
            let others = ends.iter().copied().take(values.len().saturating_sub(1));
            first.into_iter().chain(others).collect()
        };
        let values = self.values.iter().zip(&self.ends).map(before).collect();
        let mut before = self.clone();
        before.set(values, self.ends.clone());
        before
    }

    /// The value below which this part of all values lies.
    pub(crate) fn quantile(&self, part: f64) -> f64 {
        let last = self.sorted.len().saturating_sub(1);
        let at = (part * last as f64).round() as usize;
        self.sorted.get(at.min(last)).copied().unwrap_or(0.0)
    }

    /// The same of the absolute values.
    pub(crate) fn size_quantile(&self, part: f64) -> f64 {
        let mut sizes: Vec<f64> = self.sorted.iter().map(|v| v.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let last = sizes.len().saturating_sub(1);
        let at = (part * last as f64).round() as usize;
        sizes.get(at.min(last)).copied().unwrap_or(0.0)
    }

    /// Its median, to two digits of its spread: a number that people can read.
    pub(crate) fn usual(&self) -> f64 {
        let (middle, spread) = (self.quantile(0.5), self.spread());
        if spread <= 0.0 {
            return middle;
        }
        let digit = 10f64.powf(spread.log10().floor() - 1.0);
        let usual = (middle / digit).round() * digit;
        // As it is written: without what the multiplication has added, nor a sign of zero.
        format!("{usual:.12e}").parse().unwrap_or(usual) + 0.0
    }

    /// Whether it goes back by more than [`BACK`] of its range after it has gone up, and after it has gone down: what remembers the
    /// way that it went shows only then.
    pub(crate) fn reverses(&self) -> bool {
        let (mut fall, mut rise) = (0.0_f64, 0.0_f64);
        for values in &self.values {
            let (mut highest, mut lowest) = (f64::NEG_INFINITY, f64::INFINITY);
            for &v in values.iter().filter(|v| v.is_finite()) {
                (highest, lowest) = (highest.max(v), lowest.min(v));
                (fall, rise) = (fall.max(highest - v), rise.max(v - lowest));
            }
        }
        fall.min(rise) > BACK * self.range()
    }

    pub(crate) fn range(&self) -> f64 {
        self.quantile(1.0) - self.quantile(0.0)
    }

    pub(crate) fn spread(&self) -> f64 {
        let n = self.sorted.len().max(1) as f64;
        let mean = self.sorted.iter().sum::<f64>() / n;
        (self.sorted.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt()
    }

    /// Root mean square of its changes from sample to sample, for a unit of time.
    pub(crate) fn rate_size(&self, sample_time: f64) -> f64 {
        let changes = self
            .values
            .iter()
            .flat_map(|v| v.windows(2))
            .map(|w| w[1] - w[0]);
        let (sum, count) = changes
            .filter(|d| d.is_finite())
            .fold((0.0, 0.0), |(sum, n), d| (sum + d * d, n + 1.0));
        (sum / f64::max(count, 1.0)).sqrt() / sample_time
    }

    /// Range of its integral, the largest of all recordings.
    pub(crate) fn travel(&self, sample_time: f64) -> f64 {
        let of = |values: &Vec<f64>| {
            let (mut sum, mut low, mut high) = (0.0f64, 0.0f64, 0.0f64);
            for v in values.iter().filter(|v| v.is_finite()) {
                sum += v * sample_time;
                (low, high) = (low.min(sum), high.max(sum));
            }
            high - low
        };
        self.values.iter().map(of).fold(0.0, f64::max)
    }

    /// Whether a term can be a function of it.
    pub(crate) fn serves(&self, needs: Needs) -> bool {
        if self.form == ArgumentForm::Product
            || self.form == ArgumentForm::Radiation && needs != Needs::Radiation
            || self.form == ArgumentForm::FromReference && needs != Needs::Difference
            || self.form == ArgumentForm::Driven && needs != Needs::Driven
        {
            return false;
        }
        let both = self.quantile(0.05) < 0.0 && self.quantile(0.95) > 0.0;
        let turns = self.quantile(0.0) < 0.0 && self.quantile(1.0) > 0.0;
        match needs {
            Needs::Anything => true,
            Needs::BothSigns => both,
            Needs::AboutZero => {
                both || self.size_quantile(AT_ZERO) < AT_ZERO * self.size_quantile(1.0)
            }
            Needs::Positive => self.quantile(0.0) >= 0.0,
            Needs::Radiation => self.form == ArgumentForm::Radiation,
            Needs::Driven => self.form == ArgumentForm::Driven && both,
            Needs::Difference => {
                let of_text = [ArgumentForm::Difference, ArgumentForm::FromReference];
                of_text.contains(&self.form) || self.is_difference
            }
            Needs::Stretch => self.position && self.serves(Needs::Difference),
            Needs::Angle => self.angle,
            Needs::AlongPath => self.angle || self.position && self.variables.len() == 1,
            Needs::Velocity => both && self.velocity,
            Needs::Turning => both || self.velocity && turns,
            Needs::Directed => turns || self.serves(Needs::OneWay),
            // It may begin at rest.
            Needs::OneWay => self.velocity && !turns,
            Needs::OwnState | Needs::Integrated => {
                self.form == ArgumentForm::Variable && !self.held
            }
            Needs::SwitchedOn => {
                self.held
                    && self
                        .values
                        .iter()
                        .all(|v| v.first().is_some_and(|u| *u != 0.0))
            }
            Needs::Time => false,
        }
    }
}

/// The derivative of a variable, or of the difference of two, where the plant has it as `der(x) = v`.
fn rate(spec: &ModelSpec, variables: &[VariableId]) -> Option<String> {
    let of = |v: VariableId| {
        let equation = spec
            .equations
            .iter()
            .find(|e| e.unknown == Unknown::Derivative(v))?;
        match spec.expressions.node(equation.rest) {
            Node::Variable(rate) if equation.coefficient.is_none() => {
                Some(spec.variable(rate).name.clone())
            }
            _ => None,
        }
    };
    match *variables {
        [v] => of(v).or_else(|| {
            let equation = spec
                .equations
                .iter()
                .find(|e| e.unknown == Unknown::Value(v))?;
            let Node::Binary(Binary::Subtract, a, b) = spec.expressions.node(equation.rest) else {
                return None;
            };
            let operands = (spec.expressions.node(a), spec.expressions.node(b));
            let (Node::Variable(a), Node::Variable(b)) = operands else {
                return None;
            };
            let whole = equation.coefficient.is_none();
            whole.then(|| Some(format!("({} - {})", of(a)?, of(b)?)))?
        }),
        [a, b] => Some(format!("({} - {})", of(a)?, of(b)?)),
        _ => None,
    }
}

/// Whether a variable is the distance of two that move: `der(x) = a - b`.
fn moves_apart(spec: &ModelSpec, v: VariableId) -> bool {
    let is_variable = |id| matches!(spec.expressions.node(id), Node::Variable(_));
    spec.equations.iter().any(|e| {
        e.unknown == Unknown::Derivative(v)
            && e.coefficient.is_none()
            && matches!(spec.expressions.node(e.rest),
                Node::Binary(Binary::Subtract, a, b) if is_variable(a) && is_variable(b))
    })
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
        let span = spec.expressions.span(number);
        let name = &spec.variable(variable).name;
        let text = format!("({name} - {})", &spec.text[span.start..span.end]);
        let known = found.iter().any(|f| f.expression == text);
        if variables.contains(&variable) && !known {
            let mut argument = Argument::new(spec, text, vec![variable]);
            argument.form = ArgumentForm::FromReference;
            found.push(argument);
        }
    }
    found
}

/// The one variable that an expression is an affine function of, with coefficients made of parameters and numbers; `Some(None)`
/// where it is made of these alone, none where it is anything else.
fn affine(spec: &ModelSpec, id: ExpressionId) -> Option<Option<VariableId>> {
    let of = |id| affine(spec, id);
    match spec.expressions.node(id) {
        Node::Number(_) => Some(None),
        Node::Variable(v) => match spec.variable(v).kind {
            VariableKind::Parameter | VariableKind::Constant => Some(None),
            _ => Some(Some(v)),
        },
        Node::Negate(a) => of(a),
        Node::Binary(Binary::Add | Binary::Subtract, a, b) => match (of(a)?, of(b)?) {
            (Some(a), Some(b)) if a != b => None,
            (a, b) => Some(a.or(b)),
        },
        Node::Binary(Binary::Multiply, a, b) => match (of(a)?, of(b)?) {
            (Some(_), Some(_)) => None,
            (a, b) => Some(a.or(b)),
        },
        Node::Binary(Binary::Divide, a, b) => match of(b)? {
            Some(_) => None,
            None => of(a),
        },
        _ => None,
    }
}

/// Variables of an expression that is their weighted sum, with weights and a constant made of parameters and numbers.
fn summed(spec: &ModelSpec, id: ExpressionId) -> Option<Vec<VariableId>> {
    let both = |a, b| {
        let (mut all, more) = (summed(spec, a)?, summed(spec, b)?);
        all.extend(more);
        Some(all)
    };
    match spec.expressions.node(id) {
        Node::Number(_) => Some(vec![]),
        Node::Variable(v) => match spec.variable(v).kind {
            VariableKind::Parameter | VariableKind::Constant => Some(vec![]),
            _ => Some(vec![v]),
        },
        Node::Negate(a) => summed(spec, a),
        Node::Binary(Binary::Add | Binary::Subtract, a, b) => both(a, b),
        Node::Binary(Binary::Multiply, a, b) => {
            both(a, b).filter(|_| is_fixed(spec, a) || is_fixed(spec, b))
        }
        Node::Binary(Binary::Divide, a, b) => summed(spec, a).filter(|_| is_fixed(spec, b)),
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
    let is_declared = |text: &str| {
        let own = |e: &Equation| matches!(e.unknown, Unknown::Value(_)) && e.coefficient.is_none();
        let declared = |e: &&Equation| own(e) && text_of(spec, e.rest) == text;
        spec.equations.iter().any(|e| declared(&e))
    };
    let mut found: Vec<Argument> = Vec::new();
    for whole in spec.expressions.nodes() {
        if matches!(whole, Node::Binary(Binary::Add | Binary::Subtract, ..)) {
            continue;
        }
        for part in whole.operands().filter(|&part| is_sum(part)) {
            let Some(mut of) = summed(spec, part) else {
                continue;
            };
            of.sort();
            of.dedup();
            let sides = match node(part) {
                Node::Binary(Binary::Subtract, a, b) => Some([node(a), node(b)]),
                _ => None,
            };
            let is_pair = |&[a, b]: &[VariableId; 2]| {
                [[a, b], [b, a]]
                    .map(|pair| Some(pair.map(Node::Variable)))
                    .contains(&sides)
            };
            let is_difference = known.iter().any(is_pair);
            let text = text_of(spec, part);
            let named = |v: &VariableId| text.contains(&spec.variable(*v).name);
            let is_new = of.len() > 1
                && !is_difference
                && of.iter().all(|v| variables.contains(v) && named(v))
                && !is_declared(text)
                && !found
                    .iter()
                    .any(|f| f.expression[1..f.expression.len() - 1] == *text);
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
                && matches!(affine(spec, e.rest), Some(Some(_)))
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
    // Bodies radiate to each other, and each to a room.
    let fourth = |v: VariableId| match spec.variable(v).unit_text.as_deref() {
        Some("K") => Some(format!("({}/100)^4", name(v))),
        Some("degC") => Some(format!("(({} + 273.15)/100)^4", name(v))),
        _ => None,
    };
    let warm: Vec<(VariableId, String)> = simple
        .iter()
        .filter(|&&v| source(v))
        .filter_map(|&v| Some((v, fourth(v)?)))
        .collect();
    let mut radiation: Vec<(String, Vec<VariableId>)> = Vec::new();
    for (i, (a, of_a)) in warm.iter().enumerate() {
        for (b, of_b) in &warm[i + 1..] {
            radiation.push((format!("({of_a} - {of_b})"), vec![*a, *b]));
        }
        radiation.push((format!("({of_a} - {ROOM})"), vec![*a]));
    }
    found.extend(radiation.into_iter().map(|(text, variables)| {
        let mut argument = Argument::new(spec, text, variables);
        (argument.form, argument.rate) = (ArgumentForm::Radiation, None);
        argument
    }));
    found
}

#[cfg(test)]
mod tests {
    use super::*;
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

    /// The argument `x` with these values in two recordings.
    fn with_values(values: [Vec<f64>; 2]) -> Argument {
        let spec = parse(
            "model M input Real u; output Real y; Real x; equation der(x) = u; y = x; end M;",
        )
        .unwrap();
        let mut x = arguments(&spec)
            .into_iter()
            .find(|a| a.expression == "x")
            .unwrap();
        x.set(values.to_vec(), values.to_vec());
        x
    }

    #[test]
    fn what_only_rises_does_not_reverse_and_noise_is_no_reversal() {
        let rising = |k: i32| f64::from(k) + 0.5 * f64::from(k % 2);
        let up: Vec<f64> = (0..20).map(rising).collect();
        let down: Vec<f64> = up.iter().rev().copied().collect();
        assert!(!with_values([up.clone(), up.clone()]).reverses());
        // Between recordings nothing moves, but each may move in a way of its own.
        let to_and_fro = [&up[..], &down[..]].concat();
        assert!(with_values([up, to_and_fro]).reverses());
    }

    #[test]
    fn a_usual_value_has_two_digits_of_the_spread() {
        let warm: Vec<f64> = (0..101)
            .map(|k| 318.4321 + 0.1 * f64::from(k - 50))
            .collect();
        assert_eq!(with_values([warm.clone(), warm]).usual(), 318.4);
        assert_eq!(with_values([vec![5.0; 3], vec![5.0; 3]]).usual(), 5.0);
        let about_zero = vec![-3.0, -0.001, 3.0];
        let usual = with_values([about_zero.clone(), about_zero]).usual();
        assert_eq!(usual.to_string(), "0");
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
