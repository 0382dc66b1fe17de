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

/// What is left of the coefficient of a state beside what it exchanges is zero below this part of that. Where it is not, the fit of the
/// equations without it shows it.
const ALL_EXCHANGED: f64 = 0.02;

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

/// A strength that several equations share: of a function in each of them, or of what two outputs exchange.
#[derive(Debug, Clone)]
struct Shared {
    /// The term whose coefficient is the strength, and those whose coefficients are in proportion to it.
    first: usize,
    others: Vec<usize>,
    /// The states whose difference it is of; none for a function.
    between: Option<[Of; 2]>,
}

/// Values of the coefficients where equations share strengths; what is zero is left out.
#[derive(Debug, Clone)]
pub(super) struct Sharing {
    shared: Vec<Shared>,
    pub(super) values: Vec<f64>,
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

    /// What the equations share: heat or a force between two outputs, which each of them has with the other's state; and functions that
    /// enter several equations. With one strength for all of them, a change of it is one of one parameter. None where nothing is shared.
    pub(super) fn sharing(&self, signals: &Signals) -> Option<Sharing> {
        let mut values: Vec<f64> = self.terms.iter().map(|t| t.value).collect();
        let mut shared = Vec::new();
        let at = |row: Row, of: Of| self.terms.iter().position(|t| t.row == row && t.of == of);
        let mut exchanged = vec![0.0; values.len()];
        for (i, &order) in self.orders.iter().enumerate() {
            for (j, &other) in self.orders.iter().enumerate().skip(i + 1) {
                for k in 0..order.min(other) {
                    let rows = [Row::State(i, order - 1), Row::State(j, other - 1)];
                    let states = [Of::State(i, k), Of::State(j, k)];
                    let (Some(first), Some(second)) =
                        (at(rows[0], states[1]), at(rows[1], states[0]))
                    else {
                        continue;
                    };
                    let own = [at(rows[0], states[0]), at(rows[1], states[1])];
                    let given = [values[first], values[second]];
                    let both = own.into_iter().zip(given);
                    let passes_on = |(own, given): (Option<usize>, f64)| {
                        let most = (1.0 + ALL_EXCHANGED) * own.map_or(0.0, |o| -values[o]);
                        given > 0.0 && given <= most
                    };
                    if !both.clone().all(passes_on) {
                        continue;
                    }
                    for (own, given) in both {
                        if let Some(own) = own {
                            exchanged[own] += given;
                        }
                    }
                    values[second] = -given[1] / given[0];
                    shared.push(Shared {
                        first,
                        others: vec![second],
                        between: Some([states[1], states[0]]),
                    });
                }
            }
        }
        for (value, exchanged) in values.iter_mut().zip(&exchanged) {
            *value += exchanged;
            if value.abs() <= ALL_EXCHANGED * exchanged {
                *value = 0.0;
            }
        }
        for s in 0..signals.all.len() {
            let mut terms = (0..self.terms.len()).filter(|&i| self.terms[i].of == Of::Signal(s));
            let is_function = matches!(signals.all[s], Signal::Function(..));
            let Some(first) = terms.next().filter(|_| is_function) else {
                continue;
            };
            let others: Vec<usize> = terms.collect();
            others.iter().for_each(|&i| values[i] /= values[first]);
            if !others.is_empty() {
                shared.push(Shared {
                    first,
                    others,
                    between: None,
                });
            }
        }
        (!shared.is_empty()).then_some(Sharing { shared, values })
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

    /// What outputs exchange, with its names.
    fn exchanges<'a>(
        &self,
        sharing: Option<&'a Sharing>,
        inputs: &[Column],
        outputs: &[Column],
    ) -> Vec<(&'a Shared, String)> {
        let taken = |name: &String| inputs.iter().chain(outputs).any(|c| c.0.name == *name);
        let names = (1..).map(|n| format!("exchange{n}")).filter(|n| !taken(n));
        let all = sharing.into_iter().flat_map(|s| &s.shared);
        all.filter(|s| s.between.is_some()).zip(names).collect()
    }

    /// The same as a text, with a parameter for each coefficient.
    pub(crate) fn text(
        &self,
        signals: &Signals,
        inputs: &[Column],
        outputs: &[Column],
        start: &[Vec<f64>],
        sharing: Option<&Sharing>,
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
        let exchanges = self.exchanges(sharing, inputs, outputs);
        let value = |i: usize| sharing.map_or(self.terms[i].value, |s| s.values[i]);
        let used = || (0..self.terms.len()).filter(|&i| value(i) != 0.0);
        let is_strength = |i: usize| {
            let mut shared = sharing.iter().flat_map(|s| &s.shared);
            shared.any(|s| s.first == i)
        };
        let exchange = |i: usize| {
            let mut all = exchanges.iter();
            all.find(|(of, _)| of.first == i || of.others.contains(&i))
                .map(|(_, name)| name.clone())
        };
        let written_term = |i: usize| match exchange(i).or_else(|| factor(&self.terms[i].of)) {
            Some(factor) if is_strength(i) => factor,
            Some(factor) => format!("c{}*{factor}", i + 1),
            None => format!("c{}", i + 1),
        };
        let sum = |row: Row| -> String {
            let own = used().filter(|&i| self.terms[i].row == row);
            own.map(written_term).collect::<Vec<_>>().join(" + ")
        };
        let strength = |s: usize| {
            let mut functions = sharing.iter().flat_map(|s| &s.shared);
            let of = |i: usize| self.terms[i].of == Of::Signal(s);
            let shared = functions.find(|f| f.between.is_none() && of(f.first));
            shared.map_or_else(String::new, |f| format!("c{}*", f.first + 1))
        };
        let join = |first: Option<String>, rest: String| match (first, rest.is_empty()) {
            (Some(first), true) => first,
            (Some(first), false) => format!("{first} + {rest}"),
            (None, true) => "0".to_owned(),
            (None, false) => rest,
        };
        let mut text =
            String::from("model Simulation \"equations that reproduce the simulated outputs\"\n");
        for i in used() {
            let term = &self.terms[i];
            let of = || factor(&term.of).unwrap_or_else(|| "constant".to_owned());
            let row = || match term.row {
                Row::Output(j) => outputs[j].name(),
                Row::State(j, k) => format!("der({})", state(j, k)),
            };
            let what = match (is_strength(i), exchange(i)) {
                (true, Some(name)) => format!("strength of {name}"),
                (true, None) => format!("strength of {}", of()),
                (false, Some(name)) => format!("of {name} in {}", row()),
                (false, None) => format!("of {} in {}", of(), row()),
            };
            text += &format!("  parameter Real c{} = {:e} \"{what}\";\n", i + 1, value(i));
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
        let exchanged = exchanges.iter().map(|(_, name)| name);
        for name in common.iter().map(|(_, name)| name).chain(exchanged) {
            text += &format!("  Real {name};\n");
        }
        text += "equation\n";
        for (s, name) in &common {
            if let Signal::Function(form, parts) = &signals.all[*s] {
                let arguments: Vec<String> = parts.iter().map(argument).collect();
                let strength = strength(*s);
                text += &format!("  {name} = {strength}{};\n", written(*form, &arguments));
            }
        }
        for (shared, name) in &exchanges {
            if let Some([more, less]) = shared.between {
                let (more, less) = (factor(&more), factor(&less));
                let (more, less) = (more.unwrap_or_default(), less.unwrap_or_default());
                let strength = shared.first + 1;
                text += &format!("  {name} = c{strength}*({more} - {less});\n");
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
