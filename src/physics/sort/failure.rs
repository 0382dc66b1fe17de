//! Says why the equations of a model do not determine its unknowns one after the other.

use super::{Order, System, unknown_of};
use crate::physics::error::{
    MOST_ERRORS, SpecError, SpecErrorKind, excerpt, joined, listed, plural, position, shortened,
};
use crate::physics::expression::{ExpressionId, Expressions, Node};
use crate::physics::spec::VariableKind;
use crate::physics::syntax::draft::Declaration;
use std::collections::VecDeque;

const NONE: u32 = u32::MAX;

/// How many names or lines a message lists.
const LISTED: usize = 8;

/// The errors: none where every unknown is determined and every equation is needed.
pub(super) fn explain(
    system: &System,
    order: &Order,
    expressions: &Expressions,
    declarations: &[Declaration],
) -> Vec<SpecError> {
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
    let failure = Failure {
        system,
        order,
        expressions,
        declarations,
        counts,
    };
    let surplus = (0..equations).filter(|&e| !order.used[e] && order.open[e] == 0);
    let missing = (0..system.kinds.len())
        .filter(is_unknown)
        .filter(|&v| system.incidence.of_variable.row(v).is_empty());
    let errors: Vec<SpecError> = surplus
        .map(|e| failure.nothing_left(e))
        .chain(missing.map(|v| failure.undetermined(v)))
        .take(MOST_ERRORS)
        .collect();
    if !errors.is_empty() {
        return errors;
    }
    Rest::new(&failure).map_or_else(Vec::new, Rest::explain)
}

/// What is known when the equations do not determine the unknowns one after the other.
struct Failure<'a> {
    system: &'a System<'a>,
    order: &'a Order,
    expressions: &'a Expressions,
    declarations: &'a [Declaration],
    /// "2 equations for 3 unknowns"
    counts: String,
}

impl Failure<'_> {
    fn error(&self, equation: usize, kind: SpecErrorKind) -> SpecError {
        let span = self.system.equations[equation].span;
        SpecError::new(self.system.text, span, kind)
    }

    /// The error for a variable that no equation determines, at its declaration.
    fn undetermined(&self, variable: usize) -> SpecError {
        let declared = &self.declarations[variable];
        let name = shortened(&declared.name);
        let message = if self.system.kinds[variable] == VariableKind::State {
            format!("no equation determines `der({name})`: add one, such as `der({name}) = ...;`")
        } else if declared.start.is_some() {
            format!(
                "`{name}` has a start value but no equation for `der({name})`: add one, such as `der({name}) = ...;`"
            )
        } else if declared.output {
            format!("no equation determines the output `{name}`: add one, such as `{name} = ...;`")
        } else {
            format!(
                "no equation determines `{name}`: add one, such as `{name} = ...;`, or declare `{name}` as an `input` or a \
                 `parameter`"
            )
        };
        let kind = SpecErrorKind::Undetermined(message);
        SpecError::new(self.system.text, declared.span, kind)
    }

    /// The error for an equation whose unknowns are all determined by others.
    fn nothing_left(&self, equation: usize) -> SpecError {
        let (system, order) = (self.system, self.order);
        let by = |v: u32| order.by[v as usize].map(|e| e as usize);
        let counts = &self.counts;
        let message = match system.incidence.of_equation.row(equation) {
            [] => self.no_unknown(equation),
            &[v] => {
                let other = by(v).unwrap_or(equation);
                let start = |e: usize| system.equations[e].span.start;
                let (first, second) = if start(other) < start(equation) {
                    (other, equation)
                } else {
                    (equation, other)
                };
                let (first_line, first_column) = position(system.text, start(first));
                let kind = SpecErrorKind::DeterminedTwice {
                    unknown: system.unknown_name(v as usize),
                    first: excerpt(system.text, system.equations[first].span),
                    first_line,
                    first_column,
                };
                return self.error(second, kind);
            }
            several => {
                let part = |&v: &u32| {
                    let line = system.line(by(v)?);
                    Some(format!(
                        "`{}` by line {line}",
                        system.unknown_name(v as usize)
                    ))
                };
                let parts: Vec<String> = several.iter().take(LISTED).filter_map(part).collect();
                format!(
                    "this equation has nothing left to determine: other equations determine {} ({counts})",
                    joined(&parts, LISTED)
                )
            }
        };
        self.error(equation, SpecErrorKind::Count(message))
    }

    /// What is said about an equation without an unknown.
    fn no_unknown(&self, equation: usize) -> String {
        let whole = self.system.equations[equation];
        let state = |index: usize| match self.expressions.node(ExpressionId(index as u32)) {
            Node::Variable(v) if self.system.kinds[v.index()] == VariableKind::State => {
                Some(v.index())
            }
            _ => None,
        };
        let mut states: Vec<usize> = whole.range().filter_map(state).collect();
        states.sort_unstable();
        states.dedup();
        if let Some(&v) = states
            .iter()
            .find(|&&v| self.declarations[v].span.start == whole.span.start)
        {
            let name = shortened(&self.declarations[v].name);
            let right = excerpt(self.system.text, self.expressions.span(whole.right.root));
            return format!(
                "`{name}` is a state, because `der({name})` is used, and `= {right}` gives it a second equation: a start value \
                 is written `{name}(start={right})`"
            );
        }
        if states.is_empty() {
            return "this equation determines nothing: it has only inputs, parameters and numbers; a parameter that follows from \
                    others is declared with its value, as in `parameter Real b = 2*a;`"
                .into();
        }
        let names: Vec<String> = states
            .iter()
            .map(|&v| self.declarations[v].name.clone())
            .collect();
        let (verb, s) = if names.len() == 1 {
            ("is", "a state")
        } else {
            ("are", "states")
        };
        let advice = if names.len() == 1 {
            "remove it, or the equation for the derivative"
        } else {
            "a relation between states has to be differentiated by hand, and one of them computed from the others"
        };
        format!(
            "this equation determines nothing: {} {verb} {s}, which other equations determine by their derivatives; {advice}",
            listed(&names, LISTED)
        )
    }
}

