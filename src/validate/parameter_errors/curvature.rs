//! How far the residuals' correlations are from linear in the parameters.
//!
//! First-order theory moves the scores by `Q (theta^ - theta)`. A model from few samples judged on many fresh
//! ones, or one whose states are hardly excited, is off by enough for the next order to matter. Models
//! drawn from the parameter covariance show by how much: the scores of each, less those of the model and
//! less the first order, are the remainder that the covariance of the scores must make room for.

use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::averages::{Averages, Regressor};
use crate::covariance::ParameterLayout;
use crate::linalg::{multiply, spectral_radius};
use crate::model::{Predictor, StateSpace};
use crate::moments::{Detrend, Gram, LagAccumulator};
use crate::validate::residuals::{Partial, Start, cut};
use crate::validate::{RecordView, ValidateError};

/// Pairs of models drawn, one on either side of the estimate.
const PAIRS: usize = 3;
/// The draws are the same in every run.
const SEED: u64 = 20_080_512;

/// Lag products of the residuals of the model and of models drawn from its covariance, on the same samples.
#[derive(Debug)]
pub(super) struct Curvature {
    base: Gram,
    draws: Vec<(DVector<f64>, Gram)>,
    past: usize,
    channels: usize,
}

impl Curvature {
    /// Draws along the columns of `basis`, whose coordinates have unit covariance, and follows the draws over
    /// the first `samples` samples after the start-up of each record.
    pub(crate) fn new(
        system: &StateSpace,
        layout: ParameterLayout,
        basis: &DMatrix<f64>,
        records: &[RecordView<'_>],
        starts: &[Start],
        samples: &[usize],
        past: usize,
    ) -> Result<Self, ValidateError> {
        let theta = DVector::from_vec(layout.pack(system));
        let gram = |system: &StateSpace| lag_products(system, records, starts, samples, past);
        let mut random = ChaCha8Rng::seed_from_u64(SEED);
        let mut draws = Vec::with_capacity(2 * PAIRS);
        let steady = spectral_radius(&system.predictor_matrix())? < 1.0;
        for _ in 0..PAIRS {
            let eta = DVector::from_fn(basis.ncols(), |_, _| StandardNormal.sample(&mut random));
            for eta in [eta.clone(), -eta] {
                let drawn = layout.unpack((&theta + basis * &eta).as_slice(), system);
                // An unstable predictor cannot have come out of an identification.
                if steady && spectral_radius(&drawn.predictor_matrix())? >= 1.0 {
                    continue;
                }
                let gram = gram(&drawn)?;
                if gram.gram.iter().all(|v| v.is_finite()) {
                    draws.push((eta, gram));
                }
            }
        }
        Ok(Self {
            base: gram(system)?,
            draws,
            past,
            channels: system.inputs() + system.outputs(),
        })
    }

    /// Mean square of one entry of the remainder, in units of the scores' own variance.
    pub(super) fn remainder(
        &self,
        partial: &Partial,
        averages: &Averages,
        conditions: &[Regressor],
        tested: &[Regressor],
        target: &[Regressor],
    ) -> f64 {
        if self.draws.is_empty() || partial.dimension() == 0 || self.base.columns == 0 {
            return 0.0;
        }
        let row = |&(channel, lag): &Regressor| (self.past - lag) * self.channels + channel;
        let given: Vec<usize> = conditions.iter().map(row).collect();
        let regressors: Vec<usize> = conditions.iter().chain(tested).map(row).collect();
        let targets: Vec<usize> = target.iter().map(row).collect();
        let n = partial.samples as f64;
        let scale = n * n.sqrt() / self.base.columns as f64;
        let scores = |gram: &DMatrix<f64>| {
            let block = |columns: &[usize]| {
                DMatrix::from_fn(regressors.len(), columns.len(), |i, j| {
                    gram[(regressors[i], columns[j])]
                })
            };
            let products = block(&targets) - block(&given) * partial.coefficients.transpose();
            multiply(&partial.theta, &products) * partial.target.transpose() * scale
        };
        let base = scores(&self.base.gram);
        let total: f64 = self
            .draws
            .iter()
            .map(|(eta, gram)| {
                let linear = &averages.cross * eta * n.sqrt();
                let moved = scores(&gram.gram) - &base;
                moved
                    .iter()
                    .zip(linear.iter())
                    .map(|(moved, linear)| (moved - linear).powi(2))
                    .sum::<f64>()
            })
            .sum();
        total / (self.draws.len() * partial.dimension()) as f64
    }
}

fn lag_products(
    system: &StateSpace,
    records: &[RecordView<'_>],
    starts: &[Start],
    samples: &[usize],
    past: usize,
) -> Result<Gram, ValidateError> {
    let channels = system.inputs() + system.outputs();
    let mut total = Gram::empty((past + 1) * channels);
    for (index, ((record, start), &samples)) in records.iter().zip(starts).zip(samples).enumerate()
    {
        if samples == 0 {
            continue;
        }
        let end = start.dropped + samples;
        let (u, y) = (cut(record.inputs, 0, end), cut(record.outputs, 0, end));
        let errors = Predictor::new(system, Some(&start.state))
            .and_then(|mut predictor| predictor.step(&u, &y))
            .map_err(|source| ValidateError::Data {
                record: index + 1,
                source,
            })?
            .innovations;
        let kept: Vec<&[f64]> = u
            .iter()
            .copied()
            .chain(errors.iter().map(Vec::as_slice))
            .map(|column| &column[start.dropped..])
            .collect();
        let mut accumulator = LagAccumulator::new(channels, past);
        accumulator.push(&kept);
        let moments = accumulator.moments();
        total.add(&moments.gram(past, &moments.trend(Detrend::Mean)));
    }
    Ok(total)
}
