//! Test systems: the papers' examples and a few of our own, with a simulator for recordings of them.
//!
//! Tests, benches, examples and `data/` all draw from here, so that a number quoted for a system means
//! the same system everywhere.

use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::log::{Channel, Log};
use crate::model::StateSpace;

mod acoustic_duct;
mod chiuso_picci;
mod closed_loop;
mod knudsen;

pub use acoustic_duct::acoustic_duct;
pub use chiuso_picci::{chiuso_picci_frequencies, chiuso_picci_one, chiuso_picci_two};
pub use closed_loop::ClosedLoop;
pub(crate) use closed_loop::JointModel;
pub(crate) use knudsen::armax_parameters;
pub use knudsen::{KnudsenExample, knudsen_armax, knudsen_bj, knudsen_vo};

/// A plant with its noise and, perhaps, the feedback it runs under: `u[k] = F y[k] + reference[k]`.
#[derive(Debug, Clone)]
pub struct TestSystem {
    /// The plant.
    pub system: StateSpace,
    /// Covariance of the innovations.
    pub innovation_covariance: DMatrix<f64>,
    /// Feedback gain `F`, `r x l`; zero for open loop. Needs `D = 0`.
    pub feedback: DMatrix<f64>,
}

impl TestSystem {
    /// A recording with white normal reference of unit variance, from zero initial state.
    pub fn record(&self, samples: usize, seed: u64) -> Log {
        self.record_with(samples, seed, |_, _, white| white)
    }

    /// A recording whose reference is `shape(k, channel, white)` of a white normal sequence.
    pub fn record_with(
        &self,
        samples: usize,
        seed: u64,
        shape: impl FnMut(usize, usize, f64) -> f64,
    ) -> Log {
        let (r, l) = (self.system.inputs(), self.system.outputs());
        let mut input_data = vec![Vec::with_capacity(samples); r];
        let mut output_data = vec![Vec::with_capacity(samples); l];
        for (u, y) in self.samples_with(seed, shape).take(samples) {
            for (column, value) in input_data.iter_mut().zip(u.iter()) {
                column.push(*value);
            }
            for (column, value) in output_data.iter_mut().zip(y.iter()) {
                column.push(*value);
            }
        }
        Log {
            name: format!("seed {seed}"),
            sample_time: self.system.sample_time,
            start_time: 0.0,
            inputs: channels('u', r),
            outputs: channels('y', l),
            input_data,
            output_data,
            sha256: None,
        }
    }

    /// The samples `(u[k], y[k])` of [`TestSystem::record`], one after the other and without end.
    pub fn samples(&self, seed: u64) -> impl Iterator<Item = (DVector<f64>, DVector<f64>)> {
        self.samples_with(seed, |_, _, white| white)
    }

    fn samples_with(
        &self,
        seed: u64,
        mut shape: impl FnMut(usize, usize, f64) -> f64,
    ) -> impl Iterator<Item = (DVector<f64>, DVector<f64>)> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = move || -> f64 { StandardNormal.sample(&mut random) };
        let system = &self.system;
        let (r, l) = (system.inputs(), system.outputs());
        let noise = crate::linalg::symmetric_square_root_factor(&self.innovation_covariance)
            .unwrap_or_else(|_| DMatrix::zeros(l, l));
        let mut x = DVector::zeros(system.states());
        (0..).map(move |k| {
            let reference = DVector::from_fn(r, |i, _| shape(k, i, normal()));
            let e = &noise * DVector::from_fn(l, |_, _| normal());
            let without_feedthrough = &system.c * &x + &e;
            let u = &self.feedback * &without_feedthrough + reference;
            let y = without_feedthrough + &system.d * &u;
            x = &system.a * &x + &system.b * &u + &system.k * e;
            (u, y)
        })
    }

    /// `copies` of the system that have nothing to do with each other, as one system.
    #[must_use]
    pub fn side_by_side(&self, copies: usize) -> Self {
        let diagonal = |block: &DMatrix<f64>| {
            let (rows, columns) = block.shape();
            let mut all = DMatrix::zeros(copies * rows, copies * columns);
            for copy in 0..copies {
                all.view_mut((copy * rows, copy * columns), (rows, columns))
                    .copy_from(block);
            }
            all
        };
        let system = &self.system;
        Self {
            system: StateSpace {
                a: diagonal(&system.a),
                b: diagonal(&system.b),
                c: diagonal(&system.c),
                d: diagonal(&system.d),
                k: diagonal(&system.k),
                sample_time: system.sample_time,
            },
            innovation_covariance: diagonal(&self.innovation_covariance),
            feedback: diagonal(&self.feedback),
        }
    }
}

