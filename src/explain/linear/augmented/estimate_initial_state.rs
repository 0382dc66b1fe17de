//! The state at the first sample of another recording.

use nalgebra::{DMatrix, DVector};

use super::simulate_augmented::AugmentedError;
use crate::explain::explanation::AugmentedModel;
use crate::explain::linear::data::deviation;

/// Samples that an initial state is estimated from, at most.
const INITIAL_SAMPLES: usize = 2000;
/// Weight of the prior of an initial state: one sample's worth.
const PRIOR: f64 = 1e-4;
/// Steps of the search, at most.
const STEPS: usize = 40;

/// What is known of the state beforehand, in units of the errors of the scaled outputs.
struct Prior {
    mean: DVector<f64>,
    weight: DMatrix<f64>,
    spread: Vec<f64>,
}

impl Prior {
    fn cost(&self, x: &DVector<f64>) -> f64 {
        let e = x - &self.mean;
        e.dot(&(&self.weight * &e))
    }
}

impl AugmentedModel {
    /// The initial state with which the model reproduces the first samples of `outputs` best, by a few steps of Gauss
    /// and Newton. A wide prior around 0 (maximum a posteriori) keeps
    /// directions sensible which few samples do not determine.
    ///
    /// # Errors
    /// As [`AugmentedModel::simulate`].
    pub fn estimate_initial_state(
        &self,
        inputs: &[&[f64]],
        outputs: &[&[f64]],
    ) -> Result<Vec<f64>, AugmentedError> {
        // A drive integrates: over a longer stretch the start would make up for whatever the model misses.
        let most = self.mechanics.as_ref().map_or(INITIAL_SAMPLES, |m| {
            ((m.window / self.sample_time).ceil() as usize).saturating_add(1)
        });
        let length = inputs.first().map_or(0, |u| u.len());
        let l = self.outputs.len();
        if outputs.len() != l || outputs.iter().any(|y| y.len() != length) {
            return Err(AugmentedError::Outputs {
                needed: l,
                found: outputs.len(),
            });
        }
        if inputs.iter().any(|u| u.len() != length) {
            return Err(AugmentedError::Inputs {
                needed: self.inputs.len(),
                found: inputs.len(),
            });
        }
        let samples = length.min(most);
        let inputs: Vec<&[f64]> = inputs.iter().map(|u| &u[..samples]).collect();
        let scale: Vec<f64> = outputs
            .iter()
            .map(|y| deviation(y[..samples].iter()))
            .collect();
        let prior = self.prior(&scale);
        let error = |x: &DVector<f64>| -> Result<DVector<f64>, AugmentedError> {
            let y = self.run(&inputs, Some(x.as_slice()))?;
            Ok(DVector::from_iterator(
                l * samples,
                (0..l).flat_map(|o| {
                    let (y, scale) = (&y[o], scale[o]);
                    (0..samples).map(move |k| (outputs[o][k] - y[k]) / scale)
                }),
            ))
        };
        // Where the cost has kinks (a lost sign) the search ends at the next minimum: it starts from several.
        let mut best = climb(&error, &prior, prior.mean.clone())?;
        if self.has_kinks() {
            for i in 0..prior.mean.len() {
                for side in [-1.0, 1.0] {
                    let mut start = prior.mean.clone();
                    start[i] += side * prior.spread[i];
                    if let Ok(found) = climb(&error, &prior, start)
                        && found.1 < best.1
                    {
                        best = found;
                    }
                }
            }
        }
        Ok(best.0.iter().copied().collect())
    }

    /// Whether the outputs are no smooth function of the initial state.
    fn has_kinks(&self) -> bool {
        self.effects
            .iter()
            .any(|e| e.effect == "sensor_rectification")
    }

    fn prior(&self, scale: &[f64]) -> Prior {
        let n = self.a.0.nrows();
        let spread = 3.0 * scale.iter().copied().fold(0.0, f64::max);
        Prior {
            mean: DVector::zeros(n),
            weight: DMatrix::identity(n, n) * (PRIOR / (spread * spread)),
            spread: vec![spread; n],
        }
    }
}

/// Scaled errors of the outputs from an initial state.
type Errors<'a> = dyn Fn(&DVector<f64>) -> Result<DVector<f64>, AugmentedError> + 'a;

