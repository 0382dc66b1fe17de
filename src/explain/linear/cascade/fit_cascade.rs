//! Numbers of a cascade from recordings: Levenberg and Marquardt on the simulation error.
//!
//! Derivatives are carried through the simulation ([`Jet`]), so they are exact also where a rim acts. Everything
//! here is in units of the mean output and the mean size of the input: a recording in other units takes the same path.

use nalgebra::{DMatrix, DVector};

use super::jet::{Jet, SLOTS};
use super::{Cascade, NUMBERS, Number};

/// Largest change of a logarithm in a step.
const LONGEST_STEP: f64 = 2.0;
/// Steps that lower the cost by less than this share have arrived: 1e-6 of 1000 samples is 1e-3 in `-2 log` likelihood.
const SETTLED: f64 = 1e-6;

/// Recordings in units of their size, and which samples count.
#[derive(Debug, Clone)]
pub(super) struct Problem {
    /// `(input, output)`.
    pub(super) records: Vec<(Vec<f64>, Vec<f64>)>,
    pub(super) mask: Vec<Vec<bool>>,
    /// Samples that count.
    pub(super) count: usize,
}

/// Numbers and initial levels, with the sum of the squared errors.
#[derive(Debug, Clone)]
pub(super) struct Trial {
    pub(super) cascade: Cascade,
    pub(super) initial: Vec<[f64; 2]>,
    pub(super) cost: f64,
}

impl Trial {
    /// How many numbers are free.
    pub(crate) fn free(&self) -> usize {
        self.searched().len() + 2 * self.initial.len()
    }

    /// Numbers of the parts that are present.
    pub(crate) fn searched(&self) -> Vec<Number> {
        Number::ALL
            .into_iter()
            .filter(|n| self.cascade.parts.has(*n))
            .collect()
    }

    /// After `step` in the numbers `searched` (positive ones as logarithms) and the initial levels.
    fn moved(&self, searched: &[Number], step: &DVector<f64>) -> Self {
        let mut next = self.clone();
        for (number, step) in searched.iter().zip(step) {
            let old = self.cascade.number(*number);
            let new = match number {
                n if n.positive() => old * step.clamp(-LONGEST_STEP, LONGEST_STEP).exp(),
                Number::Share => (old + step).clamp(0.0, 1.0),
                _ => old + step,
            };
            next.cascade.set(*number, new);
        }
        let levels = next.initial.iter_mut().flatten();
        for (level, step) in levels.zip(step.iter().skip(searched.len())) {
            *level = (*level + step).max(0.0);
        }
        next
    }

    /// Whether coordinate `i` lies on a bound beyond which `pull` would carry it.
    fn held(&self, searched: &[Number], i: usize, pull: f64) -> bool {
        let (value, upper) = match searched.get(i) {
            Some(Number::Share) => (self.cascade.number(Number::Share), 1.0),
            Some(_) => return false,
            None => {
                let i = i - searched.len();
                (self.initial[i / 2][i % 2], f64::INFINITY)
            }
        };
        (value <= 0.0 && pull < 0.0) || (value >= upper && pull > 0.0)
    }
}

impl Problem {
    /// Sum of the squared errors.
    fn cost(&self, trial: &Trial) -> f64 {
        let mut sum = 0.0;
        for (r, (u, y)) in self.records.iter().enumerate() {
            let mut samples = y.iter().zip(&self.mask[r]);
            trial
                .cascade
                .walk(&trial.cascade.numbers, u, trial.initial[r], |[_, x2]| {
                    if let Some((y, true)) = samples.next() {
                        sum += (y - x2).powi(2);
                    }
                });
        }
        sum
    }

    /// `trial` with its cost.
    pub(crate) fn priced(&self, mut trial: Trial) -> Trial {
        trial.cost = self.cost(&trial);
        trial
    }

