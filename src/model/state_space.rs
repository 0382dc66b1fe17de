//! The innovation form.

use nalgebra::DMatrix;

/// Linear time-invariant system in innovation form,
///
/// `x[k+1] = A x[k] + B u[k] + K e[k]`, `y[k] = C x[k] + D u[k] + e[k]`.
#[derive(Debug, Clone, PartialEq)]
pub struct StateSpace {
    /// State matrix, `n x n`.
    pub a: DMatrix<f64>,
    /// Input matrix, `n x r`.
    pub b: DMatrix<f64>,
    /// Output matrix, `l x n`.
    pub c: DMatrix<f64>,
    /// Feedthrough, `l x r`.
    pub d: DMatrix<f64>,
    /// Observer (Kalman) gain, `n x l`.
    pub k: DMatrix<f64>,
    /// Sample time in seconds.
    pub sample_time: f64,
}

impl StateSpace {
    /// Number of states `n`.
    pub fn states(&self) -> usize {
        self.a.nrows()
    }

    /// Number of inputs `r`.
    pub fn inputs(&self) -> usize {
        self.b.ncols()
    }

    /// Number of outputs `l`.
    pub fn outputs(&self) -> usize {
        self.c.nrows()
    }
}