/// Channels `u1`, `u2`, ... (for the letter `u`) without units.
pub fn channels(letter: char, count: usize) -> Vec<Channel> {
    (1..=count)
        .map(|i| Channel {
            name: format!("{letter}{i}"),
            unit: None,
        })
        .collect()
}

/// van Wingerden, Example I, with `C(1,1) = -0.3749`: the printed `+0.3749` lost its sign (with it the loop
/// is unstable). Fourth order, two inputs, two outputs, in closed loop with `F = 0.5 I`.
pub fn van_wingerden_one() -> TestSystem {
    let system = StateSpace {
        a: DMatrix::from_row_slice(
            4,
            4,
            &[
                0.67, 0.67, 0.0, 0.0, //
                -0.67, 0.67, 0.0, 0.0, //
                0.0, 0.0, -0.67, -0.67, //
                0.0, 0.0, 0.67, -0.67,
            ],
        ),
        b: DMatrix::from_row_slice(
            4,
            2,
            &[
                0.6598, 1.9698, -0.5256, 0.4845, -0.6968, 0.1722, 0.1474, 0.5646,
            ],
        ),
        c: DMatrix::from_row_slice(
            2,
            4,
            &[
                -0.3749, 0.0751, -0.5225, 0.5830, -0.8977, 0.7543, 0.1159, 0.0982,
            ],
        ),
        d: DMatrix::zeros(2, 2),
        k: DMatrix::from_row_slice(
            4,
            2,
            &[
                -0.6968, -0.1474, 0.1722, 0.5646, 0.6484, -0.4660, -0.9400, 0.1032,
            ],
        ),
        sample_time: 1.0,
    };
    TestSystem {
        system,
        innovation_covariance: DMatrix::identity(2, 2),
        feedback: DMatrix::identity(2, 2) * 0.5,
    }
}

/// The system of the public PBSID toolbox that Table 1 of van Wingerden seems to be copied from (its `B`
/// and `K` rows are shuffled in print), with `u = reference - 0.25 y`.
pub fn pbsid_toolbox() -> TestSystem {
    let mut example = van_wingerden_one();
    example.system.b = DMatrix::from_row_slice(
        4,
        2,
        &[
            0.6598, -0.5256, 1.9698, 0.4845, 4.3171, -0.4879, -2.6436, -0.3416,
        ],
    );
    example.feedback = DMatrix::identity(2, 2) * -0.25;
    example
}

/// A servo drive sampled at 1 kHz: voltage to speed, a slow mechanical pole and a belt resonance; disturbances
/// of variance 0.05 enter with the voltage, the measurement noise has variance 0.3, and `K` and `Lambda` are
/// those of the Kalman filter. Open loop.
pub fn servo() -> TestSystem {
    // Poles at 0.99 and 0.97 exp(+-0.12 j), companion form.
    let (slow, radius, angle) = (0.99, 0.97_f64, 0.12_f64);
    let (p, q) = (2.0 * radius * angle.cos(), radius * radius);
    let system = StateSpace {
        a: DMatrix::from_row_slice(
            3,
            3,
            &[
                slow + p,
                -(q + slow * p),
                slow * q, //
                1.0,
                0.0,
                0.0, //
                0.0,
                1.0,
                0.0,
            ],
        ),
        b: DMatrix::from_row_slice(3, 1, &[1.0, 0.0, 0.0]),
        c: DMatrix::from_row_slice(1, 3, &[0.02, 0.015, -0.025]),
        d: DMatrix::zeros(1, 1),
        k: DMatrix::from_row_slice(3, 1, &[15.1169217, 13.21258846, 11.33511664]),
        sample_time: 1e-3,
    };
    TestSystem {
        system,
        innovation_covariance: DMatrix::from_element(1, 1, 0.37327044),
        feedback: DMatrix::zeros(1, 1),
    }
}

/// A two-by-two plant with slow coupled dynamics sampled every 2 s, correlated noise, open loop.
pub fn two_by_two() -> TestSystem {
    let system = StateSpace {
        a: DMatrix::from_row_slice(3, 3, &[0.92, 0.05, 0.0, -0.04, 0.85, 0.1, 0.0, -0.06, 0.7]),
        b: DMatrix::from_row_slice(3, 2, &[0.5, 0.0, 0.1, 0.6, 0.0, -0.4]),
        c: DMatrix::from_row_slice(2, 3, &[1.0, 0.2, 0.0, 0.0, 0.8, -0.5]),
        d: DMatrix::zeros(2, 2),
        k: DMatrix::from_row_slice(3, 2, &[0.3, 0.05, 0.02, 0.2, 0.0, -0.05]),
        sample_time: 2.0,
    };
    TestSystem {
        system,
        innovation_covariance: DMatrix::from_row_slice(2, 2, &[0.25, 0.08, 0.08, 0.16]),
        feedback: DMatrix::zeros(2, 2),
    }
}
