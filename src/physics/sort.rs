//! Settles which equation determines what, and in which order: an equation is taken when one unknown is left in it.

mod classify;
mod constants;
mod failure;
mod linear;
mod previous;
#[cfg(test)]
mod tests;

use super::error::SpecError;
use super::expression::{ExpressionId, Expressions, Node, VariableId};
use super::spec::{Equation, ModelSpec, Unknown, Variable, VariableKind};
use super::syntax::draft::{Draft, DraftEquation};
use std::collections::VecDeque;

/// From what a text says to a model whose equations are in order.
pub(crate) fn determine(draft: Draft) -> Result<ModelSpec, Vec<SpecError>> {
    let kinds = classify::kinds(&draft)?;
    let constants = constants::settle(&draft, &kinds)?;
    let mut expressions = draft.expressions;
    let incidence = Incidence::new(&expressions, &draft.equations, &kinds);
    let order = order(&incidence, draft.equations.len());
    let names: Vec<&str> = draft.declarations.iter().map(|d| d.name.as_str()).collect();
    let system = System {
        text: draft.text,
        names: &names,
        kinds: &kinds,
        equations: &draft.equations,
        incidence: &incidence,
    };
    let mut errors = failure::explain(&system, &order, &expressions, &draft.declarations);
    let mut equations = Vec::with_capacity(order.taken.len());
    let mut unsolved = vec![];
    for &(equation, variable) in order.taken.iter().filter(|_| errors.is_empty()) {
        match linear::solve(&system, &mut expressions, equation, variable) {
            Ok(solved) => equations.push(solved),
            Err(error) => unsolved.push(error),
        }
    }
    errors.extend(unsolved);
    if errors.is_empty() {
        let sound = previous::check(draft.text, &names, &kinds, &expressions, &equations);
        errors.extend(sound.err());
    }
    if !errors.is_empty() {
        return Err(errors);
    }
    let variables = draft
        .declarations
        .into_iter()
        .zip(constants.settled)
        .map(|(declared, settled)| Variable {
            name: declared.name,
            description: declared.description,
            kind: settled.kind,
            output: declared.output,
            unit: declared.unit,
            unit_text: declared.unit_text,
            min: settled.min,
            max: settled.max,
            nominal: settled.nominal,
            start: declared.start.map(|s| s.root),
            fixed: declared.fixed,
            value: settled.value,
            number: settled.number,
            span: declared.span,
            uncorrected: false,
            starts: Vec::new(),
        })
        .collect();
    Ok(ModelSpec {
        name: draft.name,
        description: draft.description,
        text: draft.text.to_string(),
        variables,
        expressions,
        equations,
        constants: constants.order,
    })
}

/// Equations and what stands in them.
struct System<'a> {
    text: &'a str,
    names: &'a [&'a str],
    kinds: &'a [VariableKind],
    equations: &'a [DraftEquation],
    incidence: &'a Incidence,
}

impl System<'_> {
    fn unknown(&self, variable: VariableId) -> Unknown {
        match self.kinds[variable.index()] {
            VariableKind::State => Unknown::Derivative(variable),
            _ => Unknown::Value(variable),
        }
    }

    /// What has to be determined of a variable, in the language of the model.
    fn unknown_name(&self, variable: usize) -> String {
        let name = super::error::shortened(self.names[variable]);
        match self.kinds[variable] {
            VariableKind::State => format!("der({name})"),
            _ => name,
        }
    }

    fn line(&self, equation: usize) -> usize {
        super::error::line_of(self.text, self.equations[equation].span.start)
    }
}

/// Which unknowns stand in which equation. A variable has one unknown at most: its derivative or its value.
struct Incidence {
    of_equation: Rows,
    of_variable: Rows,
}

/// Lists of numbers, one after the other.
struct Rows {
    starts: Vec<usize>,
    items: Vec<u32>,
}

impl Rows {
    fn row(&self, index: usize) -> &[u32] {
        &self.items[self.starts[index]..self.starts[index + 1]]
    }

    /// Row `j` of the answer lists the rows that hold `j`.
    fn transposed(&self, count: usize) -> Self {
        let mut starts = vec![0; count + 1];
        for &item in &self.items {
            starts[item as usize + 1] += 1;
        }
        for i in 0..count {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut items = vec![0; self.items.len()];
        for row in 0..self.starts.len() - 1 {
            for &item in self.row(row) {
                items[next[item as usize]] = row as u32;
                next[item as usize] += 1;
            }
        }
        Self { starts, items }
    }
}

impl Incidence {
    fn new(expressions: &Expressions, equations: &[DraftEquation], kinds: &[VariableKind]) -> Self {
        let mut starts = vec![0];
        let mut items = vec![];
        let mut seen_in = vec![usize::MAX; kinds.len()];
        for (number, equation) in equations.iter().enumerate() {
            for index in equation.range() {
                let node = expressions.node(ExpressionId(index as u32));
                let Some(variable) = unknown_of(node, kinds) else {
                    continue;
                };
                if std::mem::replace(&mut seen_in[variable.index()], number) != number {
                    items.push(variable.index() as u32);
                }
            }
            starts.push(items.len());
        }
        let of_equation = Rows { starts, items };
        let of_variable = of_equation.transposed(kinds.len());
        Self {
            of_equation,
            of_variable,
        }
    }
}

/// The variable that a node has to be determined for.
fn unknown_of(node: Node, kinds: &[VariableKind]) -> Option<VariableId> {
    match node {
        Node::Derivative(v) => Some(v),
        Node::Variable(v) if kinds[v.index()] == VariableKind::Algebraic => Some(v),
        _ => None,
    }
}

/// What was found by taking equations with one unknown.
struct Order {
    /// Equations and their unknowns, in the order of computation.
    taken: Vec<(usize, VariableId)>,
    /// For each variable, the equation that determines it.
    by: Vec<Option<u32>>,
    /// True for the equations that were taken.
    used: Vec<bool>,
    /// For each equation, how many of its unknowns no equation determines.
    open: Vec<u32>,
}

fn order(incidence: &Incidence, equations: usize) -> Order {
    let variables = incidence.of_variable.starts.len() - 1;
    let mut answer = Order {
        taken: vec![],
        by: vec![None; variables],
        used: vec![false; equations],
        open: (0..equations)
            .map(|e| incidence.of_equation.row(e).len() as u32)
            .collect(),
    };
    let mut ready: VecDeque<usize> = (0..equations).filter(|&e| answer.open[e] == 1).collect();
    while let Some(equation) = ready.pop_front() {
        let row = incidence.of_equation.row(equation);
        let left = row.iter().find(|&&v| answer.by[v as usize].is_none());
        let Some(&variable) = left else {
            continue;
        };
        answer.by[variable as usize] = Some(equation as u32);
        answer.used[equation] = true;
        answer.taken.push((equation, VariableId(variable)));
        for &other in incidence.of_variable.row(variable as usize) {
            let open = &mut answer.open[other as usize];
            *open -= 1;
            if *open == 1 {
                ready.push_back(other as usize);
            }
        }
    }
    answer
}

/// An equation in the form that [`Equation`] asks for.
fn oriented(
    equation: &DraftEquation,
    turned: bool,
    unknown: Unknown,
    coefficient: Option<ExpressionId>,
    rest: ExpressionId,
) -> Equation {
    let (mut left, mut right) = (equation.left.root, equation.right.root);
    if turned {
        std::mem::swap(&mut left, &mut right);
    }
    Equation {
        left,
        right,
        unknown,
        coefficient,
        rest,
        span: equation.span,
    }
}
