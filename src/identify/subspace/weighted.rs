//! The weighted singular value decomposition that predictor-based methods take their states from.

use nalgebra::DMatrix;

use crate::linalg::{LinalgError, multiply, multiply_tn, svd_thin};

/// A state is seen when its singular value is above this share of the largest: rounding is below it.
const SEEN: f64 = 1e-12;

/// Left singular vectors and values of `W M`, `M` the stacked predictions over the record.
#[derive(Debug, Clone)]
pub struct WeightedSvd {
    /// `U' W`, one row a singular value.
    left: DMatrix<f64>,
    /// Singular values, decreasing.
    pub singular_values: Vec<f64>,
    /// Number of windows in the record.
    columns: usize,
}

impl WeightedSvd {
    /// Of `weight` (`f l` square) times `product` (`f l x m`), a square root of the predictions over `columns` windows.
    ///
    /// # Errors
    /// [`LinalgError`] when the decomposition does not converge.
    pub(crate) fn new(
        weight: &DMatrix<f64>,
        product: &DMatrix<f64>,
        columns: usize,
    ) -> Result<Self, LinalgError> {
        let svd = svd_thin(&multiply(weight, product))?;
        let mut left = svd.u;
        for mut column in left.column_iter_mut() {
            // The sign of a singular vector is arbitrary: fix it, so that results are reproducible.
            if column[column.icamax()] < 0.0 {
                column.neg_mut();
            }
        }
        Ok(Self {
            left: multiply_tn(&left, weight),
            singular_values: svd.values.iter().copied().collect(),
            columns,
        })
    }

    /// Largest order that the decomposition can give.
    pub fn largest_order(&self) -> usize {
        let first = self.singular_values.first().copied().unwrap_or(0.0);
        self.singular_values
            .iter()
            .take_while(|&&s| s > first * SEEN)
            .count()
    }

    /// The map `S` (`n x f l`) from the stacked predictions to the state, van Wingerden (29), scaled so that the states
    /// have unit variance over the record.
    pub fn state_map(&self, order: usize) -> DMatrix<f64> {
        let mut map = self.left.rows(0, order).into_owned();
        for (i, mut row) in map.row_iter_mut().enumerate() {
            row *= (self.columns as f64).sqrt() / self.singular_values[i];
        }
        map
    }
}

/// The identity weight in the user's units for channels that are scaled: the scale of each output, in each of `blocks`
/// blocks.
pub(super) fn in_users_units(scale: &[f64], blocks: usize) -> DMatrix<f64> {
    let outputs = scale.len();
    let order = blocks * outputs;
    DMatrix::from_fn(
        order,
        order,
        |i, j| {
            if i == j { scale[i % outputs] } else { 0.0 }
        },
    )
}
