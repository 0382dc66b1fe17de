//! Responses in time.

use nalgebra::DMatrix;

use super::error::ModelError;
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
mod tests {
    use super::*;
    use nalgebra::dmatrix;

    fn system() -> StateSpace {
        StateSpace::deterministic(
            dmatrix![0.5, 0.3; -0.3, 0.4],
            dmatrix![1.0, 0.0; 0.5, 1.0],
            dmatrix![1.0, 2.0],
            dmatrix![0.0, 0.5],
            0.2,
        )
        .unwrap()
    }

    #[test]
    fn responses_equal_simulations() {
        let s = system();
        let zero = [0.0; 30];
        let mut pulse = [0.0; 30];
        pulse[0] = 1.0;
        let impulse = s.impulse_response(30);
        let step = s.step_response(30);
        let simulated = s.simulate(&[&zero, &pulse], None).unwrap();
        let stepped = s.simulate(&[&[1.0; 30], &zero], None).unwrap();
        for k in 0..30 {
            assert!((impulse[k][(0, 1)] - simulated[0][k]).abs() < 1e-14);
            assert!((step[k][(0, 0)] - stepped[0][k]).abs() < 1e-13);
        }
    }

    #[test]
    fn step_settles_at_the_static_gain() {
        let s = system();
        let last = s.step_response(200).pop().unwrap();
        approx::assert_relative_eq!(last, s.static_gain().unwrap(), epsilon = 1e-12);
        let integrator = StateSpace::deterministic(
            dmatrix![1.0],
            dmatrix![1.0],
            dmatrix![1.0],
            dmatrix![0.0],
            1.0,
        )
        .unwrap();
        assert_eq!(integrator.static_gain(), None);
        assert_eq!(integrator.settling_samples(500).unwrap(), 20);
    }

    #[test]
    fn settling_follows_the_slowest_pole() {
        let mut s = system();
        s.a = dmatrix![0.9, 0.0; 0.0, 0.5];
        // 5 / -ln(0.9) = 47.5
        assert_eq!(s.settling_samples(1000).unwrap(), 48);
        assert_eq!(s.settling_samples(30).unwrap(), 30);
    }
}
