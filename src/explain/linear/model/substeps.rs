//! The recursion at a finer step than the samples, for laws whose state decides within an interval.
//!
//! Dry friction on a quick plant reverses within a sample: at the recording's step its sign is decided once an
//! interval, which is another force. The plant between samples follows from its own matrix: with `A_s^m = A` and
//! `(I + A_s + .. + A_s^(m-1)) B_s = B`, `m` steps of `(A_s, B_s)` at a held input are one of `(A, B)`.

use nalgebra::DMatrix;

use super::linear_plant::{Plant, row_major};
use super::time_stepping::{ActiveForce, Grid, run};
use crate::explain::effects::Clock;
use crate::explain::linear::data::Series;

/// Steps a sample that a law is tried with; the error of a step falls with its square, so this takes out most of it.
pub(crate) const STEPS: usize = 4;
/// Most that a document may ask for.
pub(crate) const MOST_STEPS: usize = 64;

/// A plant's matrix between samples.
#[derive(Debug, Clone)]
pub(crate) struct Finer {
    steps: usize,
    /// `A_s`.
    a: DMatrix<f64>,
    /// `(I + A_s + .. + A_s^(m-1))^-1`.
    share: DMatrix<f64>,
}

impl Finer {
    /// `steps` steps a sample; `None` where the plant has no continuous equivalent (a pole on the negative real axis).
    pub(crate) fn new(plant: &Plant, steps: usize) -> Option<Self> {
        let n = plant.states;
        let log = crate::linalg::logarithm(&plant.a_matrix())?;
        let a = crate::linalg::exponential(&(log / steps as f64));
        let mut sum = DMatrix::identity(n, n);
        let mut power = DMatrix::identity(n, n);
        for _ in 1..steps {
            power = &a * power;
            sum += &power;
        }
        Some(Self {
            steps,
            a,
            share: sum.try_inverse()?,
        })
    }

    /// As [`run`] of `plant`, whose state matrix this was made of.
    pub(crate) fn run(
        &self,
        plant: &Plant,
        forces: &[ActiveForce],
        x0: &[f64],
        inputs: &[Vec<f64>],
        samples: usize,
        clock: &Clock,
    ) -> Option<Series> {
        let steps = self.steps;
        let fine = Plant {
            a: row_major(&self.a),
            b: row_major(&(&self.share * plant.b_matrix())),
            sample_time: plant.sample_time / steps as f64,
            ..plant.clone()
        };
        let forces: Vec<ActiveForce> = forces.iter().map(|force| self.force(force)).collect();
        let clock = Clock {
            step: clock.step / steps as f64,
            ..*clock
        };
        run(&fine, &forces, x0, inputs, Grid { samples, steps }, &clock)
    }

    /// A force through its share of the direction.
    fn force(&self, force: &ActiveForce) -> ActiveForce {
        let n = force.direction.len();
        let direction: Vec<f64> = (0..n)
            .map(|i| {
                (0..n)
                    .map(|j| self.share[(i, j)] * force.direction[j])
                    .sum()
            })
            .collect();
        ActiveForce {
            rate_gain: force.rate.iter().zip(&direction).map(|(r, b)| r * b).sum(),
            direction,
            ..force.clone()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explain::linear::fixtures;

    /// Without forces that depend on the motion, fine steps change nothing at the samples.
    #[test]
    fn held_inputs_give_the_same_samples() {
        let plant = fixtures::plant();
        let input = vec![(0..200).map(|k| f64::from(k).sin()).collect::<Vec<f64>>()];
        let clock = Clock {
            start: 0.0,
            step: fixtures::SAMPLE_TIME,
            fresh: false,
        };
        let coarse = run(
            &plant,
            &[],
            &[0.3, -0.1],
            &input,
            Grid::of_samples(200),
            &clock,
        )
        .unwrap();
        let finer = Finer::new(&plant, 4).unwrap();
        let fine = finer
            .run(&plant, &[], &[0.3, -0.1], &input, 200, &clock)
            .unwrap();
        for (a, b) in coarse[0].iter().zip(&fine[0]) {
            assert!((a - b).abs() < 1e-12, "{a} {b}");
        }
    }

    /// A force that is held over a sample does in fine steps what it does in one.
    #[test]
    fn shares_of_a_force_add_up() {
        let plant = fixtures::plant();
        let finer = Finer::new(&plant, 4).unwrap();
        let force = ActiveForce {
            law: |_, _, _| 1.0,
            parameters: Vec::new(),
            position: vec![1.0, 0.0],
            position_feedthrough: vec![0.0],
            rate: vec![0.3, 1.0],
            rate_feedthrough: vec![0.0],
            direction: vec![0.02, -0.7],
            rate_gain: 0.3 * 0.02 - 0.7,
            input: 0,
        };
        let share = finer.force(&force);
        let mut state = [0.0; 2];
        for _ in 0..4 {
            let next = [
                finer.a[(0, 0)] * state[0] + finer.a[(0, 1)] * state[1],
                finer.a[(1, 0)] * state[0] + finer.a[(1, 1)] * state[1],
            ];
            state = [next[0] + share.direction[0], next[1] + share.direction[1]];
        }
        for (sum, whole) in state.iter().zip(&force.direction) {
            assert!((sum - whole).abs() < 1e-12, "{sum} {whole}");
        }
        let gain = 0.3 * share.direction[0] + share.direction[1];
        assert!((share.rate_gain - gain).abs() < 1e-15);
    }

    /// A force that grows with time, summed by a plant that only sums: a step sees the time at which it begins.
    #[test]
    fn time_runs_in_fine_steps() {
        let plant = Plant {
            states: 1,
            a: vec![1.0],
            b: vec![0.0],
            c: vec![1.0],
            ..fixtures::plant()
        };
        let (steps, h, start) = (4, fixtures::SAMPLE_TIME, 3.0);
        let force = ActiveForce {
            law: |_, motion, _| motion.clock.time(motion.sample),
            parameters: Vec::new(),
            position: vec![1.0],
            position_feedthrough: vec![0.0],
            rate: vec![1.0],
            rate_feedthrough: vec![0.0],
            direction: vec![1.0],
            rate_gain: 1.0,
            input: 0,
        };
        let clock = Clock {
            start,
            step: h,
            fresh: false,
        };
        let found = Finer::new(&plant, steps)
            .unwrap()
            .run(&plant, &[force], &[0.0], &[vec![0.0; 20]], 20, &clock)
            .unwrap();
        let mut sum = 0.0;
        for (k, y) in found[0].iter().enumerate() {
            assert!((y - sum).abs() < 1e-9, "{k}: {y} {sum}");
            for i in 0..steps {
                sum += (start + h * (k as f64 + i as f64 / steps as f64)) / steps as f64;
            }
        }
    }
}
