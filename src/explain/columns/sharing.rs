//! One strength for what several equations share, so that a change of it is one of one parameter: what two outputs exchange, and
//! functions in several equations. The equations are the same, written with other parameters.

use super::chain::{Chains, Of, Row};
use super::column::Column;
use super::filtered_signals::{Signal, Signals};

/// What is left of the coefficient of a state beside what it exchanges is zero below this part of that. Where it is not, the fit of the
/// equations without it shows it.
const ALL_EXCHANGED: f64 = 0.02;

/// A strength that several equations share: of a function in each of them, or of what two outputs exchange.
#[derive(Debug, Clone)]
pub(super) struct Shared {
    /// The term whose coefficient is the strength, and those whose coefficients are in proportion to it.
    pub(super) first: usize,
    pub(super) others: Vec<usize>,
    /// The states whose difference it is of; none for a function.
    pub(super) between: Option<[Of; 2]>,
}

/// Values of the coefficients where equations share strengths; what is zero is left out.
#[derive(Debug, Clone)]
pub(super) struct Sharing {
    pub(super) shared: Vec<Shared>,
    pub(super) values: Vec<f64>,
}

impl Chains {
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

    /// What outputs exchange, with its names.
    pub(super) fn exchanges<'a>(
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
}
