//! Free run of a model.

use nalgebra::{DMatrix, DVector};

use super::error::ModelError;
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
mod tests {
    use super::*;
    use nalgebra::{dmatrix, dvector};

    fn system() -> StateSpace {
        StateSpace::new(
            dmatrix![0.7, 0.2, 0.0; -0.3, 0.5, 0.1; 0.0, 0.4, -0.6],
            dmatrix![1.0, 0.2; 0.0, -0.5; 0.3, 0.3],
            dmatrix![1.0, 0.0, 0.5; 0.2, 1.0, 0.0],
            dmatrix![0.0, 0.1; 0.05, 0.0],
            dmatrix![0.3, 0.0; 0.1, 0.2; 0.0, 0.1],
            0.5,
        )
        .unwrap()
    }

    fn column(seed: usize, samples: usize) -> Vec<f64> {
        (0..samples)
            .map(|k| ((k * 37 + seed * 101) % 23) as f64 / 11.0 - 1.0)
            .collect()
    }

    #[test]
    fn run_equals_the_defining_equations() {
        let s = system();
        let (u1, u2, e1, e2) = (column(1, 40), column(2, 40), column(3, 40), column(4, 40));
        let x0 = dvector![1.0, -2.0, 0.5];
        let quiet = s.simulate(&[&u1, &u2], Some(&x0)).unwrap();
        let noisy = s
            .simulate_with_noise(&[&u1, &u2], &[&e1, &e2], Some(&x0))
            .unwrap();
        let (mut x, mut xe) = (x0.clone(), x0);
        for k in 0..40 {
            let (u, e) = (dvector![u1[k], u2[k]], dvector![e1[k], e2[k]]);
            let y = &s.c * &x + &s.d * &u;
            let ye = &s.c * &xe + &s.d * &u + &e;
            for o in 0..2 {
                assert!((quiet[o][k] - y[o]).abs() < 1e-13);
                assert!((noisy[o][k] - ye[o]).abs() < 1e-13);
            }
            x = &s.a * &x + &s.b * &u;
            xe = &s.a * &xe + &s.b * &u + &s.k * &e;
        }
    }

    #[test]
    fn blocks_equal_one_run_bit_for_bit() {
        let s = system();
        let (u1, u2) = (column(5, 50), column(6, 50));
        let whole = s.simulate(&[&u1, &u2], None).unwrap();
        let mut simulator = Simulator::new(&s, None).unwrap();
        let mut parts = simulator.step(&[&u1[..17], &u2[..17]]).unwrap();
        for (part, more) in parts
            .iter_mut()
            .zip(simulator.step(&[&u1[17..], &u2[17..]]).unwrap())
        {
            part.extend(more);
        }
        assert_eq!(whole, parts);
    }

    #[test]
    fn static_and_autonomous_models_run() {
        let gain = StateSpace::deterministic(
            DMatrix::zeros(0, 0),
            DMatrix::zeros(0, 1),
            DMatrix::zeros(2, 0),
            dmatrix![2.0; -1.0],
            1.0,
        )
        .unwrap();
        assert_eq!(
            gain.simulate(&[&[1.0, 3.0]], None).unwrap(),
            [[2.0, 6.0], [-1.0, -3.0]]
        );
        let free = StateSpace::new(
            dmatrix![0.5],
            DMatrix::zeros(1, 0),
            dmatrix![1.0],
            DMatrix::zeros(1, 0),
            dmatrix![1.0],
            1.0,
        )
        .unwrap();
        let y = free
            .simulate_with_noise(&[], &[&[1.0, 0.0, 0.0]], None)
            .unwrap();
        assert_eq!(y, [[1.0, 1.0, 0.5]]);
        assert_eq!(free.simulate(&[], None).unwrap(), [[0.0; 0]]);
    }

    #[test]
    fn a_state_left_alone_reaches_zero() {
        let s = StateSpace::deterministic(
            dmatrix![0.9],
            dmatrix![1.0],
            dmatrix![1.0],
            dmatrix![0.0],
            1.0,
        )
        .unwrap();
        let y = s
            .simulate(&[&vec![0.0; 10_000]], Some(&dvector![1.0]))
            .unwrap();
        assert_eq!(y[0][9_999], 0.0);
        assert!((y[0][100] - 0.9_f64.powi(100)).abs() < 1e-15);
    }

    #[test]
    fn an_unstable_model_overflows_quietly() {
        let s = StateSpace::deterministic(
            dmatrix![2.0],
            dmatrix![1.0],
            dmatrix![1.0],
            dmatrix![0.0],
            1.0,
        )
        .unwrap();
        let y = s.simulate(&[&vec![1.0; 2000]], None).unwrap();
        assert!(y[0][1999].is_infinite());
    }

    #[test]
    fn data_that_do_not_fit_are_refused() {
        let s = system();
        let u = [0.0; 5];
        assert_eq!(
            s.simulate(&[&u], None).unwrap_err().to_string(),
            "the model has 2 inputs, but the data have 1"
        );
        assert!(matches!(
            s.simulate(&[&u, &u[..3]], None),
            Err(ModelError::Length { channel: 2, .. })
        ));
        assert!(s.simulate(&[&u, &u], Some(&dvector![1.0])).is_err());
        assert!(
            s.simulate_with_noise(&[&u, &u], &[&u[..4], &u[..4]], None)
                .is_err()
        );
    }
}
