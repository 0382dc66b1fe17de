//! The covariance of the state-space parameters, and how they are laid out in a vector.

use nalgebra::DMatrix;

use crate::linalg::multiply_nt;
use crate::model::StateSpace;

/// Order of the parameters in `theta = [vec A; vec B; vec K; vec C; vec D]`, column-major, `D` only
/// when the model has direct feedthrough.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ParameterLayout {
    /// Number of states `n`.
    pub states: usize,
    /// Number of inputs `r`.
    pub inputs: usize,
    /// Number of outputs `l`.
    pub outputs: usize,
    /// Whether `D` is estimated.
    pub feedthrough: bool,
}

impl ParameterLayout {
    /// Of the matrices of a system.
    pub fn of(system: &StateSpace, feedthrough: bool) -> Self {
        Self {
            states: system.states(),
            inputs: system.inputs(),
            outputs: system.outputs(),
            feedthrough,
        }
    }

    /// First index of `vec B`.
    pub fn b(&self) -> usize {
        self.states * self.states
    }

    /// First index of `vec K`.
    pub fn k(&self) -> usize {
        self.b() + self.states * self.inputs
    }

    /// First index of `vec C`.
    pub fn c(&self) -> usize {
        self.k() + self.states * self.outputs
    }

    /// First index of `vec D` (the length of the vector when there is no `D`).
    pub fn d(&self) -> usize {
        self.c() + self.outputs * self.states
    }

    /// Length of the parameter vector.
    pub fn len(&self) -> usize {
        self.d()
            + if self.feedthrough {
                self.outputs * self.inputs
            } else {
                0
            }
    }

    /// Whether there is no parameter at all.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of parameters that the input-output behaviour determines: `n (r + 2 l)`, plus `l r` with
    /// `D`. The other `n^2` are the choice of the state basis.
    pub(crate) fn identifiable(&self) -> usize {
        self.states * (self.inputs + 2 * self.outputs)
            + if self.feedthrough {
                self.outputs * self.inputs
            } else {
                0
            }
    }

    /// Stacks the matrices of a system.
    pub fn pack(&self, system: &StateSpace) -> Vec<f64> {
        let mut theta = Vec::with_capacity(self.len());
        for matrix in [&system.a, &system.b, &system.k, &system.c] {
            theta.extend_from_slice(matrix.as_slice());
        }
        if self.feedthrough {
            theta.extend_from_slice(system.d.as_slice());
        }
        theta
    }

    /// The system whose stacked matrices are `theta`; `like` gives the sample time, and `D` when it is
    /// not among the parameters.
    pub fn unpack(&self, theta: &[f64], like: &StateSpace) -> StateSpace {
        let (n, r, l) = (self.states, self.inputs, self.outputs);
        let matrix = |from: usize, rows: usize, columns: usize| {
            DMatrix::from_column_slice(rows, columns, &theta[from..from + rows * columns])
        };
        StateSpace {
            a: matrix(0, n, n),
            b: matrix(self.b(), n, r),
            k: matrix(self.k(), n, l),
            c: matrix(self.c(), l, n),
            d: if self.feedthrough {
                matrix(self.d(), l, r)
            } else {
                like.d.clone()
            },
            sample_time: like.sample_time,
        }
    }
}

/// Covariance of the stacked parameters of a [`StateSpace`], in the basis of that very system.
///
/// The matrix is bound to the state basis: only what does not depend on the basis (frequency response,
/// poles, zeros, step and impulse response) has an uncertainty that means something by itself.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterCovariance {
    /// Order of the parameters.
    pub layout: ParameterLayout,
    /// Covariance, `layout.len()` square, positive semidefinite.
    pub matrix: DMatrix<f64>,
    /// Degrees of freedom of the covariance itself: `None` for a model-based covariance (normal and
    /// chi-square quantiles), blocks - 1 for the jackknife (Student and F quantiles).
    pub degrees_of_freedom: Option<f64>,
}

impl ParameterCovariance {
    /// A covariance from a formula, `layout.len()` square; made exactly symmetric, whatever the order of summation.
    pub(crate) fn of_matrix(layout: ParameterLayout, matrix: &DMatrix<f64>) -> Self {
        Self {
            layout,
            matrix: (matrix + matrix.transpose()) * 0.5,
            degrees_of_freedom: None,
        }
    }

    /// `P P'` for errors `P w` with `w` white of unit covariance: positive semidefinite by construction.
    pub(crate) fn of_root(layout: ParameterLayout, root: &DMatrix<f64>) -> Self {
        Self::of_matrix(layout, &multiply_nt(root, root))
    }
}
