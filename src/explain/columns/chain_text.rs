//! Chains of states as a text, with a parameter for each coefficient.

use super::chain::{Chains, Of, Row};
use super::column::Column;
use super::filtered_signals::{Part, Signal, Signals, written};
use super::sharing::Sharing;

impl Chains {
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
