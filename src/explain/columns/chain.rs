//! Equations of outputs as a plant in equations: each output is followed by a chain of states, its derivatives less what
//! inputs and functions add to them.
//!
//! ```text
//! y = x0 + d(s);   der(x0) = x1 + g0(s);   ...   der(x_last) = sum of a * x + g_last(s)        s: inputs, functions, 1
//! ```

use nalgebra::{DMatrix, DVector};

use super::column::Column;
use super::filtered_signals::{Part, Signal, Signals, written};
use super::regression::OutputEquation;

/// A coefficient below this part of the largest of its signal is rounding.
const ROUNDING: f64 = 1e-12;

/// Where a term stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Row {
    /// What an output is beside its state.
    Output(usize),
    /// Derivative of a state: output, place in its chain.
    State(usize, usize),
}

/// What a term is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Of {
    /// A state: output, place in its chain.
    State(usize, usize),
    Signal(usize),
}

/// A coefficient of a plant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Term {
    pub(super) row: Row,
    pub(super) of: Of,
    pub(super) value: f64,
}

/// A plant whose states are the outputs and their derivatives.
#[derive(Debug, Clone)]
pub(super) struct Chains {
    pub(super) orders: Vec<usize>,
    pub(super) terms: Vec<Term>,
}

/// Place of a coefficient of the derivative `power` of a signal in the equation of order `order`: 0 beside the output, `l + 1`
/// in the derivative of state `l`.
fn slot(order: usize, power: usize) -> Option<usize> {
    (power <= order).then(|| order - power)
}

impl Chains {
    /// States for the equations of all outputs. A signal enters the chain of an output once for each of its derivatives, and
    /// through the chains of the others.
    pub(crate) fn new(signals: &Signals, equations: &[OutputEquation]) -> Option<Self> {
        let orders: Vec<usize> = equations.iter().map(|e| e.order).collect();
        let first: Vec<usize> = orders
            .iter()
            .scan(0, |sum, n| {
                let at = *sum;
                *sum += n + 1;
                Some(at)
            })
            .collect();
        let size: usize = orders.iter().map(|n| n + 1).sum();
        // Coefficient of D^p of a signal in D^k of an output: what stands beside it at p = k, what enters state k - 1 - p.
        let mut matrix = DMatrix::<f64>::identity(size, size);
        let mut terms = Vec::new();
        for (i, equation) in equations.iter().enumerate() {
            let row = match orders[i] {
                0 => Row::Output(i),
                n => Row::State(i, n - 1),
            };
            for &(s, k, a) in &equation.terms {
                let Signal::Output(j) = signals.all[s] else {
                    continue;
                };
                terms.push(Term {
                    row,
                    of: Of::State(j, k),
                    value: a,
                });
                for power in 0..=orders[i].min(k) {
                    let to = first[i] + slot(orders[i], power)?;
                    matrix[(to, first[j] + k - power)] -= a;
                }
            }
        }
        let inverse = matrix.lu();
        for (s, signal) in signals.all.iter().enumerate() {
            if matches!(signal, Signal::Output(_)) {
                continue;
            }
            let mut right = DVector::<f64>::zeros(size);
            for (i, equation) in equations.iter().enumerate() {
                for &(_, power, b) in equation.terms.iter().filter(|t| t.0 == s) {
                    right[first[i] + slot(orders[i], power)?] += b;
                }
            }
            if right.iter().all(|v| *v == 0.0) {
                continue;
            }
            let entering = inverse.solve(&right)?;
            for i in 0..orders.len() {
                for place in 0..=orders[i] {
                    let row = match place {
                        0 => Row::Output(i),
                        l => Row::State(i, l - 1),
                    };
                    let value = entering[first[i] + place];
                    // No equation holds the highest derivative of a function: what is there is rounding.
                    let rounding =
                        place == 0 && orders[i] > 0 && !matches!(signal, Signal::Input(_));
                    if value.abs() > ROUNDING * entering.amax() && !rounding {
                        terms.push(Term {
                            row,
                            of: Of::Signal(s),
                            value,
                        });
                    }
                }
            }
        }
        terms
            .iter()
            .all(|t| t.value.is_finite())
            .then_some(Self { orders, terms })
    }

    /// Functions that enter several equations, such as a force between two bodies, are variables of their own, which something
    /// else may enter with them; with their names.
    fn common(
        &self,
        signals: &Signals,
        inputs: &[Column],
        outputs: &[Column],
    ) -> Vec<(usize, String)> {
        let used = |s: usize| self.terms.iter().filter(|t| t.of == Of::Signal(s)).count();
        let several = (0..signals.all.len())
            .filter(|&s| matches!(signals.all[s], Signal::Function(..)) && used(s) > 1);
        let taken = |name: &String| inputs.iter().chain(outputs).any(|c| c.0.name == *name);
        let names = (1..).map(|n| format!("common{n}")).filter(|n| !taken(n));
        several.zip(names).collect()
    }

