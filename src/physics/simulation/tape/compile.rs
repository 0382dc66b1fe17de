//! From equations to a tape: expressions are emitted in order, equal operations once, and sorted by what they depend on.

use std::collections::HashMap;

use pulp::Arch;

use super::straight_pieces::{StraightPieces, straight_pieces};
use super::{
    CurveSlots, DelaySlots, Instruction, Level, MemorySlots, Operation, SwitchSlots, Tape,
};
use crate::physics::expression::{Binary, ExpressionId, Function, Node, VariableId};
use crate::physics::spec::{ModelSpec, Unknown, VariableKind};

/// Collects the tape; see [`Tape::new`].
struct Builder<'a> {
    spec: &'a ModelSpec,
    level: Vec<Level>,
    active: Vec<bool>,
    of_states: Vec<bool>,
    sources: Vec<Option<ExpressionId>>,
    literals: Vec<(u32, f64)>,
    instructions: Vec<(u32, Instruction)>,
    /// Slots of operations on the same operands, which are computed once.
    known: HashMap<(Operation, [u32; 3]), u32>,
    curves: Vec<CurveSlots>,
    switches: Vec<SwitchSlots>,
    delays: Vec<DelaySlots>,
    memories: Vec<(VariableId, u32)>,
    time: u32,
    variable: Vec<u32>,
    derivative: Vec<u32>,
    of_node: Vec<u32>,
}

const NONE: u32 = u32::MAX;

