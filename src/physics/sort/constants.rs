//! Constants and parameters: their order, their kind, their values and everyone's bounds.

use crate::physics::error::{SpecError, SpecErrorKind, shortened};
use crate::physics::expression::{Binary, ExpressionId, Function, Node, VariableId};
use crate::physics::spec::VariableKind;
use crate::physics::syntax::draft::{Declaration, Draft, DraftExpression, Role};

/// A bound of this size or more is none: `Modelica.Constants.inf` is 1e60 in some tools.
const UNBOUNDED: f64 = 1e60;

/// What is settled about each variable.
pub(super) struct Settled {
    pub(super) kind: VariableKind,
    pub(super) min: f64,
    pub(super) max: f64,
    pub(super) nominal: Option<f64>,
    pub(super) value: Option<ExpressionId>,
    pub(super) number: Option<f64>,
}

/// What is settled about all variables.
pub(super) struct Constants {
    /// Constants and parameters, each behind those that it needs.
    pub(super) order: Vec<VariableId>,
    pub(super) settled: Vec<Settled>,
}

/// Orders and evaluates constants and parameters, and evaluates bounds.
///
/// # Errors
/// All values that are missing; where none is, all that are wrong in themselves.
pub(super) fn settle(draft: &Draft, kinds: &[VariableKind]) -> Result<Constants, Vec<SpecError>> {
    let count = kinds.len();
    let mut values = vec![None; count];
    let mut errors = vec![];
    for (index, declared) in draft.declarations.iter().enumerate() {
        if certain(kinds[index]) {
            match value_of(draft, declared) {
                Ok(value) => values[index] = Some(value),
                Err(error) => errors.push(error),
            }
        }
    }
    if !errors.is_empty() {
        return Err(errors);
    }
    let order = order(draft, &values).map_err(|e| vec![e])?;
    let mut evaluator = Evaluator {
        draft,
        numbers: vec![0.0; count],
        scratch: vec![],
    };
    let mut kinds = kinds.to_vec();
    // True for what changes when a free parameter does.
    let mut free = vec![false; count];
    for &id in &order {
        let index = id.index();
        let declared = &draft.declarations[index];
        let Some(value) = values[index] else { continue };
        let computed = needed(draft, value).any(|v| free[v.index()]);
        if declared.role == Role::Parameter && computed {
            kinds[index] = VariableKind::Constant;
        }
        free[index] = computed || kinds[index] == VariableKind::Parameter;
        // What is computed from a wrong value is not looked at.
        evaluator.numbers[index] = evaluator
            .finite(declared, "value", value)
            .map_err(|e| vec![e])?;
    }
    let mut settled = Vec::with_capacity(count);
    for (index, declared) in draft.declarations.iter().enumerate() {
        let kind = kinds[index];
        match settled_one(&mut evaluator, declared, kind, index) {
            Ok(one) => settled.push(Settled {
                value: values[index].map(|v| v.root),
                number: values[index].map(|_| evaluator.numbers[index]),
                ..one
            }),
            Err(error) => errors.push(error),
        }
    }
    errors.extend(delays(&mut evaluator).err());
    if errors.is_empty() {
        Ok(Constants { order, settled })
    } else {
        Err(errors)
    }
}

/// Bounds and nominal value, where the value or start is within them.
fn settled_one(
    evaluator: &mut Evaluator,
    declared: &Declaration,
    kind: VariableKind,
    index: usize,
) -> Result<Settled, SpecError> {
    let (min, max) = bounds(evaluator, declared)?;
    let nominal = match declared.nominal {
        Some(n) => Some(evaluator.finite(declared, "nominal", n)?.abs()).filter(|&n| n > 0.0),
        None => None,
    };
    let checked = if certain(kind) {
        Some(("value", evaluator.numbers[index]))
    } else if let Some(start) = declared.start {
        Some(("start", evaluator.finite(declared, "start", start)?))
    } else {
        None
    };
    if let Some((what, number)) = checked
        && !(min..=max).contains(&number)
    {
        let name = shortened(&declared.name);
        let message = format!(
            "the {what} {number} of `{name}` is outside its bounds: min = {min}, max = {max}"
        );
        return Err(value_error(evaluator.draft, declared, message));
    }
    Ok(Settled {
        kind,
        min,
        max,
        nominal,
        value: None,
        number: None,
    })
}

