//! One-step prediction.

use nalgebra::{DMatrix, DVector};

use super::model_error::ModelError;
use super::recursion::Recursion;
use super::simulate_system::{common_length, initial_state, side_by_side};
use super::state_space::StateSpace;

/// What a model foresees one sample ahead, and what it does not.
#[derive(Debug, Clone, PartialEq)]
pub struct Prediction {
    /// Predicted outputs `C x[k] + D u[k]`, one column per output.
    pub predicted: Vec<Vec<f64>>,
    /// Innovations `e[k] = y[k] - (C x[k] + D u[k])`, one column per output.
    pub innovations: Vec<Vec<f64>>,
}

impl StateSpace {
    /// One-step prediction of `outputs` from all the inputs and outputs before, with the predictor form
    /// `x[k+1] = (A - K C) x[k] + (B - K D) u[k] + K y[k]`.
    ///
    /// `inputs` and `outputs` hold one column per channel, `x0` is the state at the first sample (zero
    /// without it). With `K = 0` the prediction is the free run.
    ///
    /// # Errors
    /// [`ModelError::Channels`], [`ModelError::Length`] or [`ModelError::InitialState`].
    pub fn one_step(
        &self,
        inputs: &[&[f64]],
        outputs: &[&[f64]],
        x0: Option<&DVector<f64>>,
    ) -> Result<Prediction, ModelError> {
        Predictor::new(self, x0)?.step(inputs, outputs)
    }
}

/// A prediction that goes on block after block, for records longer than memory.
#[derive(Debug, Clone)]
pub struct Predictor {
    recursion: Recursion,
    state: Vec<f64>,
    inputs: usize,
    outputs: usize,
}

impl Predictor {
    /// Starts at the state `x0` (zero without it).
    ///
    /// # Errors
    /// [`ModelError::InitialState`].
    pub fn new(system: &StateSpace, x0: Option<&DVector<f64>>) -> Result<Self, ModelError> {
        let l = system.outputs();
        let from_input = &system.b - &system.k * &system.d;
        Ok(Self {
            state: initial_state(system, x0)?,
            recursion: Recursion::new(
                &system.predictor_matrix(),
                &side_by_side(&from_input, &system.k),
                &system.c,
                &side_by_side(&system.d, &DMatrix::zeros(l, l)),
            ),
            inputs: system.inputs(),
            outputs: l,
        })
    }

    /// Prediction over the next block of input and output columns.
    ///
    /// # Errors
    /// [`ModelError::Channels`] or [`ModelError::Length`]; the state is then as before.
    pub fn step(
        &mut self,
        inputs: &[&[f64]],
        outputs: &[&[f64]],
    ) -> Result<Prediction, ModelError> {
        let samples = self.check(inputs, outputs)?;
        let channels: Vec<&[f64]> = inputs.iter().chain(outputs).copied().collect();
        let mut predicted = vec![Vec::new(); self.outputs];
        self.recursion
            .run(&mut self.state, &channels, samples, &mut predicted);
        let innovations = outputs
            .iter()
            .zip(&predicted)
            .map(|(y, p)| y.iter().zip(p).map(|(y, p)| y - p).collect())
            .collect();
        Ok(Prediction {
            predicted,
            innovations,
        })
    }

    /// Number of samples, after a check that all the channels are there and of that length.
    pub(super) fn check(&self, inputs: &[&[f64]], outputs: &[&[f64]]) -> Result<usize, ModelError> {
        let samples = common_length("outputs", outputs, self.outputs, None)?;
        common_length("inputs", inputs, self.inputs, Some(samples))
    }

    /// State at the sample that comes next (`n`).
    pub fn state(&self) -> DVector<f64> {
        DVector::from_column_slice(&self.state)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{dmatrix, dvector};

    fn system() -> StateSpace {
        StateSpace::new(
            dmatrix![0.9, 0.3; -0.2, 0.7],
            dmatrix![1.0; 0.4],
            dmatrix![1.0, 0.2; 0.0, 1.0],
            dmatrix![0.3; 0.0],
            dmatrix![0.4, 0.1; 0.0, 0.3],
            1.0,
        )
        .unwrap()
    }

    fn column(seed: usize) -> Vec<f64> {
        (0..60)
            .map(|k| ((k * 29 + seed * 53) % 31) as f64 / 15.0 - 1.0)
            .collect()
    }

    #[test]
    fn prediction_recovers_the_innovations_of_a_simulation() {
        let s = system();
        let (u, e1, e2) = (column(1), column(2), column(3));
        let x0 = dvector![0.5, -1.0];
        let y = s
            .simulate_with_noise(&[&u], &[&e1, &e2], Some(&x0))
            .unwrap();
        let prediction = s.one_step(&[&u], &[&y[0], &y[1]], Some(&x0)).unwrap();
        for k in 0..60 {
            assert!((prediction.innovations[0][k] - e1[k]).abs() < 1e-12);
            assert!((prediction.innovations[1][k] - e2[k]).abs() < 1e-12);
            assert!((prediction.predicted[0][k] + e1[k] - y[0][k]).abs() < 1e-12);
        }
    }

    #[test]
    fn without_gain_the_prediction_is_the_free_run() {
        let mut s = system();
        s.k.fill(0.0);
        let (u, y1, y2) = (column(1), column(2), column(3));
        let prediction = s.one_step(&[&u], &[&y1, &y2], None).unwrap();
        let free = s.simulate(&[&u], None).unwrap();
        assert_eq!(prediction.predicted, free);
    }

    #[test]
    fn blocks_equal_one_run_bit_for_bit() {
        let s = system();
        let (u, y1, y2) = (column(4), column(5), column(6));
        let whole = s.one_step(&[&u], &[&y1, &y2], None).unwrap();
        let mut predictor = Predictor::new(&s, None).unwrap();
        let first = predictor
            .step(&[&u[..25]], &[&y1[..25], &y2[..25]])
            .unwrap();
        let second = predictor
            .step(&[&u[25..]], &[&y1[25..], &y2[25..]])
            .unwrap();
        for o in 0..2 {
            let joined = [&first.innovations[o][..], &second.innovations[o][..]].concat();
            assert_eq!(whole.innovations[o], joined);
        }
        assert!(predictor.step(&[&u[..4]], &[&y1[..4], &y2[..3]]).is_err());
    }
}