impl Builder<'_> {
    fn slot(
        &mut self,
        level: Level,
        active: bool,
        of_states: bool,
        source: Option<ExpressionId>,
    ) -> u32 {
        self.level.push(level);
        self.active.push(active);
        self.of_states.push(of_states);
        self.sources.push(source);
        (self.level.len() - 1) as u32
    }

    fn emit(
        &mut self,
        operation: Operation,
        operands: [u32; 3],
        source: Option<ExpressionId>,
    ) -> u32 {
        if let Some(&slot) = self.known.get(&(operation, operands)) {
            return slot;
        }
        let used = operands.iter().filter(|&&o| o != NONE);
        let level = used
            .clone()
            .map(|&o| self.level[o as usize])
            .max()
            .unwrap_or(Level::Parameters);
        let active = operands.map(|o| o != NONE && self.active[o as usize]);
        let of_states = used.clone().any(|&o| self.of_states[o as usize]);
        let [a, b, c] = operands.map(|o| if o == NONE { 0 } else { o });
        let slot = self.slot(level, active.contains(&true), of_states, source);
        self.instructions.push((
            slot,
            Instruction {
                operation,
                a,
                b,
                c,
                active,
            },
        ));
        self.known.insert((operation, operands), slot);
        slot
    }

    fn literal(&mut self, value: f64) -> u32 {
        let slot = self.slot(Level::Parameters, false, false, None);
        self.literals.push((slot, value));
        slot
    }

    fn switch(&mut self, a: u32, b: u32) -> u32 {
        let at = |o: u32, of: &[bool]| o != NONE && of[o as usize];
        let moves = |o: u32, level: &[Level]| o != NONE && level[o as usize] == Level::States;
        let operands = (a as usize, (b != NONE).then_some(b as usize));
        if let Some(known) = (self.switches.iter()).position(|s| (s.a, s.b) == operands) {
            return known as u32;
        }
        self.switches.push(SwitchSlots {
            a: operands.0,
            b: operands.1,
            of_states: at(a, &self.of_states) || at(b, &self.of_states),
            moves: moves(a, &self.level) || moves(b, &self.level),
        });
        (self.switches.len() - 1) as u32
    }

    /// Slot of an expression. Operands stand before operators in the arena, so that one pass over the nodes that are used
    /// is enough and no recursion is needed.
    fn expression(&mut self, root: ExpressionId) -> u32 {
        let mut stack = vec![root];
        while let Some(&id) = stack.last() {
            if self.of_node[id.index()] != NONE {
                stack.pop();
                continue;
            }
            let node = self.spec.expressions.node(id);
            let curve = straight_pieces(&self.spec.expressions, id);
            let operands: Vec<ExpressionId> = match &curve {
                Some(curve) => [&curve.rest, &curve.values, &vec![curve.argument]]
                    .into_iter()
                    .flatten()
                    .copied()
                    .collect(),
                None => node.operands().collect(),
            };
            let missing = (operands.into_iter()).filter(|o| self.of_node[o.index()] == NONE);
            let missing: Vec<ExpressionId> = missing.collect();
            if missing.is_empty() {
                self.of_node[id.index()] = match curve {
                    Some(curve) => self.curve(curve, id),
                    None => self.node(id, node),
                };
                stack.pop();
            } else {
                stack.extend(missing);
            }
        }
        self.of_node[root.index()]
    }

    /// A curve of straight pieces, and what it is added to.
    fn curve(&mut self, curve: StraightPieces, id: ExpressionId) -> u32 {
        let argument = self.of_node[curve.argument.index()];
        let values: Vec<u32> = (curve.values.iter())
            .map(|v| self.of_node[v.index()])
            .collect();
        let operation = Operation::Curve(self.curves.len() as u32);
        // Of the values those decide of what the curve depends on that depend on most.
        let of_values = (values.iter().copied())
            .max_by_key(|&v| (self.level[v as usize], self.active[v as usize]));
        let any = |of: &[bool]| values.iter().any(|&v| of[v as usize]);
        let (active, of_states) = (any(&self.active), any(&self.of_states));
        let slot = self.emit(
            operation,
            [argument, of_values.unwrap_or(NONE), NONE],
            Some(id),
        );
        self.active[slot as usize] |= active;
        self.of_states[slot as usize] |= of_states;
        if let Some((_, instruction)) = self.instructions.last_mut() {
            instruction.active[1] = active;
        }
        self.curves.push(CurveSlots {
            knots: curve.knots,
            values,
        });
        curve.rest.iter().fold(slot, |sum, term| {
            let term = self.of_node[term.index()];
            self.emit(Operation::Binary(Binary::Add), [sum, term, NONE], Some(id))
        })
    }

    fn node(&mut self, id: ExpressionId, node: Node) -> u32 {
        let at = |o: ExpressionId, this: &Self| this.of_node[o.index()];
        let source = Some(id);
        match node {
            Node::Number(value) => self.literal(value),
            Node::Time => self.time,
            Node::Variable(v) => self.variable[v.index()],
            Node::Derivative(v) => self.derivative[v.index()],
            Node::Previous(v) => match self.memories.iter().find(|m| m.0 == v) {
                Some(&(_, slot)) => slot,
                None => {
                    let slot = self.slot(Level::Inputs, true, false, source);
                    self.memories.push((v, slot));
                    slot
                }
            },
            Node::Negate(a) => self.emit(Operation::Negate, [at(a, self), NONE, NONE], source),
            Node::Not(a) => self.emit(Operation::Not, [at(a, self), NONE, NONE], source),
            Node::Call(Function::Sign, a) => {
                let a = at(a, self);
                let switch = self.switch(a, NONE);
                self.emit(Operation::Sign(switch), [a, NONE, NONE], source)
            }
            Node::Call(f, a) => self.emit(Operation::Call(f), [at(a, self), NONE, NONE], source),
            Node::Binary(operator, a, b) => {
                let (x, y) = (at(a, self), at(b, self));
                let operation = match operator {
                    Binary::Greater
                    | Binary::GreaterOrEqual
                    | Binary::Less
                    | Binary::LessOrEqual => Operation::Switch {
                        index: self.switch(x, y),
                        less: matches!(operator, Binary::Less | Binary::LessOrEqual),
                        equal: matches!(operator, Binary::LessOrEqual | Binary::GreaterOrEqual),
                    },
                    Binary::Power => match self.spec.expressions.node(b) {
                        Node::Number(n) if n.fract() == 0.0 && n.abs() <= 16.0 => {
                            return self.emit(
                                Operation::PowerInteger(n as i32),
                                [x, NONE, NONE],
                                source,
                            );
                        }
                        _ => Operation::Binary(operator),
                    },
                    _ => Operation::Binary(operator),
                };
                self.emit(operation, [x, y, NONE], source)
            }
            Node::If { condition, yes, no } => self.emit(
                Operation::If,
                [at(condition, self), at(yes, self), at(no, self)],
                source,
            ),
            Node::Delay { value, time } => {
                let (value, time) = (at(value, self), at(time, self));
                let of_inputs = self.level[value as usize] != Level::States;
                let active = self.active[value as usize] || self.active[time as usize];
                let of_states = self.of_states[value as usize];
                let result = self.slot(Level::States, active, of_states, source);
                self.delays.push(DelaySlots {
                    value: value as usize,
                    time: time as usize,
                    result: result as usize,
                    of_inputs,
                });
                result
            }
        }
    }
}

