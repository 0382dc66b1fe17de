//! Minimal coordinates of a linear plant: as many numbers as the input-output behaviour has.
//!
//! The states are the outputs and their scaled increments, `C`, `C (A - I)/s`, `C ((A - I)/s)^2`, ... (an
//! observability form in the delta operator). `C` and all rows of `A` but the last of each output's chain are then
//! fixed, and every plant near the given one has exactly one set of the numbers that are left: those rows of `A`,
//! `B`, and the initial state. In contrast to poles and zeros they stay smooth where poles meet, and in contrast
//! to the shift form they stay well scaled when the sampling is fast.

use std::sync::OnceLock;

use nalgebra::DMatrix;

use super::functionals::Functionals;
use super::linear_plant::Plant;
use crate::linalg::svd_thin;

/// Rows whose smallest singular value falls below this share of the largest are no basis.
const INDEPENDENT: f64 = 1e-7;

/// Where the free numbers of a plant sit.
#[derive(Debug, Clone)]
pub(crate) struct Coordinates {
    /// The given plant in these coordinates.
    pub(crate) given: Plant,
    /// Rows of `A` that are free.
    pub(crate) free_rows: Vec<usize>,
    /// Inputs whose column of `B` is free: those that the given plant responds to.
    pub(crate) active_inputs: Vec<usize>,
    /// Takes the given state to these coordinates: `x_here = to_here * x_given`.
    pub(crate) to_here: DMatrix<f64>,
    rows: OnceLock<Functionals>,
}

impl Coordinates {
    /// Coordinates around `plant`. Modes that no output sees are dropped.
    pub(crate) fn new(plant: &Plant) -> Self {
        let n = plant.states;
        let scale = increment_scale(plant);
        let delta = (plant.a_matrix() - DMatrix::identity(n, n)) / scale;
        let c = plant.c_matrix();
        let mut rows: Vec<DMatrix<f64>> = Vec::new();
        let mut chains = vec![Vec::new(); plant.outputs];
        let mut next: Vec<Option<DMatrix<f64>>> = (0..plant.outputs)
            .map(|o| Some(c.rows(o, 1).into_owned()))
            .collect();
        // One row of each output in turn, until no row is new.
        while rows.len() < n && next.iter().any(Option::is_some) {
            for output in 0..plant.outputs {
                let Some(row) = next[output].take() else {
                    continue;
                };
                if rows.len() < n && is_new(&rows, &row) {
                    chains[output].push(rows.len());
                    next[output] = Some(&row * &delta);
                    rows.push(row);
                }
            }
        }
        let seen = rows.len();
        let mut t = DMatrix::zeros(seen, n);
        for (i, row) in rows.iter().enumerate() {
            t.set_row(i, &row.row(0));
        }
        // Where no output sees any state there is nothing to invert.
        let inverse = Some(t.clone())
            .filter(|t| !t.is_empty())
            .and_then(|t| t.pseudo_inverse(1e-14).ok())
            .unwrap_or_else(|| DMatrix::zeros(n, seen));
        let mut given = plant.transformed(&t, &inverse);
        given.states = seen;
        tidy(&mut given, &chains, scale);
        let free_rows = chains.iter().filter_map(|c| c.last().copied()).collect();
        let active_inputs = (0..plant.inputs)
            .filter(|&j| {
                given.b_column(j).iter().any(|b| *b != 0.0)
                    || (0..plant.outputs).any(|o| given.d[o * plant.inputs + j] != 0.0)
            })
            .collect();
        Self {
            given,
            free_rows,
            active_inputs,
            to_here: t,
            rows: OnceLock::new(),
        }
    }

    /// Those of a plant that stays as it is.
    pub(crate) fn fixed(plant: Plant, active_inputs: Vec<usize>) -> Self {
        Self {
            free_rows: Vec::new(),
            active_inputs,
            to_here: DMatrix::identity(plant.states, plant.states),
            rows: OnceLock::new(),
            given: plant,
        }
    }

    /// The same numbers free, around another plant in these coordinates.
    pub(crate) fn around(&self, plant: Plant) -> Self {
        Self {
            given: plant,
            free_rows: self.free_rows.clone(),
            active_inputs: self.active_inputs.clone(),
            to_here: self.to_here.clone(),
            rows: OnceLock::new(),
        }
    }

    /// What can be read off the state of the given plant.
    pub(crate) fn given_rows(&self) -> &Functionals {
        self.rows.get_or_init(|| Functionals::new(&self.given))
    }