fn certain(kind: VariableKind) -> bool {
    matches!(kind, VariableKind::Constant | VariableKind::Parameter)
}

fn value_error(draft: &Draft, declared: &Declaration, message: String) -> SpecError {
    SpecError::new(draft.text, declared.span, SpecErrorKind::Value(message))
}

fn value_of(draft: &Draft, declared: &Declaration) -> Result<DraftExpression, SpecError> {
    declared.value.or(declared.start).ok_or_else(|| {
        let word = if declared.role == Role::Constant {
            "constant"
        } else {
            "parameter"
        };
        let name = shortened(&declared.name);
        let message = format!("the {word} `{name}` has no value: write `= value` behind its name");
        value_error(draft, declared, message)
    })
}

/// Constants and parameters that an expression uses.
fn needed(draft: &Draft, expression: DraftExpression) -> impl Iterator<Item = VariableId> {
    expression
        .range()
        .filter_map(|i| match draft.expressions.node(ExpressionId(i as u32)) {
            Node::Variable(v) => Some(v),
            _ => None,
        })
}

/// Depth-first, with a list in the place of recursion.
fn order(draft: &Draft, values: &[Option<DraftExpression>]) -> Result<Vec<VariableId>, SpecError> {
    #[derive(Clone, Copy, PartialEq)]
    enum Mark {
        New,
        Open,
        Done,
    }
    let mut marks = vec![Mark::New; values.len()];
    let mut answer = vec![];
    let mut path: Vec<(usize, std::ops::RangeInclusive<usize>)> = vec![];
    for root in 0..values.len() {
        let Some(value) = values[root].filter(|_| marks[root] == Mark::New) else {
            continue;
        };
        marks[root] = Mark::Open;
        path.push((root, value.range()));
        while let Some((index, rest)) = path.last_mut() {
            let index = *index;
            let next = rest.find_map(|i| match draft.expressions.node(ExpressionId(i as u32)) {
                Node::Variable(v) if marks[v.index()] != Mark::Done => Some(v.index()),
                _ => None,
            });
            match next {
                None => {
                    marks[index] = Mark::Done;
                    answer.push(VariableId(index as u32));
                    path.pop();
                }
                Some(other) if marks[other] == Mark::Open => {
                    let from = path.iter().position(|p| p.0 == other).unwrap_or(0);
                    return Err(cycle(draft, path[from..].iter().map(|p| p.0).collect()));
                }
                Some(other) => {
                    let Some(value) = values[other] else { continue };
                    marks[other] = Mark::Open;
                    path.push((other, value.range()));
                }
            }
        }
    }
    Ok(answer)
}

fn cycle(draft: &Draft, members: Vec<usize>) -> SpecError {
    let declared = &draft.declarations[members[0]];
    let names: Vec<String> = members
        .iter()
        .map(|&m| draft.declarations[m].name.clone())
        .collect();
    let kind = match names.as_slice() {
        [one] => SpecErrorKind::Value(format!("the value of `{}` needs itself", shortened(one))),
        _ => SpecErrorKind::Cycle(names),
    };
    SpecError::new(draft.text, declared.span, kind)
}

fn bounds(evaluator: &mut Evaluator, declared: &Declaration) -> Result<(f64, f64), SpecError> {
    let mut of = |what, bound: Option<DraftExpression>, none: f64| -> Result<f64, SpecError> {
        let Some(bound) = bound else { return Ok(none) };
        let value = evaluator.finite(declared, what, bound)?;
        Ok(if value.abs() >= UNBOUNDED {
            none.abs().copysign(value)
        } else {
            value
        })
    };
    let min = of("min", declared.min, f64::NEG_INFINITY)?;
    let max = of("max", declared.max, f64::INFINITY)?;
    if min > max {
        let name = shortened(&declared.name);
        let message = format!("min = {min} of `{name}` is above its max = {max}");
        return Err(value_error(evaluator.draft, declared, message));
    }
    Ok((min, max))
}