impl Tape {
    /// Compiles the equations of `spec`, in their order.
    pub(crate) fn new(spec: &ModelSpec) -> Self {
        Self::compile(spec, false)
    }

    /// The same with slopes by the inputs too.
    pub(crate) fn with_active_inputs(spec: &ModelSpec) -> Self {
        Self::compile(spec, true)
    }

    fn compile(spec: &ModelSpec, active_inputs: bool) -> Self {
        let count = spec.variables.len();
        let mut build = Builder {
            spec,
            level: Vec::new(),
            active: Vec::new(),
            of_states: Vec::new(),
            sources: Vec::new(),
            literals: Vec::new(),
            instructions: Vec::new(),
            known: HashMap::new(),
            curves: Vec::new(),
            switches: Vec::new(),
            delays: Vec::new(),
            memories: Vec::new(),
            time: 0,
            variable: vec![NONE; count],
            derivative: vec![NONE; count],
            of_node: vec![NONE; spec.expressions.len()],
        };
        // The instants at which a delayed input jumps depend on the delay, which may be estimated.
        let delayed = spec.expressions.any(|n| matches!(n, Node::Delay { .. }));
        build.time = build.slot(Level::States, delayed, false, None);
        for (kind, level) in [
            (VariableKind::State, Level::States),
            (VariableKind::Input, Level::Inputs),
            (VariableKind::Parameter, Level::Parameters),
        ] {
            let of_states = kind == VariableKind::State;
            for v in spec.of_kind(kind) {
                build.variable[v.index()] = build.slot(
                    level,
                    active_inputs || kind != VariableKind::Input,
                    of_states,
                    None,
                );
            }
        }
        for &v in &spec.constants {
            if let (VariableKind::Constant, Some(value)) =
                (spec.variable(v).kind, spec.variable(v).value)
            {
                build.variable[v.index()] = build.expression(value);
            }
        }
        for equation in &spec.equations {
            let rest = build.expression(equation.rest);
            let value = match equation.coefficient {
                Some(c) => {
                    let c = build.expression(c);
                    build.emit(
                        Operation::Binary(Binary::Divide),
                        [rest, c, NONE],
                        Some(equation.right),
                    )
                }
                None => rest,
            };
            match equation.unknown {
                Unknown::Derivative(v) => build.derivative[v.index()] = value,
                Unknown::Value(v) => build.variable[v.index()] = value,
            }
        }
        let zero = build.literal(0.0);
        let memories: Vec<[u32; 3]> = (build.memories.clone().into_iter())
            .map(|(v, previous)| {
                let start = spec.variable(v).start;
                let start = start.map_or(zero, |e| build.expression(e));
                [build.variable[v.index()], previous, start]
            })
            .collect();
        let starts = spec
            .states()
            .iter()
            .map(|&v| spec.variable(v).start.map_or(zero, |e| build.expression(e)))
            .collect();
        let nominal = spec
            .parameters()
            .iter()
            .map(|&v| spec.variable(v).value.map_or(zero, |e| build.expression(e)))
            .collect();
        build.finish(spec, starts, nominal, &memories)
    }
}

