//! The regression of what is left on a term, less what parameters and initial states could do.

use nalgebra::DMatrix;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::physics::estimate::{Fit, Study};

/// A column of which less than this is left after projection is what parameters can do, but for rounding.
const LEAST_LEFT: f64 = 0.02;
/// Numbers in a signature.
pub(super) const SIGNATURE: usize = 8;

/// What the regression of the residual on terms needs.
pub(super) struct Projection {
    q: DMatrix<f64>,
    pub(super) residual: Vec<f64>,
    noise: Vec<[f64; SIGNATURE]>,
}

/// What a test says.
pub(super) struct Tested {
    pub(super) statistic: f64,
    pub(super) strength: f64,
    pub(super) signature: [f64; SIGNATURE],
}

impl Projection {
    pub(crate) fn new(study: &Study, fit: &Fit) -> Option<Self> {
        let mut q = study.derivatives(fit)?;
        for mut column in q.column_iter_mut() {
            let norm = column.norm();
            if norm > 0.0 {
                column /= norm;
            }
        }
        let parts = q.svd(true, false);
        let u = parts.u?;
        let kept: Vec<usize> = (0..u.ncols())
            .filter(|&i| parts.singular_values[i] > 1e-7)
            .collect();
        let q = u.select_columns(&kept);
        let e = fit.noise.whiten_kept(&study.residual(fit)?, study.mask());
        let mut residual: Vec<f64> = e.iter().map(|&e| fit.noise.weight(e) * e).collect();
        let n = residual.len().max(1) as f64;
        let size = (residual.iter().map(|e| e * e).sum::<f64>() / n).sqrt();
        residual.iter_mut().for_each(|e| *e /= size.max(1e-300));
        let mut projection = Self {
            q,
            residual: vec![],
            noise: Vec::new(),
        };
        let mut dice = ChaCha8Rng::seed_from_u64(0);
        projection.noise = (0..residual.len())
            .map(|_| std::array::from_fn(|_| StandardNormal.sample(&mut dice)))
            .collect();
        projection.off(&mut residual);
        projection.residual = residual;
        Some(projection)
    }

    pub(crate) fn off(&self, column: &mut [f64]) {
        for q in self.q.column_iter() {
            let along: f64 = q.iter().zip(column.iter()).map(|(q, c)| q * c).sum();
            column
                .iter_mut()
                .zip(q.iter())
                .for_each(|(c, q)| *c -= along * q);
        }
    }

    /// Tests a whitened column; none where parameters can do the same.
    pub(crate) fn test(&self, mut column: Vec<f64>, free: bool) -> Option<Tested> {
        let square = |c: &[f64]| c.iter().map(|v| v * v).sum::<f64>();
        let before = square(&column);
        self.off(&mut column);
        let after = square(&column);
        if !(after > LEAST_LEFT * LEAST_LEFT * before && after.is_finite()) {
            return None;
        }
        let along: f64 = column.iter().zip(&self.residual).map(|(c, r)| c * r).sum();
        let mut signature = [0.0; SIGNATURE];
        for (c, noise) in column.iter().zip(&self.noise) {
            for (s, n) in signature.iter_mut().zip(noise) {
                *s += c * n;
            }
        }
        let size = after.sqrt();
        signature.iter_mut().for_each(|s| *s /= size);
        // A term of given size should be there whole.
        let (statistic, strength) = if free {
            (along * along / after, along / after)
        } else {
            (along.max(0.0).powi(2) / after, 1.0)
        };
        Some(Tested {
            statistic,
            strength,
            signature,
        })
    }
}
