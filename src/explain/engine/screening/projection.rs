//! The regression of what is left on a term, less what parameters and initial states could do.

use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::noise::{product, sum_of_squares};
use crate::physics::estimate::{Fit, Study};

/// A column of which less than this is left after projection is what parameters can do, but for rounding.
const LEAST_LEFT: f64 = 0.02;
/// Numbers in a signature.
pub(in crate::explain::engine) const SIGNATURE: usize = 8;

/// What the regression of the residual on terms needs.
pub(in crate::explain::engine) struct Projection {
    q: DMatrix<f64>,
    /// What a product with `q` says of the numbers of the fit, a row for each.
    numbers: DMatrix<f64>,
    inside: Vec<usize>,
    count: usize,
    pub residual: Vec<f64>,
    noise: Vec<[f64; SIGNATURE]>,
}

/// What a test says.
pub(in crate::explain::engine) struct Tested {
    pub statistic: f64,
    pub strength: f64,
    /// What the regression adds to each number of the fit beside the term.
    pub shift: Vec<f64>,
    pub signature: [f64; SIGNATURE],
}

impl Projection {
    pub(crate) fn new(study: &Study, fit: &Fit) -> Option<Self> {
        let mut q = study.derivatives(fit)?;
        let mut norms = Vec::new();
        for mut column in q.column_iter_mut() {
            let norm = column.norm();
            if norm > 0.0 {
                column /= norm;
            }
            norms.push(if norm > 0.0 { norm } else { f64::INFINITY });
        }
        // Nothing is fitted of a static plant without parameters: there is nothing to project off.
        let (q, numbers) = if q.is_empty() {
            (q, DMatrix::zeros(0, 0))
        } else {
            let parts = q.svd(true, true);
            let (u, v) = (parts.u?, parts.v_t?);
            let kept: Vec<usize> = (0..u.ncols())
                .filter(|&i| parts.singular_values[i] > 1e-7)
                .collect();
            let numbers = DMatrix::from_fn(norms.len(), kept.len(), |i, j| {
                v[(kept[j], i)] / parts.singular_values[kept[j]] / norms[i]
            });
            (u.select_columns(&kept), numbers)
        };
        let e = fit.noise.whiten_kept(&study.residual(fit)?, study.mask());
        let mut residual: Vec<f64> = e.iter().map(|&e| fit.noise.weight(e) * e).collect();
        let n = residual.len().max(1) as f64;
        let size = (residual.iter().map(|e| e * e).sum::<f64>() / n).sqrt();
        residual.iter_mut().for_each(|e| *e /= size.max(1e-300));
        let mut projection = Self {
            q,
            numbers,
            inside: study.inside(fit),
            count: fit.point.len(),
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

    /// Projects parameters and initial states off; the products with their directions.
    pub(in crate::explain::engine) fn off(&self, column: &mut [f64]) -> DVector<f64> {
        let rows = self.q.nrows().max(1);
        let products = self.q.as_slice().chunks_exact(rows).map(|q| {
            let along = product(q, column);
            column.iter_mut().zip(q).for_each(|(c, q)| *c -= along * q);
            along
        });
        DVector::from_vec(products.collect())
    }

    /// What the regression adds to each number of the fit beside a term whose column had these products.
    pub(in crate::explain::engine) fn shift(&self, products: &DVector<f64>) -> Vec<f64> {
        let of_inside = &self.numbers * products;
        let mut shift = vec![0.0; self.count];
        for (&i, s) in self.inside.iter().zip(&of_inside) {
            shift[i] = -s;
        }
        shift
    }

    /// Tests a whitened column; none where parameters can do the same.
    pub(crate) fn test(&self, mut column: Vec<f64>, free: bool) -> Option<Tested> {
        let before = sum_of_squares(&column);
        let products = self.off(&mut column);
        let after = sum_of_squares(&column);
        if !(after > LEAST_LEFT * LEAST_LEFT * before && after.is_finite()) {
            return None;
        }
        let along = product(&column, &self.residual);
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
            shift: self.shift(&(products * strength)),
            signature,
        })
    }
}
