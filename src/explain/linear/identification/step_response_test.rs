//! How well an identified simulation is known.
//!
//! A model that was identified from one recording is never that of another to the last digit. Whether a difference
//! between the plant of the simulation and that of the recording is more than both are uncertain by is asked of their
//! step responses, which do not depend on any choice of the state: Wald's test, with as many degrees of freedom as a
//! plant of this order has numbers.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::covariance::ParameterCovariance;
use crate::explain::linear::fit::{Fit, Problem};
use crate::explain::linear::model::linear_plant::Plant;
use crate::identify::Model;
use crate::linalg::{multiply_nt, spectral_radius, symmetric_eigen};

/// Points of each step response that are compared, a state.
const POINTS_A_STATE: usize = 4;
/// A step response is over after this many of the slowest time constants.
const OVER: f64 = 4.0;
/// ... and after this many samples at the latest.
const LONGEST: f64 = 5000.0;
/// Difference step, in standard deviations along each direction.
const STEP: f64 = 0.1;
/// Directions with less than this share of the largest variance are rounding.
const RANK: f64 = 1e-10;

/// The step responses of an identified model at some times, and their covariance.
#[derive(Debug, Clone)]
pub(crate) struct Uncertainty {
    times: Vec<usize>,
    signals: usize,
    responses: DVector<f64>,
    covariance: DMatrix<f64>,
    /// Numbers that a plant of this order has.
    freedom: usize,
}

impl Uncertainty {
    /// `None` where the model is unstable or its covariance is of no use.
    pub(crate) fn of(model: &Model, covariance: &ParameterCovariance) -> Option<Self> {
        let system = &model.system;
        let times = times(&Plant::from_state_space(system))?;
        let signals = system.inputs();
        let layout = covariance.layout;
        let theta = layout.pack(system);
        let of = |theta: &[f64]| {
            let plant = Plant::from_state_space(&layout.unpack(theta, system));
            responses(&plant, signals, &times)
        };
        let at = of(&theta);
        let covariance = delta_method(&theta, &covariance.matrix, &of)?;
        Some(Self {
            freedom: system.states() * (signals + system.outputs()),
            responses: at,
            times,
            signals,
            covariance,
        })
    }

    /// Probability of a larger difference between the plant of the simulation and that of `fit` when they are the same.
    pub(crate) fn p_value(&self, problem: &Problem, fit: &Fit) -> Option<f64> {
        let mut fit = fit.clone();
        let own = fit.certainty(problem)?.covariance;
        let structure = fit.structure.clone();
        let of =
            |theta: &[f64]| responses(&structure.prepare(theta).plant, self.signals, &self.times);
        let difference = of(&fit.theta) - &self.responses;
        let covariance = &self.covariance + delta_method(&fit.theta, &own, &of)?;
        // Each point in its own standard deviation, then the directions that vary at all.
        let scale = covariance
            .diagonal()
            .map(|v| if v > 0.0 { v.sqrt() } else { 1.0 });
        let m = scale.len();
        let correlation = DMatrix::from_fn(m, m, |i, j| covariance[(i, j)] / (scale[i] * scale[j]));
        let scaled = difference.component_div(&scale);
        let eigen = symmetric_eigen(&correlation).ok()?;
        let mut order: Vec<usize> = (0..m).collect();
        order.sort_by(|a, b| eigen.values[*b].total_cmp(&eigen.values[*a]));
        let largest = eigen.values[*order.first()?];
        let (mut statistic, mut freedom) = (0.0, 0usize);
        for &i in order.iter().take(self.freedom) {
            if eigen.values[i] <= RANK * largest {
                break;
            }
            statistic += eigen.vectors.column(i).dot(&scaled).powi(2) / eigen.values[i];
            freedom += 1;
        }
        ChiSquared::new(freedom as f64)
            .ok()
            .map(|d| d.sf(statistic))
    }
}

/// Sample times, spread evenly over the logarithm, at which step responses of `plant` are compared.
fn times(plant: &Plant) -> Option<Vec<usize>> {
    let radius = spectral_radius(&plant.a_matrix()).ok()?;
    if plant.states == 0 || radius.is_nan() || radius >= 1.0 {
        return None;
    }
    let last = (OVER / -radius.max(1e-3).ln()).clamp(plant.states as f64 + 1.0, LONGEST);
    let count = POINTS_A_STATE * plant.states;
    let mut times: Vec<usize> = (0..count)
        .map(|i| last.powf(i as f64 / (count - 1) as f64).round() as usize)
        .collect();
    times.dedup();
    Some(times)
}

