//! Says why the equations of a model do not determine its unknowns one after the other.

use super::{Order, System};
use crate::physics::error::{SpecError, SpecErrorKind, joined, listed, plural};
use crate::physics::spec::VariableKind;
use crate::physics::syntax::draft::Declaration;
use std::collections::VecDeque;

const NONE: u32 = u32::MAX;

/// How many names or lines a message lists.
const LISTED: usize = 8;

/// The error, unless every unknown is determined and every equation is needed.
pub(super) fn explain(
    system: &System,
    order: &Order,
    declarations: &[Declaration],
) -> Option<SpecError> {
    let is_unknown = |v: &usize| {
        matches!(
            system.kinds[*v],
            VariableKind::State | VariableKind::Algebraic
        )
    };
    let unknowns = (0..system.kinds.len()).filter(is_unknown).count();
    let equations = system.equations.len();
    let counts = format!(
        "{equations} equation{} for {unknowns} unknown{}",
        plural(equations),
        plural(unknowns)
    );
    if let Some(surplus) = (0..equations).find(|&e| !order.used[e] && order.open[e] == 0) {
        return Some(nothing_left(system, order, surplus, &counts));
    }
    let missing = (0..system.kinds.len())
        .filter(is_unknown)
        .filter(|&v| system.incidence.of_variable.row(v).is_empty());
    let missing: Vec<usize> = missing.collect();
    if let Some(&first) = missing.first() {
        let names: Vec<String> = missing
            .iter()
            .map(|&v| system.names[v].to_string())
            .collect();
        let verb = if names.len() == 1 { "is" } else { "are" };
        let message = format!(
            "{} {verb} in no equation: {counts}; give it an equation, or make it an input or a parameter",
            listed(&names, LISTED)
        );
        let kind = SpecErrorKind::Count(message);
        return Some(SpecError::new(system.text, declarations[first].span, kind));
    }
    let rest = Rest::new(system, order)?;
    Some(rest.explain(&counts))
}

/// The error for an equation whose unknowns are all determined by others.
fn nothing_left(system: &System, order: &Order, equation: usize, counts: &str) -> SpecError {
    let row = system.incidence.of_equation.row(equation);
    let by = |v: u32| order.by[v as usize].map(|e| system.line(e as usize));
    let here = system.line(equation);
    let message = match row {
        [] => "this equation determines nothing: it has only states, inputs, parameters and numbers; a relation between \
               states has to be differentiated by hand"
            .to_string(),
        &[v] => format!(
            "`{}` is determined twice: in line {} and in line {here} ({counts})",
            system.unknown_name(v as usize),
            by(v).unwrap_or(here)
        ),
        several => {
            let parts: Vec<String> = several
                .iter()
                .take(LISTED)
                .filter_map(|&v| Some(format!("`{}` by line {}", system.unknown_name(v as usize), by(v)?)))
                .collect();
            format!(
                "this equation has nothing left to determine: other equations determine {} ({counts})",
                joined(&parts, LISTED)
            )
        }
    };
    let span = system.equations[equation].span;
    SpecError::new(system.text, span, SpecErrorKind::Count(message))
}

/// Equations and unknowns that are left when no equation has a single unknown.
struct Rest<'a> {
    system: &'a System<'a>,
    order: &'a Order,
    equations: Vec<u32>,
    /// For each equation of the model, the variable that is paired with it.
    variable_of: Vec<u32>,
    /// For each variable of the model, the equation that is paired with it.
    equation_of: Vec<u32>,
}

impl<'a> Rest<'a> {
    fn new(system: &'a System<'a>, order: &'a Order) -> Option<Self> {
        let equations: Vec<u32> = (0..system.equations.len() as u32)
            .filter(|&e| !order.used[e as usize])
            .collect();
        let open =
            |v: usize| order.by[v].is_none() && !system.incidence.of_variable.row(v).is_empty();
        if equations.is_empty() && !(0..system.kinds.len()).any(open) {
            return None;
        }
        Some(Self {
            system,
            order,
            variable_of: vec![NONE; system.equations.len()],
            equation_of: vec![NONE; system.kinds.len()],
            equations,
        })
    }

