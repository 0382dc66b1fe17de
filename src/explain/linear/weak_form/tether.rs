//! The free run, tethered: coefficients move away from those of the averaged equation only as far as both agree.
//!
//! Free run alone does not determine an integrating plant: mass, friction and offset trade against each other along a
//! flat, rugged valley. The averaged equation does, but leaves small errors that integrate. So the free-run error is
//! minimised with the averaged equation's estimate as a Gaussian prior. The weight of the free run is that of its own
//! error: its variance, and as many samples as are independent.

use nalgebra::{DMatrix, DVector};

use super::equation_of_motion::Equation;
use super::windows::Reading;
use crate::explain::linear::data::{Data, Series};
use crate::explain::linear::effective_samples::effective;
use crate::noise::Mask;

/// Rounds in which the weight of the free run is taken anew, and steps of each.
const ROUNDS: usize = 3;
const STEPS: usize = 25;
/// Difference steps, in standard deviations of the prior.
const STEP: f64 = 1e-3;
/// Samples from which position and rate at the start are estimated, in half windows.
const START_WINDOWS: usize = 2;
/// A start that differs from rest by less than so many standard deviations is one from rest.
const REST: f64 = 3.0;

/// A tethered fit.
#[derive(Debug, Clone)]
pub(crate) struct Tethered {
    pub(crate) coefficients: Vec<f64>,
    pub(crate) covariance: DMatrix<f64>,
    /// Position and rate at the start of each segment.
    pub(crate) starts: Vec<[f64; 2]>,
}

/// Position and rate at the start, each with its variance: a parabola through the first samples; at rest when that
/// cannot be told from it.
fn starts(data: &Data, reading: Reading, half: usize) -> Vec<([f64; 2], [f64; 2])> {
    data.segments
        .iter()
        .map(|segment| {
            let y = &segment.outputs[0];
            let n = (START_WINDOWS * half).min(y.len()).max(4);
            let x = DMatrix::from_fn(n, 3, |k, j| {
                (k as f64 * data.sample_time).powi(j as i32) / if j == 2 { 2.0 } else { 1.0 }
            });
            let t = DVector::from_fn(n, |k, _| y[k]);
            let Some(inverse) = (x.transpose() * &x).try_inverse() else {
                return ([y[0], 0.0], [0.0, 0.0]);
            };
            let c = &inverse * x.transpose() * &t;
            let variance = (&t - &x * &c).norm_squared() / (n - 3).max(1) as f64;
            let var = |j: usize| variance * inverse[(j, j)];
            match reading {
                Reading::Position => {
                    // A jerk that the parabola does not follow counts as error of the rate.
                    let rest = c[1].abs() < REST * var(1).sqrt();
                    let rate = if rest { 0.0 } else { c[1] };
                    ([c[0], rate], [var(0), if rest { 0.0 } else { var(1) }])
                }
                Reading::Velocity => ([c[0], 0.0], [var(0), 0.0]),
            }
        })
        .collect()
}

struct Run<'a> {
    equation: &'a Equation,
    data: &'a Data,
    mask: &'a Mask,
    coefficients: usize,
}

impl Run<'_> {
    /// Splits a vector of coefficients and starts.
    fn split(&self, p: &[f64]) -> (Vec<f64>, Vec<[f64; 2]>) {
        let (c, s) = p.split_at(self.coefficients);
        (
            c.to_vec(),
            s.chunks_exact(2).map(|s| [s[0], s[1]]).collect(),
        )
    }

    /// Free-run errors of the samples that count.
    fn error(&self, p: &[f64]) -> Option<Vec<f64>> {
        let (c, s) = self.split(p);
        let (structure, theta) = self.equation.structure(&c, &s, self.data.sample_time)?;
        let simulated: Series = structure.simulate(&theta, self.data)?;
        Some(
            self.data
                .residual(&simulated)
                .iter()
                .zip(self.mask)
                .flat_map(|(r, m)| r.iter().zip(m).filter(|(_, keep)| **keep).map(|(r, _)| *r))
                .collect(),
        )
    }
}