impl Builder<'_> {
    /// What no derivative, delay or memory uses is computed at samples only, and its switches need not be resolved between them.
    fn set_outputs_apart(&mut self, spec: &ModelSpec, memories: &[[u32; 3]]) {
        let mut used = vec![false; self.level.len()];
        let derivatives = spec.states().into_iter();
        let derivatives = derivatives.map(|v| self.derivative[v.index()]);
        let delays = (self.delays.iter()).flat_map(|d| [d.value as u32, d.time as u32]);
        let memories = memories.iter().map(|m| m[0]);
        for slot in derivatives.chain(delays).chain(memories) {
            if let Some(used) = used.get_mut(slot as usize) {
                *used = true;
            }
        }
        // Operands stand before what uses them.
        for (slot, x) in self.instructions.iter().rev() {
            if !used[*slot as usize] {
                continue;
            }
            for operand in [x.a, x.b, x.c] {
                used[operand as usize] = true;
            }
            if let Operation::Curve(index) = x.operation {
                for &value in &self.curves[index as usize].values {
                    used[value as usize] = true;
                }
            }
        }
        let mut resolved = vec![false; self.switches.len()];
        for (slot, x) in &self.instructions {
            let slot = *slot as usize;
            match x.operation {
                Operation::Sign(index) | Operation::Switch { index, .. } if used[slot] => {
                    resolved[index as usize] = true;
                }
                _ if !used[slot] && self.level[slot] == Level::States => {
                    self.level[slot] = Level::Outputs;
                }
                _ => {}
            }
        }
        for (switch, resolved) in self.switches.iter_mut().zip(resolved) {
            switch.moves &= resolved;
        }
    }

    /// Renumbers the slots: leaves first, then instructions by level, each level in the order of emission.
    fn finish(
        mut self,
        spec: &ModelSpec,
        starts: Vec<u32>,
        nominal: Vec<u32>,
        memories: &[[u32; 3]],
    ) -> Tape {
        let slots = self.level.len();
        let mut computed = vec![false; slots];
        self.instructions
            .iter()
            .for_each(|&(slot, _)| computed[slot as usize] = true);
        let mut place = vec![0u32; slots];
        let leaves: Vec<usize> = (0..slots).filter(|&s| !computed[s]).collect();
        for (to, &from) in leaves.iter().enumerate() {
            place[from] = to as u32;
        }
        self.set_outputs_apart(spec, memories);
        self.instructions
            .sort_by_key(|(slot, _)| self.level[*slot as usize]);
        for (i, (slot, _)) in self.instructions.iter().enumerate() {
            place[*slot as usize] = (leaves.len() + i) as u32;
        }
        let count = |level| {
            self.instructions
                .iter()
                .filter(|(s, _)| self.level[*s as usize] <= level)
                .count()
        };
        let bounds = [Level::Parameters, Level::Inputs, Level::States].map(count);
        let mut sources = vec![None; slots];
        (0..slots).for_each(|s| sources[place[s] as usize] = self.sources[s]);
        let to = |s: u32| place[s as usize];
        let at = |s: u32| to(s) as usize;
        let of = |ids: Vec<VariableId>, from: &[u32]| {
            ids.iter().map(|v| at(from[v.index()])).collect::<Vec<_>>()
        };
        Tape {
            instructions: self
                .instructions
                .iter()
                .map(|&(_, x)| Instruction {
                    a: to(x.a),
                    b: to(x.b),
                    c: to(x.c),
                    ..x
                })
                .collect(),
            curves: (self.curves.into_iter())
                .map(|c| CurveSlots {
                    values: c.values.into_iter().map(to).collect(),
                    ..c
                })
                .collect(),
            arch: Arch::new(),
            sources,
            bounds,
            leaves: leaves.len(),
            literals: self.literals.iter().map(|&(s, v)| (to(s), v)).collect(),
            time: at(self.time),
            states: of(spec.states(), &self.variable),
            inputs: of(spec.inputs(), &self.variable),
            parameters: of(spec.parameters(), &self.variable),
            derivatives: of(spec.states(), &self.derivative),
            outputs: of(spec.outputs(), &self.variable),
            starts: starts.into_iter().map(at).collect(),
            nominal: nominal.into_iter().map(at).collect(),
            variables: self
                .variable
                .iter()
                .map(|&s| if s == NONE { usize::MAX } else { at(s) })
                .collect(),
            delays: self
                .delays
                .iter()
                .map(|d| DelaySlots {
                    value: at(d.value as u32),
                    time: at(d.time as u32),
                    result: at(d.result as u32),
                    of_inputs: d.of_inputs,
                })
                .collect(),
            memories: memories
                .iter()
                .map(|&[value, previous, start]| MemorySlots {
                    value: at(value),
                    previous: at(previous),
                    start: at(start),
                })
                .collect(),
            switches: self
                .switches
                .iter()
                .map(|s| SwitchSlots {
                    a: at(s.a as u32),
                    b: s.b.map(|b| at(b as u32)),
                    ..*s
                })
                .collect(),
        }
    }
}
