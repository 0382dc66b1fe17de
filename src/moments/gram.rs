//! Gram matrices add: several experiments of one plant, or all blocks but one.

use nalgebra::DMatrix;

/// `sum_k zeta[k] zeta[k]'` with its number of terms.
#[derive(Debug, Clone, PartialEq)]
pub struct Gram {
    /// The sum, `(past + 1) q` square.
    pub gram: DMatrix<f64>,
    /// Number of windows summed.
    pub columns: usize,
}

impl Gram {
    /// No window at all.
    pub fn empty(order: usize) -> Self {
        Self {
            gram: DMatrix::zeros(order, order),
            columns: 0,
        }
    }

    /// Adds another experiment's.
    pub fn add(&mut self, other: &Gram) {
        self.gram += &other.gram;
        self.columns += other.columns;
    }

    /// Takes a part out again.
    pub fn without(&self, part: &Gram) -> Gram {
        Gram {
            gram: &self.gram - &part.gram,
            columns: self.columns - part.columns,
        }
    }
}