    /// Normal equations `H step = pull` in the coordinates of [`Trial::moved`].
    pub(crate) fn normal(
        &self,
        trial: &Trial,
        searched: &[Number],
    ) -> (DMatrix<f64>, DVector<f64>) {
        let numbers = trial.cascade.numbers;
        let jets: [Jet; NUMBERS] = std::array::from_fn(|i| Jet::variable(numbers[i], i));
        let size = searched.len() + 2 * trial.initial.len();
        let (mut h, mut pull) = (DMatrix::zeros(size, size), DVector::zeros(size));
        for (r, (u, y)) in self.records.iter().enumerate() {
            let start = trial.initial[r];
            let start = [
                Jet::variable(start[0], NUMBERS),
                Jet::variable(start[1], NUMBERS + 1),
            ];
            let mut products = [[0.0; SLOTS]; SLOTS];
            let mut pulls = [0.0; SLOTS];
            let mut samples = y.iter().zip(&self.mask[r]);
            trial.cascade.walk(&jets, u, start, |[_, x2]| {
                if let Some((y, true)) = samples.next() {
                    let error = y - x2.value;
                    for (i, slope) in x2.slopes.iter().enumerate() {
                        pulls[i] += slope * error;
                        for (product, other) in products[i].iter_mut().zip(&x2.slopes) {
                            *product += slope * other;
                        }
                    }
                }
            });
            // (Slot, coordinate, derivative of the number by its coordinate.)
            let mut places: Vec<(usize, usize, f64)> = Vec::with_capacity(SLOTS);
            for (i, number) in searched.iter().enumerate() {
                let factor = if number.positive() {
                    trial.cascade.number(*number)
                } else {
                    1.0
                };
                places.push((*number as usize, i, factor));
            }
            for i in 0..2 {
                places.push((NUMBERS + i, searched.len() + 2 * r + i, 1.0));
            }
            for (slot, i, factor) in &places {
                pull[*i] += pulls[*slot] * factor;
                for (other, j, by) in &places {
                    h[(*i, *j)] += products[*slot][*other] * factor * by;
                }
            }
        }
        (h, pull)
    }

    /// Levenberg and Marquardt, at most `steps` of them, over the numbers `searched` and the initial levels.
    pub(crate) fn refine(&self, mut trial: Trial, searched: &[Number], steps: usize) -> Trial {
        let (mut damping, mut small) = (1e-2, 0);
        for _ in 0..steps {
            let (h, pull) = self.normal(&trial, searched);
            let size = pull.len();
            let largest = h.diagonal().max();
            if !(largest > 0.0 && largest.is_finite()) {
                break;
            }
            let scale = h.diagonal().map(|d| d.max(1e-24 * largest).sqrt());
            let held: Vec<bool> = (0..size)
                .map(|i| trial.held(searched, i, pull[i]))
                .collect();
            let accepted = (0..12).find_map(|_| {
                let system =
                    DMatrix::from_fn(size, size, |i, j| match (i == j, held[i] || held[j]) {
                        (true, true) => 1.0,
                        (false, true) => 0.0,
                        (same, false) => {
                            h[(i, j)] / (scale[i] * scale[j]) + if same { damping } else { 0.0 }
                        }
                    });
                let side =
                    DVector::from_fn(size, |i, _| if held[i] { 0.0 } else { pull[i] / scale[i] });
                let next = system.cholesky().map(|c| {
                    let step = c.solve(&side).component_div(&scale);
                    self.priced(trial.moved(searched, &step))
                });
                let better = next.filter(|next| next.cost < trial.cost);
                if better.is_none() {
                    damping = (damping * 6.0).max(1e-8);
                }
                better
            });
            let Some(next) = accepted else { break };
            let gain = (trial.cost - next.cost) / trial.cost;
            trial = next;
            damping = (damping / 8.0).max(1e-9);
            small = if gain < SETTLED { small + 1 } else { 0 };
            if small >= 2 {
                break;
            }
        }
        trial
    }
}