/// Equations and unknowns that are left when no equation has a single unknown.
struct Rest<'a> {
    failure: &'a Failure<'a>,
    system: &'a System<'a>,
    order: &'a Order,
    equations: Vec<u32>,
    /// For each equation of the model, the variable that is paired with it.
    variable_of: Vec<u32>,
    /// For each variable of the model, the equation that is paired with it.
    equation_of: Vec<u32>,
}

impl<'a> Rest<'a> {
    fn new(failure: &'a Failure<'a>) -> Option<Self> {
        let (system, order) = (failure.system, failure.order);
        let equations: Vec<u32> = (0..system.equations.len() as u32)
            .filter(|&e| !order.used[e as usize])
            .collect();
        let open =
            |v: usize| order.by[v].is_none() && !system.incidence.of_variable.row(v).is_empty();
        if equations.is_empty() && !(0..system.kinds.len()).any(open) {
            return None;
        }
        Some(Self {
            failure,
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

    fn explain(mut self) -> Vec<SpecError> {
        self.pair();
        let counts = &self.failure.counts;
        let mut unpaired = self.equations.iter();
        if let Some(&lonely) = unpaired.find(|&&e| self.variable_of[e as usize] == NONE) {
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
            let error = self
                .failure
                .error(lonely as usize, SpecErrorKind::Count(message));
            return vec![error];
        }
        let missing = self.missing();
        if !missing.is_empty() {
            return missing;
        }
        let members = self.smallest_loop();
        let variables: Vec<u32> = members
            .iter()
            .map(|&e| self.variable_of[e as usize])
            .collect();
        let first = members.iter().copied().min().unwrap_or(0);
        let (variables, lines) = (self.names(&variables), self.lines(&members));
        let kind = SpecErrorKind::AlgebraicLoop { variables, lines };
        vec![self.failure.error(first as usize, kind)]
    }

    /// The errors where there are fewer equations than unknowns.
    fn missing(&self) -> Vec<SpecError> {
        let mut seen = vec![false; self.system.kinds.len()];
        let unpaired = (0..seen.len() as u32).filter(|&v| {
            self.order.by[v as usize].is_none()
                && self.equation_of[v as usize] == NONE
                && !self.system.incidence.of_variable.row(v as usize).is_empty()
        });
        // Whatever an unpaired unknown can take the equation of may be the one that lacks an equation.
        let mut candidates: Vec<u32> = unpaired.collect();
        let lacking = candidates.len();
        for &v in &candidates {
            seen[v as usize] = true;
        }
        let mut at = 0;
        while let Some(&v) = candidates.get(at) {
            at += 1;
            for &e in self.system.incidence.of_variable.row(v as usize) {
                let other = self.variable_of[e as usize];
                if other != NONE && !std::mem::replace(&mut seen[other as usize], true) {
                    candidates.push(other);
                }
            }
        }
        candidates.sort_unstable();
        let on_left = self.alone_on_the_left();
        let without: Vec<u32> = candidates
            .iter()
            .copied()
            .filter(|&v| !on_left[v as usize])
            .collect();
        let with_start: Vec<u32> = without
            .iter()
            .copied()
            .filter(|&v| {
                self.system.kinds[v as usize] == VariableKind::Algebraic
                    && self.failure.declarations[v as usize].start.is_some()
            })
            .collect();
        let found = [without, with_start]
            .into_iter()
            .find(|group| group.len() == lacking);
        match found {
            _ if lacking == 0 => vec![],
            Some(group) => {
                let errors = group.iter().map(|&v| self.failure.undetermined(v as usize));
                errors.take(MOST_ERRORS).collect()
            }
            None => {
                let counts = &self.failure.counts;
                let (s, verb) = (plural(lacking), if lacking == 1 { "is" } else { "are" });
                let message = format!(
                    "{lacking} equation{s} {verb} missing ({counts}): the others do not determine {}",
                    listed(&self.names(&candidates), LISTED)
                );
                let span = self.failure.declarations[candidates[0] as usize].span;
                let kind = SpecErrorKind::Undetermined(message);
                vec![SpecError::new(self.system.text, span, kind)]
            }
        }
    }

    /// For each variable, whether it is the only unknown on the left of an equation, which is how equations are written.
    fn alone_on_the_left(&self) -> Vec<bool> {
        let mut answer = vec![false; self.system.kinds.len()];
        for equation in self.system.equations {
            let unknown = |i: usize| {
                let node = self.failure.expressions.node(ExpressionId(i as u32));
                unknown_of(node, self.system.kinds)
            };
            let mut unknowns = equation.left.range().filter_map(unknown);
            if let Some(first) = unknowns.next()
                && unknowns.all(|v| v == first)
            {
                answer[first.index()] = true;
            }
        }
        answer
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
