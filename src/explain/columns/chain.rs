//! Equations of outputs as a plant in equations: each output is followed by a chain of states, its derivatives less what
//! inputs and functions add to them.
//!
//! ```text
//! y = x0 + d(s);   der(x0) = x1 + g0(s);   ...   der(x_last) = sum of a * x + g_last(s)        s: inputs, functions, 1
//! ```

use nalgebra::{DMatrix, DVector};

use super::filtered_signals::{Signal, Signals};
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
    /// Number of terms, and of outputs without a state: of equations that do the same those are likelier the simulator's in which each
    /// output is what a store holds.
    pub(crate) fn size(&self) -> usize {
        self.terms.len() + self.orders.iter().filter(|order| **order == 0).count()
    }

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
}