/// The time of a delay is not negative.
fn delays(evaluator: &mut Evaluator) -> Result<(), SpecError> {
    let draft = evaluator.draft;
    for equation in &draft.equations {
        let has_delay = |i| {
            matches!(
                draft.expressions.node(ExpressionId(i as u32)),
                Node::Delay { .. }
            )
        };
        if !equation.range().any(has_delay) {
            continue;
        }
        let first = *equation.range().start();
        evaluator.run(equation.range());
        for index in equation.range() {
            if let Node::Delay { time, .. } = draft.expressions.node(ExpressionId(index as u32))
                && !evaluator.scratch[time.index() - first]
                    .is_some_and(|t| t >= 0.0 && t.is_finite())
            {
                let span = draft.expressions.span(time);
                let message = "the time of a delay has to be zero or more".to_string();
                return Err(SpecError::new(
                    draft.text,
                    span,
                    SpecErrorKind::Value(message),
                ));
            }
        }
    }
    Ok(())
}

struct Evaluator<'a> {
    draft: &'a Draft<'a>,
    /// Values of constants and parameters so far.
    numbers: Vec<f64>,
    scratch: Vec<Option<f64>>,
}

impl Evaluator<'_> {
    /// Evaluates the nodes of a range into `scratch`: those that change in time have no value.
    fn run(&mut self, range: std::ops::RangeInclusive<usize>) {
        let first = *range.start();
        self.scratch.clear();
        for index in range {
            let of = |id: ExpressionId| {
                self.scratch
                    .get(id.index().wrapping_sub(first))
                    .copied()
                    .flatten()
            };
            let node = self.draft.expressions.node(ExpressionId(index as u32));
            let value = match node {
                Node::Number(value) => Some(value),
                Node::Variable(v) => self.numbers.get(v.index()).copied(),
                Node::Time | Node::Derivative(_) | Node::Delay { .. } | Node::Previous(_) => None,
                Node::Negate(a) => of(a).map(|a| -a),
                Node::Not(a) => of(a).map(|a| 1.0 - a),
                Node::Call(f, a) => of(a).map(|a| call(f, a)),
                Node::Binary(f, a, b) => of(a).zip(of(b)).map(|(a, b)| binary(f, a, b)),
                Node::If { condition, yes, no } => {
                    of(condition).and_then(|c| of(if c > 0.5 { yes } else { no }))
                }
            };
            self.scratch.push(value);
        }
    }

    fn finite(
        &mut self,
        declared: &Declaration,
        what: &str,
        expression: DraftExpression,
    ) -> Result<f64, SpecError> {
        self.run(expression.range());
        match self.scratch.last().copied().flatten() {
            Some(value) if value.is_finite() => Ok(value),
            _ => {
                let name = shortened(&declared.name);
                Err(value_error(
                    self.draft,
                    declared,
                    format!("the {what} of `{name}` is not a finite number"),
                ))
            }
        }
    }
}

pub(super) fn call(function: Function, a: f64) -> f64 {
    match function {
        Function::Sin => a.sin(),
        Function::Cos => a.cos(),
        Function::Tan => a.tan(),
        Function::Asin => a.asin(),
        Function::Acos => a.acos(),
        Function::Atan => a.atan(),
        Function::Sinh => a.sinh(),
        Function::Cosh => a.cosh(),
        Function::Tanh => a.tanh(),
        Function::Exp => a.exp(),
        Function::Log => a.ln(),
        Function::Log10 => a.log10(),
        Function::Sqrt => a.sqrt(),
        Function::Abs => a.abs(),
        Function::Sign if a == 0.0 => 0.0,
        Function::Sign => a.signum(),
    }
}

pub(super) fn binary(operator: Binary, a: f64, b: f64) -> f64 {
    let truth = |holds: bool| f64::from(u8::from(holds));
    match operator {
        Binary::Add => a + b,
        Binary::Subtract => a - b,
        Binary::Multiply => a * b,
        Binary::Divide => a / b,
        Binary::Power => a.powf(b),
        Binary::Min => a.min(b),
        Binary::Max => a.max(b),
        Binary::Atan2 => a.atan2(b),
        Binary::Less => truth(a < b),
        Binary::LessOrEqual => truth(a <= b),
        Binary::Greater => truth(a > b),
        Binary::GreaterOrEqual => truth(a >= b),
        Binary::Equal => truth(a == b),
        Binary::NotEqual => truth(a != b),
        Binary::And => truth(a > 0.5 && b > 0.5),
        Binary::Or => truth(a > 0.5 || b > 0.5),
    }
}
