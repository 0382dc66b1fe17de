//! How well the numbers of a fit are known.

use nalgebra::DMatrix;

use super::gauss_newton::Jacobian;
use super::{Fit, Problem};

/// How well the numbers of a fit are known.
#[derive(Debug, Clone)]
pub(crate) struct Certainty {
    /// Covariance of the numbers; those that move nothing have none.
    pub(crate) covariance: DMatrix<f64>,
    /// How far the two halves of the recordings disagree about each number, in standard deviations of the difference:
    /// one Gauss-Newton step of each half from the common optimum, which is as good as a fit of each (one-step
    /// estimation, Le Cam 1956). Numbers that move nothing disagree by zero. None where a half does not determine all.
    pub(crate) halves_disagree: Option<Vec<f64>>,
}

impl Fit {
    /// How well the numbers are known.
    pub(crate) fn certainty(&mut self, problem: &Problem) -> Option<Certainty> {
        let mut slopes = self.sensitivities(problem);
        let held = self.structure.held();
        for (i, slope) in slopes.iter_mut().enumerate() {
            if slope.is_none() && !held[i] {
                *slope = self.secant(problem, i);
            }
        }
        let jacobian = Jacobian::new(problem, &self.noise, &slopes)?;
        let system = |only: Option<&[bool]>| {
            jacobian.normal_equations(problem, &self.noise, &self.residual, only)
        };
        let first: Vec<bool> = problem
            .mask
            .iter()
            .flat_map(|mask| {
                let n = mask.len();
                mask.iter()
                    .enumerate()
                    .filter_map(move |(k, keep)| keep.then_some(2 * k < n))
            })
            .collect();
        let second: Vec<bool> = first.iter().map(|first| !first).collect();
        let half = |rows: &[bool]| {
            let system = system(Some(rows));
            Some((system.step(0.0)?, system.covariance()?))
        };
        let halves = half(&first).zip(half(&second));
        Some(Certainty {
            covariance: system(None).covariance()?,
            halves_disagree: halves.map(|((a, va), (b, vb))| {
                (0..self.theta.len())
                    .map(|i| {
                        let variance = va[(i, i)] + vb[(i, i)];
                        if variance > 0.0 {
                            (a[i] - b[i]).abs() / variance.sqrt()
                        } else {
                            0.0
                        }
                    })
                    .collect()
            }),
        })
    }
}
