//! The linear part: a discrete state-space plant in plain arrays, quick to build and to run.

use nalgebra::DMatrix;

use crate::model::StateSpace;

/// `x+ = A x + B u`, `y = C x + D u`; row-major.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Plant {
    pub states: usize,
    pub inputs: usize,
    pub outputs: usize,
    pub a: Vec<f64>,
    pub b: Vec<f64>,
    pub c: Vec<f64>,
    pub d: Vec<f64>,
    pub sample_time: f64,
}

impl Plant {
    pub fn from_state_space(system: &StateSpace) -> Self {
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

    pub fn a_matrix(&self) -> DMatrix<f64> {
        DMatrix::from_row_slice(self.states, self.states, &self.a)
    }

    pub fn b_matrix(&self) -> DMatrix<f64> {
        DMatrix::from_row_slice(self.states, self.inputs, &self.b)
    }

    pub fn c_matrix(&self) -> DMatrix<f64> {
        DMatrix::from_row_slice(self.outputs, self.states, &self.c)
    }

    pub fn d_matrix(&self) -> DMatrix<f64> {
        DMatrix::from_row_slice(self.outputs, self.inputs, &self.d)
    }

    /// Row `output` of `C`.
    pub fn c_row(&self, output: usize) -> &[f64] {
        &self.c[output * self.states..(output + 1) * self.states]
    }

    /// Column `input` of `B`.
    pub fn b_column(&self, input: usize) -> Vec<f64> {
        (0..self.states)
            .map(|i| self.b[i * self.inputs + input])
            .collect()
    }

    /// The same input-output behaviour in the state `T x`.
    pub fn transformed(&self, t: &DMatrix<f64>, t_inverse: &DMatrix<f64>) -> Self {
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
