//! The linear part: a discrete state-space plant in plain arrays, quick to build and to run.

use nalgebra::{Complex, DMatrix};

use crate::model::StateSpace;

/// `x+ = A x + B u`, `y = C x + D u`; row-major.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Plant {
    pub(crate) states: usize,
    pub(crate) inputs: usize,
    pub(crate) outputs: usize,
    pub(crate) a: Vec<f64>,
    pub(crate) b: Vec<f64>,
    pub(crate) c: Vec<f64>,
    pub(crate) d: Vec<f64>,
    pub(crate) sample_time: f64,
}

impl Plant {
    /// Whether the slowest pole has a damping ratio below 0.995: a spring holds the whole of it. An identified double pole may be a
    /// pair that turns a little. A drive with an elastic shaft oscillates too, but its slowest pole is that of all masses against
    /// friction. A negative real pole of a sampled plant does not count.
    pub(crate) fn oscillates(&self) -> bool {
        const TURNS: f64 = 0.1;
        self.slowest_pole()
            .is_some_and(|pole| pole.im.abs() > TURNS * pole.re.abs())
    }

    /// Whether the slowest pole has a damping ratio below 1/sqrt(2): the frequency response has a peak.
    pub(crate) fn resonates(&self) -> bool {
        self.slowest_pole()
            .is_some_and(|pole| pole.im.abs() > pole.re.abs())
    }

    /// In continuous time, by its distance from 0.
    fn slowest_pole(&self) -> Option<Complex<f64>> {
        if self.states == 0 {
            return None;
        }
        let poles = self.a_matrix().complex_eigenvalues();
        let continuous = (poles.iter())
            .filter(|pole| pole.im != 0.0 || pole.re > 0.0)
            .map(|pole| pole.ln());
        continuous.min_by(|a, b| a.norm().total_cmp(&b.norm()))
    }

    /// Whether a pole has a time constant longer than three recordings of so many samples: what disturbs the plant adds up.
    pub(crate) fn integrates(&self, samples: usize) -> bool {
        const RECORDINGS: f64 = 3.0;
        let slowest = (-1.0 / (RECORDINGS * samples.max(1) as f64)).exp();
        let poles = self.a_matrix().complex_eigenvalues();
        self.states > 0 && poles.iter().any(|pole| pole.norm() > slowest)
    }

    pub(crate) fn from_state_space(system: &StateSpace) -> Self {
        Self {
            states: system.states(),
            inputs: system.inputs(),
            outputs: system.outputs(),
            a: row_major(&system.a),
            b: row_major(&system.b),
            c: row_major(&system.c),
            d: row_major(&system.d),
            sample_time: system.sample_time,
        }
    }

    pub(crate) fn a_matrix(&self) -> DMatrix<f64> {
        DMatrix::from_row_slice(self.states, self.states, &self.a)
    }

    pub(crate) fn b_matrix(&self) -> DMatrix<f64> {
        DMatrix::from_row_slice(self.states, self.inputs, &self.b)
    }

    pub(crate) fn c_matrix(&self) -> DMatrix<f64> {
        DMatrix::from_row_slice(self.outputs, self.states, &self.c)
    }

    pub(crate) fn d_matrix(&self) -> DMatrix<f64> {
        DMatrix::from_row_slice(self.outputs, self.inputs, &self.d)
    }

    /// Row `output` of `C`.
    pub(crate) fn c_row(&self, output: usize) -> &[f64] {
        &self.c[output * self.states..(output + 1) * self.states]
    }

    /// Row `output` of `D`.
    pub(crate) fn d_row(&self, output: usize) -> &[f64] {
        &self.d[output * self.inputs..(output + 1) * self.inputs]
    }

    /// Column `input` of `B`.
    pub(crate) fn b_column(&self, input: usize) -> Vec<f64> {
        (0..self.states)
            .map(|i| self.b[i * self.inputs + input])
            .collect()
    }

    /// Takes up a force `-(row x + feedthrough u)` that enters through `direction`, with the mean of its values at both
    /// ends of a sample interval; without `feedthrough` it is zero.
    pub(crate) fn add_linear_force(&mut self, direction: &[f64], row: &[f64], feedthrough: &[f64]) {
        let (n, r) = (self.states, self.inputs);
        // Half of `row (x + A x + B u)`.
        let on_state: Vec<f64> = (0..n)
            .map(|j| 0.5 * (row[j] + product(row, &self.a, n, j)))
            .collect();
        let on_input: Vec<f64> = (0..r)
            .map(|j| 0.5 * product(row, &self.b, r, j) + feedthrough.get(j).unwrap_or(&0.0))
            .collect();
        self.take_up(direction, &on_state, &on_input);
    }

    /// Takes up a force through `direction` that is minus the change of `row x` over a sample interval, per second: what a mass needs
    /// to be accelerated.
    pub(crate) fn add_inertia(&mut self, direction: &[f64], row: &[f64]) {
        let (n, r, h) = (self.states, self.inputs, self.sample_time);
        let on_state: Vec<f64> = (0..n)
            .map(|j| (product(row, &self.a, n, j) - row[j]) / h)
            .collect();
        let on_input: Vec<f64> = (0..r).map(|j| product(row, &self.b, r, j) / h).collect();
        self.take_up(direction, &on_state, &on_input);
    }

    /// A force through `direction` of minus so much for each state and input.
    fn take_up(&mut self, direction: &[f64], on_state: &[f64], on_input: &[f64]) {
        let (n, r) = (self.states, self.inputs);
        for (i, d) in direction.iter().enumerate() {
            for (a, row) in self.a[i * n..(i + 1) * n].iter_mut().zip(on_state) {
                *a -= d * row;
            }
            for (b, row) in self.b[i * r..(i + 1) * r].iter_mut().zip(on_input) {
                *b -= d * row;
            }
        }
    }

    /// The same input-output behaviour in the state `T x`.
    pub(crate) fn transformed(&self, t: &DMatrix<f64>, t_inverse: &DMatrix<f64>) -> Self {
        Self {
            a: row_major(&(t * self.a_matrix() * t_inverse)),
            b: row_major(&(t * self.b_matrix())),
            c: row_major(&(self.c_matrix() * t_inverse)),
            ..self.clone()
        }
    }
}

pub(crate) fn row_major(matrix: &DMatrix<f64>) -> Vec<f64> {
    matrix.transpose().as_slice().to_vec()
}
/// A row times a column of a matrix by rows.
fn product(row: &[f64], matrix: &[f64], columns: usize, column: usize) -> f64 {
    let of_column = matrix.iter().skip(column).step_by(columns);
    row.iter().zip(of_column).map(|(a, b)| a * b).sum()
}