/// Step responses from the first `signals` inputs to all outputs at `times`.
fn responses(plant: &Plant, signals: usize, times: &[usize]) -> DVector<f64> {
    let (a, b, c) = (plant.a_matrix(), plant.b_matrix(), plant.c_matrix());
    let mut found = Vec::with_capacity(times.len() * signals * plant.outputs);
    let last = times.last().copied().unwrap_or(0);
    for input in 0..signals {
        let push = b.column(input);
        let mut x = DVector::zeros(plant.states);
        let mut next = times.iter().peekable();
        for k in 0..=last {
            if next.next_if_eq(&&k).is_some() {
                let y = &c * &x;
                found.extend((0..plant.outputs).map(|o| y[o] + plant.d[o * plant.inputs + input]));
            }
            x = &a * x + push;
        }
    }
    DVector::from_vec(found)
}

/// Covariance of `of(theta)` from that of `theta`, by differences along the directions in which it varies.
fn delta_method(
    theta: &[f64],
    covariance: &DMatrix<f64>,
    of: &dyn Fn(&[f64]) -> DVector<f64>,
) -> Option<DMatrix<f64>> {
    let eigen = symmetric_eigen(covariance).ok()?;
    let largest = eigen.values.iter().copied().fold(0.0, f64::max);
    let mut columns: Vec<DVector<f64>> = Vec::new();
    for (i, value) in eigen.values.iter().enumerate() {
        if *value <= RANK * RANK * largest {
            continue;
        }
        let along = eigen.vectors.column(i) * value.sqrt();
        let moved = |by: f64| -> Vec<f64> {
            theta
                .iter()
                .zip(along.iter())
                .map(|(t, v)| t + by * v)
                .collect()
        };
        columns.push((of(&moved(STEP)) - of(&moved(-STEP))) / (2.0 * STEP));
    }
    if columns.is_empty() {
        return None;
    }
    let root = DMatrix::from_columns(&columns);
    let found = multiply_nt(&root, &root);
    found.iter().all(|v| v.is_finite()).then_some(found)
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;

    use super::*;
    use crate::explain::linear::fit::Effort;
    use crate::explain::linear::fixtures::{recorded, spring};
    use crate::explain::linear::model::structure::Structure;
    use crate::linalg::multiply;

    /// The model of one recording against the fit of another: as often different as the level says, and different where a
    /// spring is one tenth stiffer.
    #[test]
    fn models_of_two_recordings_of_one_plant_are_the_same() {
        let truth = Structure {
            plant_free: true,
            ..spring(Vec::new())
        };
        let theta = truth.given();
        let (mut alarms, runs) = (0, 60);
        for seed in 0..runs {
            let fits = [0, 1].map(|which| {
                let data = recorded(&truth, &theta, 2 * seed + which);
                let problem = Problem::new(&data);
                let fit =
                    Fit::run(&problem, truth.clone(), theta.clone(), None, Effort::FINAL).unwrap();
                let p = |known: &Uncertainty| known.p_value(&problem, &fit).unwrap();
                let own = fit.clone().certainty(&problem).unwrap().covariance;
                let plant = fit.structure.plant(&fit.theta);
                let times = times(&plant).unwrap();
                let of = |theta: &[f64]| responses(&truth.prepare(theta).plant, 1, &times);
                let known = Uncertainty {
                    freedom: 4,
                    responses: of(&fit.theta),
                    covariance: delta_method(&fit.theta, &own, &of).unwrap(),
                    signals: 1,
                    times,
                };
                // Of itself it is never different.
                assert!(p(&known) > 0.999);
                (known, data, fit)
            });
            let problem = Problem::new(&fits[1].1);
            alarms += usize::from(fits[0].0.p_value(&problem, &fits[1].2).unwrap() < 0.05);
            if seed < 5 {
                let mut stiffer = theta.clone();
                stiffer[0] *= 1.1;
                let data = recorded(&truth, &stiffer, 1000 + seed);
                let problem = Problem::new(&data);
                let fit =
                    Fit::run(&problem, truth.clone(), theta.clone(), None, Effort::FINAL).unwrap();
                assert!(fits[0].0.p_value(&problem, &fit).unwrap() < 1e-6);
            }
        }
        // Three in sixty are expected.
        assert!(alarms <= 9, "{alarms} of {runs}");
    }

    #[test]
    fn covariances_are_carried_over() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let root = DMatrix::from_fn(3, 3, |_, _| random.sample::<f64, _>(StandardNormal));
        let map = DMatrix::from_fn(5, 3, |_, _| random.sample::<f64, _>(StandardNormal));
        let covariance = multiply_nt(&root, &root);
        let of = |theta: &[f64]| &map * DVector::from_column_slice(theta);
        let found = delta_method(&[1.0, 2.0, 3.0], &covariance, &of).unwrap();
        let wanted = multiply(&multiply(&map, &covariance), &map.transpose());
        assert!((found - &wanted).norm() < 1e-9 * wanted.norm());
    }
}
