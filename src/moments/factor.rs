//! From the Gram matrix to its triangular factor, with the test that tells whether to trust it.

use nalgebra::DMatrix;

use super::accumulator::LagAccumulator;
use super::gram::Gram;
use super::trend::Trend;
use crate::linalg::{cholesky_upper, qr_r, reciprocal_condition_upper};

/// Below this reciprocal condition of `R`, Cholesky on the Gram matrix loses too many digits and the
/// data go through panels of orthogonal factorisations instead. The error of a quantity computed from
/// the Gram matrix grows with the square of the condition of `R`; measured against a long-double
/// factorisation it stays below 1e-5 of a standard deviation at 1e-6, and Cholesky breaks down at
/// about 1e-8.
const SMALLEST_RECIPROCAL_CONDITION: f64 = 1e-6;

/// How the factor was computed.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum Route {
    /// Lag correlations by FFT, displacement structure, Cholesky.
    LagGram,
    /// Orthogonal factorisation, panel by panel.
    PanelQr,
}

/// The Gram matrix cannot be factored well enough.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MomentError {
    /// Cholesky failed, or the factor is too ill-conditioned for what follows.
    #[error("lag moments are too ill-conditioned for Cholesky (reciprocal condition {0:.1e})")]
    IllConditioned(f64),
}

/// Upper triangular `R` of the scaled and centred data: `R' R = sum_k zeta[k] zeta[k]'`.
#[derive(Debug, Clone)]
pub struct RFactor {
    /// The factor, `(past + 1) q` square, block columns `z[k], ..., z[k+past]`, inputs first in each.
    pub r: DMatrix<f64>,
    /// Past window `p`.
    pub past: usize,
    /// Number of inputs `r`.
    pub inputs: usize,
    /// Number of outputs `l`.
    pub outputs: usize,
    /// Number of windows `Nc`.
    pub columns: usize,
    /// What each channel was divided by (inputs, then outputs).
    pub scale: Vec<f64>,
    /// How it was computed.
    pub route: Route,
    /// Reciprocal condition estimate of the factor.
    pub reciprocal_condition: f64,
}

impl RFactor {
    /// Factors a Gram matrix of unscaled channels by Cholesky.
    ///
    /// # Errors
    /// `MomentError::IllConditioned` asks for the panel route.
    pub fn from_gram(gram: &Gram, inputs: usize, scale: &[f64]) -> Result<Self, MomentError> {
        let q = scale.len();
        let order = gram.gram.nrows();
        let scaled = DMatrix::from_fn(order, order, |i, j| {
            gram.gram[(i, j)] / (scale[i % q] * scale[j % q])
        });
        let r = cholesky_upper(&scaled).map_err(|_| MomentError::IllConditioned(0.0))?;
        let reciprocal_condition = reciprocal_condition_upper(&r);
        if reciprocal_condition < SMALLEST_RECIPROCAL_CONDITION {
            return Err(MomentError::IllConditioned(reciprocal_condition));
        }
        Ok(Self {
            r,
            past: order / q - 1,
            inputs,
            outputs: q - inputs,
            columns: gram.columns,
            scale: scale.to_vec(),
            route: Route::LagGram,
            reciprocal_condition,
        })
    }

    /// Of the samples of one recording as they are, one column a channel, inputs first: nothing removed, nothing scaled,
    /// as in the papers.
    ///
    /// # Errors
    /// As [`RFactor::from_gram`].
    pub fn of_samples(
        channels: &[&[f64]],
        inputs: usize,
        past: usize,
    ) -> Result<Self, MomentError> {
        let mut accumulator = LagAccumulator::new(channels.len(), past);
        accumulator.push(channels);
        let gram = accumulator
            .moments()
            .gram(past, &Trend::zero(channels.len()));
        Self::from_gram(&gram, inputs, &vec![1.0; channels.len()])
    }

    /// Wraps a factor that came from orthogonal panels of data already scaled.
    pub fn from_panels(r: DMatrix<f64>, columns: usize, inputs: usize, scale: &[f64]) -> Self {
        let q = scale.len();
        Self {
            past: r.ncols() / q - 1,
            inputs,
            outputs: q - inputs,
            columns,
            scale: scale.to_vec(),
            route: Route::PanelQr,
            reciprocal_condition: reciprocal_condition_upper(&r),
            r,
        }
    }

    /// Number of channels `q`.
    pub fn channels(&self) -> usize {
        self.inputs + self.outputs
    }

    /// The factor of the first `past + 1` blocks of the same windows, those after them being left out.
    pub fn leading(&self, past: usize) -> RFactor {
        let past = past.min(self.past);
        let order = (past + 1) * self.channels();
        let r = self.r.view((0, 0), (order, order)).into_owned();
        RFactor {
            past,
            reciprocal_condition: if past == self.past {
                self.reciprocal_condition
            } else {
                reciprocal_condition_upper(&r)
            },
            r,
            scale: self.scale.clone(),
            ..*self
        }
    }

    /// The factor for a shorter past window over the *same* windows: the oldest blocks are dropped and
    /// the rest is made triangular again.
    pub fn shortened(&self, past: usize) -> RFactor {
        let q = self.channels();
        let drop = (self.past - past.min(self.past)) * q;
        let kept = self.r.columns(drop, self.r.ncols() - drop).into_owned();
        let r = qr_r(&kept);
        RFactor {
            past,
            reciprocal_condition: reciprocal_condition_upper(&r),
            r,
            scale: self.scale.clone(),
            ..*self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gram() -> Gram {
        let rows = DMatrix::from_fn(12, 40, |i, k| {
            ((i * 31 + k * 17 + i * k) % 23) as f64 - 11.0
        });
        Gram {
            gram: &rows * rows.transpose(),
            columns: 40,
        }
    }

    #[test]
    fn factor_reproduces_the_scaled_gram() {
        let scale = [2.0, 0.5, 4.0];
        let factor = RFactor::from_gram(&gram(), 1, &scale).unwrap();
        assert_eq!((factor.past, factor.outputs), (3, 2));
        let back = factor.r.transpose() * &factor.r;
        for i in 0..12 {
            for j in 0..12 {
                let expected = gram().gram[(i, j)] / (scale[i % 3] * scale[j % 3]);
                approx::assert_relative_eq!(back[(i, j)], expected, epsilon = 1e-8);
            }
        }
    }

    #[test]
    fn shortening_is_the_factor_of_the_last_blocks() {
        let factor = RFactor::from_gram(&gram(), 1, &[1.0; 3]).unwrap();
        let short = factor.shortened(1);
        let expected = gram().gram.view((6, 6), (6, 6)).into_owned();
        approx::assert_relative_eq!(short.r.transpose() * &short.r, expected, epsilon = 1e-8);
    }

    #[test]
    fn leading_factor_is_that_of_the_first_blocks() {
        let factor = RFactor::from_gram(&gram(), 1, &[1.0; 3]).unwrap();
        let short = factor.leading(1);
        assert_eq!((short.past, short.columns), (1, 40));
        let expected = gram().gram.view((0, 0), (6, 6)).into_owned();
        approx::assert_relative_eq!(short.r.transpose() * &short.r, expected, epsilon = 1e-8);
    }

    #[test]
    fn dependent_channels_ask_for_panels() {
        let mut singular = gram();
        let copy = singular.gram.column(0).into_owned();
        singular.gram.set_column(3, &copy);
        let row = singular.gram.row(0).into_owned();
        singular.gram.set_row(3, &row);
        assert!(RFactor::from_gram(&singular, 1, &[1.0; 3]).is_err());
    }
}