    /// Numbers of `A` and `B` that are free.
    pub(crate) fn len(&self) -> usize {
        self.given.states * (self.free_rows.len() + self.active_inputs.len())
    }

    /// The free numbers of `plant`, which must be in these coordinates: rows of `A`, then columns of `B`.
    pub(crate) fn numbers(&self, plant: &Plant) -> Vec<f64> {
        let n = plant.states;
        let mut numbers = Vec::with_capacity(self.len());
        for &row in &self.free_rows {
            numbers.extend_from_slice(&plant.a[row * n..(row + 1) * n]);
        }
        for &input in &self.active_inputs {
            numbers.extend(plant.b_column(input));
        }
        numbers
    }

    /// The plant with these free numbers.
    pub(crate) fn plant(&self, numbers: &[f64]) -> Plant {
        let mut plant = self.given.clone();
        let n = plant.states;
        let (a_part, b_part) = numbers.split_at(n * self.free_rows.len());
        for (&row, values) in self.free_rows.iter().zip(a_part.chunks_exact(n.max(1))) {
            plant.a[row * n..(row + 1) * n].copy_from_slice(values);
        }
        for (&input, values) in self.active_inputs.iter().zip(b_part.chunks_exact(n.max(1))) {
            for (i, value) in values.iter().enumerate() {
                plant.b[i * plant.inputs + input] = *value;
            }
        }
        plant
    }
}

/// The size of one increment: so that a state and its scaled increment are of one size.
fn increment_scale(plant: &Plant) -> f64 {
    let n = plant.states;
    if n == 0 {
        return 1.0;
    }
    let norm = (plant.a_matrix() - DMatrix::identity(n, n))
        .determinant()
        .abs()
        .powf(1.0 / n as f64);
    if norm.is_finite() && norm > 1e-3 {
        norm.min(2.0)
    } else {
        0.1
    }
}

fn is_new(rows: &[DMatrix<f64>], row: &DMatrix<f64>) -> bool {
    let n = row.ncols();
    let mut stacked = DMatrix::zeros(rows.len() + 1, n);
    for (i, r) in rows.iter().chain([row]).enumerate() {
        let norm = r.norm();
        if !(norm.is_finite() && norm > 0.0) {
            return false;
        }
        stacked.set_row(i, &(r.row(0) / norm));
    }
    let Ok(svd) = svd_thin(&stacked) else {
        return false;
    };
    let values: Vec<f64> = svd.values.iter().copied().collect();
    let largest = values.iter().copied().fold(0.0, f64::max);
    let smallest = values.iter().copied().fold(f64::INFINITY, f64::min);
    smallest > INDEPENDENT * largest
}

/// Writes the entries that the coordinates fix exactly.
fn tidy(plant: &mut Plant, chains: &[Vec<usize>], scale: f64) {
    let n = plant.states;
    for (output, chain) in chains.iter().enumerate() {
        if let Some(&first) = chain.first() {
            for i in 0..n {
                plant.c[output * n + i] = if i == first { 1.0 } else { 0.0 };
            }
        }
        for pair in chain.windows(2) {
            for i in 0..n {
                let value = if i == pair[0] {
                    1.0
                } else if i == pair[1] {
                    scale
                } else {
                    0.0
                };
                plant.a[pair[0] * n + i] = value;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::continuous::tests::continuous_plant;
    use super::super::functionals::Signal;
    use super::*;
    use crate::explain::linear::fixtures;

    /// Rows that were read off one plant are not those of another.
    #[test]
    fn another_plant_has_rows_of_its_own() {
        let coordinates = Coordinates::new(&fixtures::plant());
        let before = coordinates.given_rows().clone();
        let mut other = coordinates.given.clone();
        other.a[2] *= 1.5;
        let after = coordinates.around(other.clone());
        let signal = Signal::Output(0);
        let rate = |rows: &Functionals, plant| rows.of(plant, signal).rate;
        assert_ne!(
            rate(after.given_rows(), &other),
            rate(&before, &coordinates.given)
        );
        assert_eq!(
            rate(after.given_rows(), &other),
            rate(&Functionals::new(&other), &other)
        );
    }

    #[test]
    fn inputs_that_do_something_are_free() {
        let mut plant = continuous_plant().2;
        for i in 0..2 {
            plant.b[3 * i + 1] = 0.0;
            plant.b[3 * i + 2] = 0.0;
        }
        assert_eq!(Coordinates::new(&plant).active_inputs, [0, 1]);
    }
}