/// Levenberg and Marquardt from `x` on: the state and its cost.
fn climb(
    error: &Errors,
    prior: &Prior,
    mut x: DVector<f64>,
) -> Result<(DVector<f64>, f64), AugmentedError> {
    let n = x.len();
    let mut e = error(&x)?;
    let mut cost = e.norm_squared() + prior.cost(&x);
    let mut damping = 1e-3;
    for _ in 0..STEPS {
        let mut columns = DMatrix::zeros(e.len(), n);
        for i in 0..n {
            let step = 1e-6 * prior.spread[i];
            let mut moved = x.clone();
            moved[i] += step;
            columns.set_column(i, &((&e - error(&moved)?) / step));
        }
        let mut gram = columns.tr_mul(&columns);
        for i in 0..n {
            gram[(i, i)] *= 1.0 + damping;
        }
        let right = columns.tr_mul(&e) - &prior.weight * (&x - &prior.mean);
        let Some(step) = (gram + &prior.weight).cholesky().map(|c| c.solve(&right)) else {
            break;
        };
        let trial = &x + step;
        let now = error(&trial).map(|e| (e.norm_squared() + prior.cost(&trial), e));
        match now {
            Ok((now, ahead)) if now < cost => {
                let settled = cost - now < 1e-9 * cost;
                x = trial;
                e = ahead;
                cost = now;
                damping *= 0.2;
                if settled {
                    break;
                }
            }
            _ => damping = f64::max(damping * 10.0, 1e-6),
        }
        if damping > 1e9 {
            break;
        }
    }
    Ok((x, cost))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explain::linear::fixtures::{effect, spring};
    use crate::log::Channel;

    fn prior(mean: [f64; 2], weight: [f64; 4]) -> Prior {
        Prior {
            mean: DVector::from_row_slice(&mean),
            weight: DMatrix::from_row_slice(2, 2, &weight),
            spread: vec![1.0, 10.0],
        }
    }

    #[test]
    fn linear_errors_give_the_posterior_mean() {
        let h = DMatrix::from_row_slice(3, 2, &[1.0, 0.3, -2.0, 0.5, 0.1, 0.0]);
        let y = DVector::from_row_slice(&[3.0, -1.0, 2.0]);
        let prior = prior([5.0, -7.0], [0.8, 0.2, 0.2, 0.3]);
        let error = |x: &DVector<f64>| Ok(&y - &h * x);
        let (found, cost) = climb(&error, &prior, DVector::zeros(2)).unwrap();
        let right = h.tr_mul(&y) + &prior.weight * &prior.mean;
        let expected = (h.tr_mul(&h) + &prior.weight)
            .cholesky()
            .unwrap()
            .solve(&right);
        assert!(
            (&found - &expected).norm() < 1e-6 * expected.norm(),
            "{found}"
        );
        let off = &expected - &prior.mean;
        let there = (&y - &h * &expected).norm_squared() + off.dot(&(&prior.weight * &off));
        assert!((cost - there).abs() < 1e-9 * there);
    }

    #[test]
    fn a_bent_valley_is_followed_to_its_end() {
        let error = |x: &DVector<f64>| {
            Ok(DVector::from_row_slice(&[
                1.0 - x[0],
                10.0 * (x[1] - x[0] * x[0]),
            ]))
        };
        let prior = prior([0.0, 0.0], [1e-12, 0.0, 0.0, 1e-12]);
        let start = DVector::from_row_slice(&[-1.2, 1.0]);
        let (found, cost) = climb(&error, &prior, start).unwrap();
        assert!(
            (found[0] - 1.0).abs() < 1e-4 && (found[1] - 1.0).abs() < 1e-4,
            "{found}"
        );
        assert!(cost < 1e-8);
    }

    #[test]
    fn lost_signs_have_kinks() {
        let structure = spring(vec![effect("cubic_stiffness", "")]);
        let channels = [Channel::new("c")];
        let mut model =
            AugmentedModel::describe(&structure, &[0.1], &channels, &channels, &[0], false);
        for (id, kinks) in [
            ("sensor_rectification", true),
            ("sensor_saturation", false),
            ("cubic_stiffness", false),
        ] {
            model.effects[0].effect = id.to_owned();
            assert_eq!(model.has_kinks(), kinks, "{id}");
        }
    }
}
