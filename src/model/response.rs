//! Responses in time.

use nalgebra::DMatrix;

use super::model_error::ModelError;
use super::state_space::StateSpace;

/// Settled to `exp(-5)`, less than one percent.
const TIME_CONSTANTS_SHOWN: f64 = 5.0;

impl StateSpace {
    /// Impulse response (Markov parameters) `D, C B, C A B, ...` for samples `0 .. samples`, each `l x r`.
    pub fn impulse_response(&self, samples: usize) -> Vec<DMatrix<f64>> {
        let mut state = self.b.clone();
        (0..samples)
            .map(|k| {
                if k == 0 {
                    return self.d.clone();
                }
                let value = &self.c * &state;
                state = &self.a * &state;
                value
            })
            .collect()
    }

    /// Step response from rest for samples `0 .. samples`, each `l x r`: the running sum of the impulse
    /// response.
    pub fn step_response(&self, samples: usize) -> Vec<DMatrix<f64>> {
        let mut sum = DMatrix::zeros(self.outputs(), self.inputs());
        self.impulse_response(samples)
            .into_iter()
            .map(|value| {
                sum += value;
                sum.clone()
            })
            .collect()
    }

    /// Static (DC) gain `C (I - A)^-1 B + D` (`l x r`); `None` with an integrator. For an unstable model
    /// it is the equilibrium, which the model does not reach by itself.
    pub fn static_gain(&self) -> Option<DMatrix<f64>> {
        let n = self.states();
        if n == 0 {
            return Some(self.d.clone());
        }
        // A factorisation of I - A seldom notices an integrator: rounding leaves a pivot of 1e-17.
        if self.poles().ok()?.iter().any(|pole| pole.damping.is_none()) {
            return None;
        }
        let gain = &self.c * (DMatrix::identity(n, n) - &self.a).lu().solve(&self.b)? + &self.d;
        gain.iter().all(|v| v.is_finite()).then_some(gain)
    }

    /// Samples after which the step response has settled: five time constants of the slowest stable
    /// pole, at least 20 and at most `most`.
    ///
    /// # Errors
    /// [`ModelError::Linalg`] when the poles cannot be computed.
    pub fn settling_samples(&self, most: usize) -> Result<usize, ModelError> {
        let slowest = self
            .poles()?
            .iter()
            .filter_map(|pole| pole.time_constant)
            .fold(0.0, f64::max);
        let samples = TIME_CONSTANTS_SHOWN * slowest / self.sample_time;
        Ok((samples.min(most as f64).ceil() as usize).clamp(20.min(most), most))
    }
}

#[cfg(test)]
#[path = "tests/response_tests.rs"]
mod tests;