fn mean_square(e: &[f64]) -> f64 {
    e.iter().map(|v| v * v).sum::<f64>() / e.len().max(1) as f64
}

/// Fits `equation` to the free run over `mask`, with the averaged equation's coefficients and covariance as prior.
pub(crate) fn tether(
    equation: &Equation,
    data: &Data,
    mask: &Mask,
    prior: (&[f64], &DMatrix<f64>),
    half: usize,
) -> Option<Tethered> {
    let (mean, covariance) = prior;
    let run = Run {
        equation,
        data,
        mask,
        coefficients: mean.len(),
    };
    let starts = starts(data, equation.reading, half);
    let mut centre: Vec<f64> = mean.to_vec();
    let mut free: Vec<(usize, f64)> = (0..mean.len()).map(|i| (i, covariance[(i, i)])).collect();
    for (value, variance) in &starts {
        for (v, s) in value.iter().zip(variance) {
            if *s > 0.0 {
                free.push((centre.len(), *s));
            }
            centre.push(*v);
        }
    }
    // Precision of the prior over what is free.
    let m = free.len();
    let mut precision = DMatrix::zeros(m, m);
    let own = covariance.clone().try_inverse()?;
    precision
        .view_mut((0, 0), (mean.len(), mean.len()))
        .copy_from(&own);
    for (i, (_, variance)) in free.iter().enumerate().skip(mean.len()) {
        precision[(i, i)] = 1.0 / variance;
    }
    let mut p = centre.clone();
    let mut e = run.error(&p)?;
    let mut normal = precision.clone();
    for _ in 0..ROUNDS {
        // Weight of one sample: independent samples over all, over the variance.
        let weight = effective(&e).max(1.0) / (e.len() as f64 * mean_square(&e).max(1e-300));
        let away = |p: &[f64]| DVector::from_fn(m, |i, _| p[free[i].0] - centre[free[i].0]);
        let cost = |e: &[f64], p: &[f64]| {
            let d = away(p);
            weight * e.iter().map(|v| v * v).sum::<f64>()
                + (d.transpose() * &precision * &d)[(0, 0)]
        };
        let mut now = cost(&e, &p);
        let mut damping = 1e-3;
        for _ in 0..STEPS {
            let mut columns = DMatrix::zeros(e.len(), m);
            for (i, (at, variance)) in free.iter().enumerate() {
                let step = STEP * variance.sqrt();
                let mut moved = p.clone();
                moved[*at] += step;
                let there = run.error(&moved)?;
                for (row, (a, b)) in there.iter().zip(&e).enumerate() {
                    columns[(row, i)] = (a - b) / step;
                }
            }
            let gram = crate::linalg::multiply_tn(&columns, &columns) * weight;
            let gradient =
                columns.tr_mul(&DVector::from_column_slice(&e)) * weight + &precision * away(&p);
            normal = gram + &precision;
            let mut better = None;
            for _ in 0..6 {
                let mut damped = normal.clone();
                for i in 0..m {
                    damped[(i, i)] *= 1.0 + damping;
                }
                if let Some(step) = damped.cholesky().map(|c| c.solve(&gradient)) {
                    let mut trial = p.clone();
                    for (i, (at, _)) in free.iter().enumerate() {
                        trial[*at] -= step[i];
                    }
                    if let Some(there) = run.error(&trial) {
                        let then = cost(&there, &trial);
                        if then < now {
                            better = Some((trial, there, then));
                            break;
                        }
                    }
                }
                damping *= 8.0;
            }
            let Some((trial, there, then)) = better else {
                break;
            };
            let gained = now - then;
            (p, e, now) = (trial, there, then);
            damping = (damping * 0.2).max(1e-6);
            if gained < 1e-3 {
                break;
            }
        }
    }
    let all = normal.try_inverse()?;
    let (coefficients, starts) = run.split(&p);
    Some(Tethered {
        covariance: all.view((0, 0), (mean.len(), mean.len())).into_owned(),
        coefficients,
        starts,
    })
}