    /// The same as a text, with a parameter for each coefficient.
    pub(crate) fn text(
        &self,
        signals: &Signals,
        inputs: &[Column],
        outputs: &[Column],
        start: &[Vec<f64>],
    ) -> String {
        let state = |j: usize, k: usize| outputs[j].state(k);
        let has = |row: Row| self.terms.iter().any(|t| t.row == row);
        // What a sensor shows is a variable of its own, so that an error of the sensor stays outside.
        let argument = |part: &Part| match part {
            Part::Output(j) if has(Row::Output(*j)) => outputs[*j].suffixed("_signal"),
            Part::Output(j) => state(*j, 0),
            Part::Rate(j) if has(Row::State(*j, 0)) => outputs[*j].suffixed("_slope"),
            Part::Rate(j) => state(*j, 1),
            Part::Input(m) => inputs[*m].name(),
        };
        let uses = |wanted: Part| {
            self.terms.iter().any(|t| {
                matches!(t.of, Of::Signal(s) if matches!(&signals.all[s],
                    Signal::Function(_, parts) if parts.contains(&wanted)))
            })
        };
        let slope = |j: usize| {
            (uses(Part::Rate(j)) && has(Row::State(j, 0))).then(|| argument(&Part::Rate(j)))
        };
        let signal = |j: usize| {
            (uses(Part::Output(j)) && has(Row::Output(j))).then(|| argument(&Part::Output(j)))
        };
        let common = self.common(signals, inputs, outputs);
        let factor =
            |of: &Of| -> Option<String> {
                match of {
                    Of::State(j, k) => Some(state(*j, *k)),
                    Of::Signal(s) => match &signals.all[*s] {
                        Signal::Output(j) => Some(outputs[*j].name()),
                        Signal::Input(m) => Some(inputs[*m].name()),
                        Signal::One => None,
                        Signal::Function(form, parts) => {
                            let named = common.iter().find(|(of, _)| of == s);
                            let arguments: Vec<String> = parts.iter().map(argument).collect();
                            Some(named.map_or_else(
                                || written(*form, &arguments),
                                |(_, name)| name.clone(),
                            ))
                        }
                    },
                }
            };
        let sum = |row: Row| -> String {
            let own = self.terms.iter().enumerate().filter(|(_, t)| t.row == row);
            let each = own.map(|(i, t)| match factor(&t.of) {
                Some(factor) => format!("c{}*{factor}", i + 1),
                None => format!("c{}", i + 1),
            });
            each.collect::<Vec<_>>().join(" + ")
        };
        let join = |first: Option<String>, rest: String| match (first, rest.is_empty()) {
            (Some(first), true) => first,
            (Some(first), false) => format!("{first} + {rest}"),
            (None, true) => "0".to_owned(),
            (None, false) => rest,
        };
        let mut text =
            String::from("model Simulation \"equations that reproduce the simulated outputs\"\n");
        for (i, term) in self.terms.iter().enumerate() {
            let of = factor(&term.of).unwrap_or_else(|| "constant".to_owned());
            let row = match term.row {
                Row::Output(j) => outputs[j].name(),
                Row::State(j, k) => format!("der({})", state(j, k)),
            };
            text += &format!(
                "  parameter Real c{} = {:e} \"of {of} in {row}\";\n",
                i + 1,
                term.value
            );
        }
        for input in inputs {
            text += &format!("  input Real {}{};\n", input.name(), input.unit());
        }
        for output in outputs {
            text += &format!("  output Real {}{};\n", output.name(), output.unit());
        }
        for (j, values) in start.iter().enumerate() {
            for (k, value) in values.iter().enumerate() {
                let unit = outputs[j].unit_of_state(k);
                text += &format!("  Real {}(start={value:e}{unit});\n", state(j, k));
            }
        }
        let all = || 0..self.orders.len();
        for name in all().flat_map(|j| slope(j).into_iter().chain(signal(j))) {
            text += &format!("  Real {name};\n");
        }
        for (_, name) in &common {
            text += &format!("  Real {name};\n");
        }
        text += "equation\n";
        for (s, name) in &common {
            if let Signal::Function(form, parts) = &signals.all[*s] {
                let arguments: Vec<String> = parts.iter().map(argument).collect();
                text += &format!("  {name} = {};\n", written(*form, &arguments));
            }
        }
        for (j, &order) in self.orders.iter().enumerate() {
            for k in 0..order {
                let next = (k + 1 < order).then(|| state(j, k + 1));
                let mut right = join(next, sum(Row::State(j, k)));
                if let Some(slope) = (k == 0).then(|| slope(j)).flatten() {
                    text += &format!("  {slope} = {right};\n");
                    right = slope;
                }
                text += &format!("  der({}) = {right};\n", state(j, k));
            }
            let own = (order > 0).then(|| state(j, 0));
            let mut right = join(own, sum(Row::Output(j)));
            if let Some(signal) = signal(j) {
                text += &format!("  {signal} = {right};\n");
                right = signal;
            }
            text += &format!("  {} = {right};\n", outputs[j].name());
        }
        text + "end Simulation;\n"
    }
}
