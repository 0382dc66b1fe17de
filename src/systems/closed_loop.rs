//! A plant under a dynamic controller, and the joint model of both.

use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::{TestSystem, channels};
use crate::linalg::{LinalgError, symmetric_square_root_factor};
use crate::log::Log;
use crate::model::StateSpace;

/// Samples that a simulation runs before the recording begins, so that the recording is stationary: a closed
/// loop of spectral radius 0.989 (Chiuso & Picci, example 2) has forgotten its start to 1e-5 by then.
const BURN_IN: usize = 1000;

/// A plant without feedthrough under the controller `u = H(q) y + S r`, `r` white of unit covariance.
#[derive(Debug, Clone)]
pub struct ClosedLoop {
    /// The plant; `D = 0`.
    pub plant: StateSpace,
    /// Covariance of the innovations.
    pub innovation_covariance: DMatrix<f64>,
    /// The controller `H`, from the outputs to the inputs of the plant, with the sign of its action; its
    /// `K` plays no part.
    pub controller: StateSpace,
    /// `S`: what the reference is multiplied by, `r x r`.
    pub reference_gain: DMatrix<f64>,
}

/// `s[k+1] = F s[k] + G w[k]`, `z[k] = H s[k] + J w[k]` with `w = [reference; e]` white of unit covariance and
/// `z = [u; y]`; the state of the plant comes first in `s`.
#[derive(Debug, Clone)]
pub struct JointModel {
    /// Dynamics, square.
    pub transition: DMatrix<f64>,
    /// Effect of `w` on the next state.
    pub noise_to_state: DMatrix<f64>,
    /// Effect of the state on `z`.
    pub output: DMatrix<f64>,
    /// Effect of `w` on `z` in the same sample.
    pub noise_to_output: DMatrix<f64>,
}

impl From<&TestSystem> for ClosedLoop {
    fn from(test: &TestSystem) -> Self {
        let (r, l) = (test.system.inputs(), test.system.outputs());
        Self {
            plant: test.system.clone(),
            innovation_covariance: test.innovation_covariance.clone(),
            controller: StateSpace {
                a: DMatrix::zeros(0, 0),
                b: DMatrix::zeros(0, l),
                c: DMatrix::zeros(r, 0),
                d: test.feedback.clone(),
                k: DMatrix::zeros(0, r),
                sample_time: test.system.sample_time,
            },
            reference_gain: DMatrix::identity(r, r),
        }
    }
}

impl ClosedLoop {
    /// Plant and controller as one linear system driven by white noise.
    ///
    /// # Errors
    /// [`LinalgError`] when the innovation covariance cannot be decomposed.
    pub fn joint(&self) -> Result<JointModel, LinalgError> {
        let (plant, controller) = (&self.plant, &self.controller);
        let (n, m) = (plant.states(), controller.states());
        let (r, l) = (plant.inputs(), plant.outputs());
        let root = symmetric_square_root_factor(&self.innovation_covariance)?;
        // u = Cc xc + Dc (C x + e) + S r,  y = C x + e.
        let mut output = DMatrix::zeros(r + l, n + m);
        let through = &controller.d * &plant.c;
        output.view_mut((0, 0), (r, n)).copy_from(&through);
        output.view_mut((0, n), (r, m)).copy_from(&controller.c);
        output.view_mut((r, 0), (l, n)).copy_from(&plant.c);
        let mut noise_to_output = DMatrix::zeros(r + l, r + l);
        noise_to_output
            .view_mut((0, 0), (r, r))
            .copy_from(&self.reference_gain);
        let of_noise = &controller.d * &root;
        noise_to_output
            .view_mut((0, r), (r, l))
            .copy_from(&of_noise);
        noise_to_output.view_mut((r, r), (l, l)).copy_from(&root);
        // x+ = A x + B u + K e,  xc+ = Ac xc + Bc y.
        let mut drive = DMatrix::zeros(n + m, r + l);
        drive.view_mut((0, 0), (n, r)).copy_from(&plant.b);
        drive.view_mut((n, r), (m, l)).copy_from(&controller.b);
        let mut transition = &drive * &output;
        let mut own = transition.view_mut((0, 0), (n, n));
        own += &plant.a;
        let mut own = transition.view_mut((n, n), (m, m));
        own += &controller.a;
        let mut noise_to_state = &drive * &noise_to_output;
        let gain = &plant.k * &root;
        let mut of_innovation = noise_to_state.view_mut((0, r), (n, l));
        of_innovation += &gain;
        Ok(JointModel {
            transition,
            noise_to_state,
            output,
            noise_to_output,
        })
    }

    /// A stationary recording: the loop has run for a thousand samples before it begins.
    ///
    /// # Errors
    /// [`LinalgError`] when the innovation covariance cannot be decomposed.
    pub fn record(&self, samples: usize, seed: u64) -> Result<Log, LinalgError> {
        let joint = self.joint()?;
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let (r, l) = (self.plant.inputs(), self.plant.outputs());
        let mut state = DVector::<f64>::zeros(joint.transition.nrows());
        let mut noise = DVector::<f64>::zeros(r + l);
        let mut columns = vec![Vec::with_capacity(samples); r + l];
        for k in 0..BURN_IN + samples {
            noise
                .iter_mut()
                .for_each(|v| *v = StandardNormal.sample(&mut random));
            if k >= BURN_IN {
                let z = &joint.output * &state + &joint.noise_to_output * &noise;
                for (column, value) in columns.iter_mut().zip(z.iter()) {
                    column.push(*value);
                }
            }
            state = &joint.transition * &state + &joint.noise_to_state * &noise;
        }
        let output_data = columns.split_off(r);
        Ok(Log {
            name: format!("seed {seed}"),
            sample_time: self.plant.sample_time,
            start_time: 0.0,
            inputs: channels('u', r),
            outputs: channels('y', l),
            input_data: columns,
            output_data,
            sha256: None,
        })
    }
}
