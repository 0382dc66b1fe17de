//! Free run of a model.

use nalgebra::{DMatrix, DVector};

use super::model_error::ModelError;
use super::recursion::Recursion;
use super::state_space::StateSpace;

impl StateSpace {
    /// Free run `x[k+1] = A x[k] + B u[k]`, `y[k] = C x[k] + D u[k]`.
    ///
    /// `inputs` holds one column per input, `x0` the state at the first sample (zero without it); the
    /// result has one column per output. A model without inputs has no sample to run over: give it
    /// innovations in [`StateSpace::simulate_with_noise`]. An unstable model may run to infinity; what
    /// it gives is returned as it is.
    ///
    /// # Errors
    /// [`ModelError::Channels`], [`ModelError::Length`] or [`ModelError::InitialState`].
    pub fn simulate(
        &self,
        inputs: &[&[f64]],
        x0: Option<&DVector<f64>>,
    ) -> Result<Vec<Vec<f64>>, ModelError> {
        Simulator::new(self, x0)?.step(inputs)
    }

    /// Run of the whole innovation form, `x[k+1] = A x[k] + B u[k] + K e[k]`,
    /// `y[k] = C x[k] + D u[k] + e[k]`: as [`StateSpace::simulate`], with one innovation column per
    /// output.
    ///
    /// # Errors
    /// As [`StateSpace::simulate`].
    pub fn simulate_with_noise(
        &self,
        inputs: &[&[f64]],
        innovations: &[&[f64]],
        x0: Option<&DVector<f64>>,
    ) -> Result<Vec<Vec<f64>>, ModelError> {
        Simulator::new(self, x0)?.step_with_noise(inputs, innovations)
    }
}

/// A simulation that goes on block after block, for records longer than memory.
///
/// ```
/// # use innovant::model::{Simulator, StateSpace};
/// # use nalgebra::dmatrix;
/// let system =
///     StateSpace::deterministic(dmatrix![0.5], dmatrix![1.0], dmatrix![1.0], dmatrix![0.0], 0.1)?;
/// let mut simulator = Simulator::new(&system, None)?;
/// assert_eq!(simulator.step(&[&[1.0, 0.0]])?, [[0.0, 1.0]]);
/// assert_eq!(simulator.step(&[&[0.0, 0.0]])?, [[0.5, 0.25]]);
/// # Ok::<(), innovant::model::ModelError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Simulator {
    quiet: Recursion,
    noisy: Recursion,
    state: Vec<f64>,
    inputs: usize,
    outputs: usize,
}

impl Simulator {
    /// Starts at the state `x0` (zero without it).
    ///
    /// # Errors
    /// [`ModelError::InitialState`].
    pub fn new(system: &StateSpace, x0: Option<&DVector<f64>>) -> Result<Self, ModelError> {
        let (r, l) = (system.inputs(), system.outputs());
        let state = initial_state(system, x0)?;
        let identity = DMatrix::identity(l, l);
        Ok(Self {
            quiet: Recursion::new(&system.a, &system.b, &system.c, &system.d),
            noisy: Recursion::new(
                &system.a,
                &side_by_side(&system.b, &system.k),
                &system.c,
                &side_by_side(&system.d, &identity),
            ),
            state,
            inputs: r,
            outputs: l,
        })
    }

    /// Output columns of the next block of input columns.
    ///
    /// # Errors
    /// [`ModelError::Channels`] or [`ModelError::Length`]; the state is then as before.
    pub fn step(&mut self, inputs: &[&[f64]]) -> Result<Vec<Vec<f64>>, ModelError> {
        let samples = common_length("inputs", inputs, self.inputs, None)?;
        let mut outputs = vec![Vec::new(); self.outputs];
        self.quiet
            .run(&mut self.state, inputs, samples, &mut outputs);
        Ok(outputs)
    }

    /// Output columns of the next block of input and innovation columns.
    ///
    /// # Errors
    /// [`ModelError::Channels`] or [`ModelError::Length`]; the state is then as before.
    pub fn step_with_noise(
        &mut self,
        inputs: &[&[f64]],
        innovations: &[&[f64]],
    ) -> Result<Vec<Vec<f64>>, ModelError> {
        let samples = common_length("innovations", innovations, self.outputs, None)?;
        common_length("inputs", inputs, self.inputs, Some(samples))?;
        let channels: Vec<&[f64]> = inputs.iter().chain(innovations).copied().collect();
        let mut outputs = vec![Vec::new(); self.outputs];
        self.noisy
            .run(&mut self.state, &channels, samples, &mut outputs);
        Ok(outputs)
    }

    /// State at the sample that comes next (`n`).
    pub fn state(&self) -> DVector<f64> {
        DVector::from_column_slice(&self.state)
    }
}

/// `x0`, or zeros, after a check of its length.
pub(super) fn initial_state(
    system: &StateSpace,
    x0: Option<&DVector<f64>>,
) -> Result<Vec<f64>, ModelError> {
    let expected = system.states();
    match x0 {
        None => Ok(vec![0.0; expected]),
        Some(x0) if x0.len() == expected => Ok(x0.as_slice().to_vec()),
        Some(x0) => Err(ModelError::InitialState {
            given: x0.len(),
            expected,
        }),
    }
}

/// Checks the number of channels and their lengths; returns the length (0 without channels, unless
/// `samples` says otherwise).
pub(super) fn common_length(
    kind: &'static str,
    columns: &[&[f64]],
    expected: usize,
    samples: Option<usize>,
) -> Result<usize, ModelError> {
    if columns.len() != expected {
        return Err(ModelError::Channels {
            kind,
            given: columns.len(),
            expected,
        });
    }
    let length = samples.unwrap_or_else(|| columns.first().map_or(0, |c| c.len()));
    match columns.iter().position(|c| c.len() != length) {
        None => Ok(length),
        Some(index) => Err(ModelError::Length {
            kind,
            channel: index + 1,
            given: columns[index].len(),
            expected: length,
        }),
    }
}

/// `[left right]`.
pub(super) fn side_by_side(left: &DMatrix<f64>, right: &DMatrix<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(left.nrows(), left.ncols() + right.ncols(), |i, j| {
        if j < left.ncols() {
            left[(i, j)]
        } else {
            right[(i, j - left.ncols())]
        }
    })
}

#[cfg(test)]
#[path = "tests/simulate_system_tests.rs"]
mod tests;