    /// Unknowns of an equation that no other equation determines.
    fn unknowns(&self, equation: u32) -> impl Iterator<Item = u32> + '_ {
        let row = self.system.incidence.of_equation.row(equation as usize);
        row.iter()
            .copied()
            .filter(|&v| self.order.by[v as usize].is_none())
    }

    fn explain(mut self, counts: &str) -> SpecError {
        self.pair();
        if let Some(&lonely) = self
            .equations
            .iter()
            .find(|&&e| self.variable_of[e as usize] == NONE)
        {
            let members = self.reached_from(lonely);
            let variables: Vec<u32> = members
                .iter()
                .map(|&e| self.variable_of[e as usize])
                .filter(|&v| v != NONE)
                .collect();
            let message = format!(
                "{} equations (lines {}) for {} unknown{}: {} ({counts} in all)",
                members.len(),
                joined(&self.lines(&members), LISTED),
                variables.len(),
                plural(variables.len()),
                listed(&self.names(&variables), LISTED),
            );
            return self.error(lonely, SpecErrorKind::Count(message));
        }
        let open =
            |v: &u32| self.order.by[*v as usize].is_none() && self.equation_of[*v as usize] == NONE;
        let mut left = self
            .equations
            .iter()
            .flat_map(|&e| self.unknowns(e).map(move |v| (e, v)));
        if let Some((equation, _)) = left.find(|(_, v)| open(v)) {
            let mut all: Vec<u32> = self
                .equations
                .iter()
                .flat_map(|&e| self.unknowns(e))
                .collect();
            all.sort_unstable();
            all.dedup();
            let message = format!(
                "too few equations: {counts}; the equations that are left do not determine {}",
                listed(&self.names(&all), LISTED)
            );
            return self.error(equation, SpecErrorKind::Count(message));
        }
        let members = self.smallest_loop();
        let variables: Vec<u32> = members
            .iter()
            .map(|&e| self.variable_of[e as usize])
            .collect();
        let first = members.iter().copied().min().unwrap_or(0);
        let (variables, lines) = (self.names(&variables), self.lines(&members));
        self.error(first, SpecErrorKind::AlgebraicLoop { variables, lines })
    }

    fn names(&self, variables: &[u32]) -> Vec<String> {
        variables
            .iter()
            .map(|&v| self.system.unknown_name(v as usize))
            .collect()
    }

    fn lines(&self, equations: &[u32]) -> Vec<usize> {
        let breaks = self
            .system
            .text
            .bytes()
            .enumerate()
            .filter(|b| b.1 == b'\n');
        let breaks: Vec<usize> = breaks.map(|b| b.0).collect();
        let start = |e: u32| self.system.equations[e as usize].span.start;
        let mut lines: Vec<usize> = equations
            .iter()
            .map(|&e| breaks.partition_point(|&b| b < start(e)) + 1)
            .collect();
        lines.sort_unstable();
        lines.dedup();
        lines
    }

    fn error(&self, equation: u32, kind: SpecErrorKind) -> SpecError {
        let span = self.system.equations[equation as usize].span;
        SpecError::new(self.system.text, span, kind)
    }

    /// Pairs equations with unknowns, as many as possible, by the method of Hopcroft and Karp.
    fn pair(&mut self) {
        let count = self.system.equations.len();
        loop {
            let mut level = vec![NONE; count];
            let mut queue: VecDeque<u32> = VecDeque::new();
            for &e in &self.equations {
                if self.variable_of[e as usize] == NONE {
                    level[e as usize] = 0;
                    queue.push_back(e);
                }
            }
            let mut free_found = false;
            while let Some(e) = queue.pop_front() {
                for v in self.unknowns(e) {
                    match self.equation_of[v as usize] {
                        NONE => free_found = true,
                        other if level[other as usize] == NONE => {
                            level[other as usize] = level[e as usize] + 1;
                            queue.push_back(other);
                        }
                        _ => {}
                    }
                }
            }
            if !free_found {
                return;
            }
            let mut next = vec![0usize; count];
            for root in self.equations.clone() {
                if self.variable_of[root as usize] == NONE {
                    self.augment(root, &mut level, &mut next);
                }
            }
        }
    }

    /// Looks for a path from an unpaired equation to an unpaired unknown, and turns the pairs along it.
    fn augment(&mut self, root: u32, level: &mut [u32], next: &mut [usize]) {
        let mut path: Vec<(u32, u32)> = vec![(root, NONE)];
        while let Some(last) = path.last_mut() {
            let equation = last.0;
            let row = self.system.incidence.of_equation.row(equation as usize);
            let position = next[equation as usize];
            let Some(&variable) = row.get(position) else {
                level[equation as usize] = NONE;
                path.pop();
                continue;
            };
            next[equation as usize] = position + 1;
            if self.order.by[variable as usize].is_some() {
                continue;
            }
            let other = self.equation_of[variable as usize];
            if other == NONE {
                last.1 = variable;
                for &(e, v) in &path {
                    self.variable_of[e as usize] = v;
                    self.equation_of[v as usize] = e;
                }
                return;
            }
            let (there, here) = (level[other as usize], level[equation as usize]);
            if here != NONE && there == here + 1 {
                last.1 = variable;
                path.push((other, NONE));
            }
        }
    }

    /// The equation itself, and those that are paired with unknowns of equations that are reached.
    fn reached_from(&self, start: u32) -> Vec<u32> {
        let mut seen = vec![false; self.system.equations.len()];
        seen[start as usize] = true;
        let mut answer = vec![start];
        let mut at = 0;
        while let Some(&e) = answer.get(at) {
            at += 1;
            for other in self.successors(e) {
                if !std::mem::replace(&mut seen[other as usize], true) {
                    answer.push(other);
                }
            }
        }
        answer
    }

    /// Equations that determine what an equation needs.
    fn successors(&self, equation: u32) -> impl Iterator<Item = u32> + '_ {
        self.unknowns(equation)
            .map(|v| self.equation_of[v as usize])
            .filter(move |&e| e != NONE && e != equation)
    }

    /// The shortest loop in the smallest set of equations that all need each other.
    fn smallest_loop(&self) -> Vec<u32> {
        const STARTS: usize = 64;
        let group = self.smallest_group();
        let mut inside = vec![false; self.system.equations.len()];
        for &e in &group {
            inside[e as usize] = true;
        }
        let mut best: Option<Vec<u32>> = None;
        for &start in group.iter().take(STARTS) {
            if let Some(found) = self.shortest_loop(start, &inside)
                && best.as_ref().is_none_or(|b| found.len() < b.len())
            {
                best = Some(found);
            }
        }
        best.unwrap_or(group)
    }

    fn shortest_loop(&self, start: u32, inside: &[bool]) -> Option<Vec<u32>> {
        let mut from = vec![NONE; inside.len()];
        let mut queue = VecDeque::from([start]);
        while let Some(e) = queue.pop_front() {
            for other in self.successors(e).filter(|&o| inside[o as usize]) {
                if other == start {
                    let mut path = vec![e];
                    while let Some(&last) = path.last().filter(|&&l| l != start) {
                        path.push(from[last as usize]);
                    }
                    path.reverse();
                    return Some(path);
                }
                if from[other as usize] == NONE {
                    from[other as usize] = e;
                    queue.push_back(other);
                }
            }
        }
        None
    }

    /// The smallest strongly connected component of at least two equations, by Tarjan's method without recursion.
    fn smallest_group(&self) -> Vec<u32> {
        let count = self.system.equations.len();
        let (mut index, mut low) = (vec![NONE; count], vec![NONE; count]);
        let mut on_stack = vec![false; count];
        let mut stack: Vec<u32> = vec![];
        let mut counter = 0;
        let mut best: Option<Vec<u32>> = None;
        for &root in &self.equations {
            if index[root as usize] != NONE {
                continue;
            }
            let mut calls = vec![(root, self.successors(root))];
            index[root as usize] = counter;
            low[root as usize] = counter;
            counter += 1;
            stack.push(root);
            on_stack[root as usize] = true;
            while let Some((e, successors)) = calls.last_mut() {
                let e = *e;
                if let Some(other) = successors.next() {
                    if index[other as usize] == NONE {
                        index[other as usize] = counter;
                        low[other as usize] = counter;
                        counter += 1;
                        stack.push(other);
                        on_stack[other as usize] = true;
                        calls.push((other, self.successors(other)));
                    } else if on_stack[other as usize] {
                        low[e as usize] = low[e as usize].min(index[other as usize]);
                    }
                    continue;
                }
                calls.pop();
                if let Some((parent, _)) = calls.last() {
                    low[*parent as usize] = low[*parent as usize].min(low[e as usize]);
                }
                if low[e as usize] != index[e as usize] {
                    continue;
                }
                let mut group = vec![];
                while let Some(member) = stack.pop() {
                    on_stack[member as usize] = false;
                    group.push(member);
                    if member == e {
                        break;
                    }
                }
                if group.len() > 1 && best.as_ref().is_none_or(|b| group.len() < b.len()) {
                    best = Some(group);
                }
            }
        }
        best.unwrap_or_else(|| self.equations.clone())
    }
}
