//! The regression of what is left on a term, less what parameters and initial states could do.

use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::noise::{product, sum_of_squares};
use crate::physics::estimate::{Fit, Study};

/// A column of which less than this is left after projection is what parameters can do, but for rounding.
const LEAST_LEFT: f64 = 0.02;
/// A number comes back from its bound where the residual's product with what it does there is larger, in standard deviations: less
/// is the rounding of the fit.
const STEEP: f64 = 0.01;
/// Singular values of columns of length one below this are rounding.
const RANK: f64 = 1e-7;
/// Numbers in a signature.
pub(in crate::explain::engine) const SIGNATURE: usize = 8;

/// What the regression of the residual on terms needs.
pub(in crate::explain::engine) struct Projection {
    directions: Directions,
    inside: Vec<usize>,
    count: usize,
    pub residual: Vec<f64>,
    noise: Vec<[f64; SIGNATURE]>,
    ways_back: Vec<WayBack>,
    /// Normal equations of the ways back.
    normal: DMatrix<f64>,
    right: DVector<f64>,
}

/// Orthogonal directions of what numbers of a fit do.
pub(in crate::explain::engine) struct Directions {
    q: DMatrix<f64>,
    /// What a product with each direction says of the numbers, a row for each number.
    pub numbers: DMatrix<f64>,
}

impl Directions {
    /// Of these columns, one for each number.
    pub(in crate::explain::engine) fn of(mut columns: DMatrix<f64>) -> Option<Self> {
        let mut norms = Vec::new();
        for mut column in columns.column_iter_mut() {
            let norm = column.norm();
            if norm > 0.0 {
                column /= norm;
            }
            norms.push(if norm > 0.0 { norm } else { f64::INFINITY });
        }
        // Nothing is fitted of a static plant without parameters: there is nothing to project off.
        if columns.is_empty() {
            let numbers = DMatrix::zeros(columns.ncols(), 0);
            let q = DMatrix::zeros(columns.nrows(), 0);
            return Some(Self { q, numbers });
        }
        let parts = columns.svd(true, true);
        let (u, v) = (parts.u?, parts.v_t?);
        let kept: Vec<usize> = (0..u.ncols())
            .filter(|&i| parts.singular_values[i] > RANK)
            .collect();
        let numbers = DMatrix::from_fn(norms.len(), kept.len(), |i, j| {
            v[(kept[j], i)] / parts.singular_values[kept[j]] / norms[i]
        });
        let q = u.select_columns(&kept);
        Some(Self { q, numbers })
    }

    /// Projects them off a column; the products with each.
    pub(in crate::explain::engine) fn off(&self, column: &mut [f64]) -> DVector<f64> {
        let rows = self.q.nrows().max(1);
        let products = self.q.as_slice().chunks_exact(rows).map(|q| {
            let along = product(q, column);
            column.iter_mut().zip(q).for_each(|(c, q)| *c -= along * q);
            along
        });
        DVector::from_vec(products.collect())
    }
}

/// What a number at a bound does on its way back, less what the others do.
struct WayBack {
    number: usize,
    column: Vec<f64>,
    products: DVector<f64>,
    /// Change of the number for one unit of the column.
    change: f64,
}

/// The regression of the residual on columns and ways back.
pub(in crate::explain::engine) struct Regression {
    pub values: DVector<f64>,
    pub decrease: f64,
    back: DVector<f64>,
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
        let all = study.all_derivatives(fit)?;
        let inside = study.inside(fit);
        let directions = Directions::of(all.select_columns(&inside))?;
        let mut residual = study.weighted_residual(fit)?;
        let n = residual.len().max(1) as f64;
        let size = (residual.iter().map(|e| e * e).sum::<f64>() / n).sqrt();
        residual.iter_mut().for_each(|e| *e /= size.max(1e-300));
        let mut projection = Self {
            directions,
            inside,
            count: fit.point.len(),
            residual: vec![],
            noise: Vec::new(),
            ways_back: Vec::new(),
            normal: DMatrix::zeros(0, 0),
            right: DVector::zeros(0),
        };
        let mut dice = ChaCha8Rng::seed_from_u64(0);
        projection.noise = (0..residual.len())
            .map(|_| std::array::from_fn(|_| StandardNormal.sample(&mut dice)))
            .collect();
        projection.off(&mut residual);
        projection.residual = residual;
        let bounds = study.at_bounds(fit).into_iter();
        let ways_back = bounds.filter_map(|(number, sign)| {
            let own = all.column(number);
            let change = sign / own.norm();
            let mut column: Vec<f64> = own.iter().map(|d| change * d).collect();
            let products = projection.off(&mut column);
            let left = sum_of_squares(&column);
            (left > LEAST_LEFT * LEAST_LEFT && left.is_finite()).then_some(WayBack {
                number,
                column,
                products,
                change,
            })
        });
        let ways_back = ways_back.collect();
        Some(projection.with_ways_back(ways_back))
    }

    fn with_ways_back(mut self, ways_back: Vec<WayBack>) -> Self {
        let (k, column) = (ways_back.len(), |i: usize| &ways_back[i].column);
        self.normal = DMatrix::from_fn(k, k, |i, j| product(column(i), column(j)));
        self.right = DVector::from_fn(k, |i, _| product(column(i), &self.residual));
        self.ways_back = ways_back;
        self
    }

    /// The regression on columns that are projected off, where numbers at a bound may come back from it: a term that does better what
    /// they were moved for takes them off it, and nothing takes them further (C. L. Lawson and R. J. Hanson, *Solving Least Squares
    /// Problems*, 1974, chapter 23). `ridge` is added to the diagonal of the columns, as a part of the largest.
    pub(in crate::explain::engine) fn regression(
        &self,
        columns: &[Vec<f64>],
        ridge: f64,
    ) -> Option<Regression> {
        let (m, ways) = (columns.len(), self.ways_back.len());
        let back = self.ways_back.iter().map(|way| &way.column);
        let all: Vec<&Vec<f64>> = back.chain(columns).collect();
        // Those of the ways back are known.
        let mut normal = self.normal.clone().resize(ways + m, ways + m, 0.0);
        let mut right = self.right.clone().resize_vertically(ways + m, 0.0);
        for i in ways..ways + m {
            right[i] = product(all[i], &self.residual);
            for j in 0..=i {
                normal[(i, j)] = product(all[i], all[j]);
                normal[(j, i)] = normal[(i, j)];
            }
        }
        let level = normal.view((ways, ways), (m, m)).diagonal().max();
        (ways..ways + m).for_each(|i| normal[(i, i)] += ridge * level);
        let mut moved: Vec<usize> = (ways..ways + m).collect();
        let mut values: DVector<f64> = DVector::zeros(ways + m);
        loop {
            let part = normal.select_rows(&moved).select_columns(&moved);
            let solved = part.cholesky()?.solve(&right.select_rows(&moved));
            let mut goal = DVector::zeros(ways + m);
            (moved.iter().zip(&solved)).for_each(|(&at, value)| goal[at] = *value);
            // As far as no number goes beyond its bound; the first that would stays there.
            let beyond = moved.iter().filter(|&&i| i < ways && goal[i] < 0.0);
            let parts = beyond.map(|&i| (values[i] / (values[i] - goal[i]), i));
            if let Some((part, first)) = parts.min_by(|a, b| a.0.total_cmp(&b.0)) {
                values += part * (goal - &values);
                values[first] = 0.0;
                moved.retain(|&i| i != first);
                continue;
            }
            values = goal;
            let slope = &right - &normal * &values;
            let others = (0..ways).filter(|i| !moved.contains(i));
            let steepest = others.max_by(|&a, &b| slope[a].total_cmp(&slope[b]));
            match steepest.filter(|&i| slope[i] > STEEP * normal[(i, i)].sqrt()) {
                Some(steepest) => moved.push(steepest),
                None => break,
            }
        }
        Some(Regression {
            decrease: values.dot(&right),
            back: values.rows(0, ways).into_owned(),
            values: values.rows(ways, m).into_owned(),
        })
    }

    /// Projects parameters and initial states off; the products with their directions.
    pub(in crate::explain::engine) fn off(&self, column: &mut [f64]) -> DVector<f64> {
        self.directions.off(column)
    }

    /// What the regression adds to each number of the fit beside columns that had these products.
    pub(in crate::explain::engine) fn shift(
        &self,
        products: &[DVector<f64>],
        regression: &Regression,
    ) -> Vec<f64> {
        let columns = products.iter().zip(&regression.values);
        let back = self.ways_back.iter().map(|way| &way.products);
        let all = columns.chain(back.zip(&regression.back));
        let sum = all.map(|(products, value)| products * *value);
        let of_inside = &self.directions.numbers * sum.reduce(|a, b| a + b).unwrap_or_default();
        let mut shift = vec![0.0; self.count];
        for (&i, s) in self.inside.iter().zip(&of_inside) {
            shift[i] = -s;
        }
        for (way, value) in self.ways_back.iter().zip(&regression.back) {
            shift[way.number] = way.change * value;
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
        let mut signature = [0.0; SIGNATURE];
        for (c, noise) in column.iter().zip(&self.noise) {
            for (s, n) in signature.iter_mut().zip(noise) {
                *s += c * n;
            }
        }
        let size = after.sqrt();
        signature.iter_mut().for_each(|s| *s /= size);
        let mut regression = self.regression(&[column], 0.0)?;
        // A term of given size should be there whole.
        if !free {
            let is_there = regression.values[0] > 0.0;
            regression.decrease *= f64::from(u8::from(is_there));
            regression.values[0] = 1.0;
        }
        Some(Tested {
            statistic: regression.decrease,
            strength: regression.values[0],
            shift: self.shift(&[products], &regression),
            signature,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Columns without a pattern.
    fn columns(count: usize) -> Vec<Vec<f64>> {
        let mut dice = ChaCha8Rng::seed_from_u64(7);
        let mut column = || (0..30).map(|_| StandardNormal.sample(&mut dice)).collect();
        (0..count).map(|_| column()).collect()
    }

    fn beside(residual: Vec<f64>, ways: &[Vec<f64>]) -> Projection {
        let ways_back = ways.iter().enumerate().map(|(number, column)| WayBack {
            number,
            column: column.clone(),
            products: DVector::zeros(0),
            change: -2.0,
        });
        let projection = Projection {
            directions: Directions::of(DMatrix::zeros(residual.len(), 0)).unwrap(),
            inside: vec![],
            count: ways.len(),
            noise: vec![[0.0; SIGNATURE]; residual.len()],
            residual,
            ways_back: vec![],
            normal: DMatrix::zeros(0, 0),
            right: DVector::zeros(0),
        };
        projection.with_ways_back(ways_back.collect())
    }

    /// The largest decrease over all subsets of the ways back that go the right way.
    fn of_subsets(columns: &[Vec<f64>], ways: &[Vec<f64>], residual: &[f64]) -> f64 {
        let e = DVector::from_column_slice(residual);
        let subsets = (0..1_usize << ways.len()).filter_map(|subset| {
            let moved = (0..ways.len()).filter(|i| subset >> i & 1 == 1);
            let all: Vec<DVector<f64>> = (columns.iter().chain(moved.map(|i| &ways[i])))
                .map(|c| DVector::from_column_slice(c))
                .collect();
            let all = DMatrix::from_columns(&all);
            let values = all.tr_mul(&all).cholesky()?.solve(&all.tr_mul(&e));
            let right_way = values.iter().skip(columns.len()).all(|v| *v >= 0.0);
            right_way.then(|| e.norm_squared() - (&e - all * values).norm_squared())
        });
        subsets.fold(0.0, f64::max)
    }

    #[test]
    fn numbers_come_back_from_their_bounds_where_that_takes_more_off() {
        let all = columns(60);
        for set in all.chunks_exact(6) {
            let (mut residual, column, ways) = (set[0].clone(), &set[1..2], &set[2..6]);
            // At the optimum without the column no way back takes anything off, and some are held with force.
            for way in ways {
                let along = product(way, &residual) / sum_of_squares(way);
                let most = residual.iter_mut().zip(way);
                most.for_each(|(e, w)| *e -= along.max(0.0) * w);
            }
            let found = beside(residual.clone(), ways)
                .regression(column, 0.0)
                .unwrap();
            let best = of_subsets(column, ways, &residual);
            let less = best - found.decrease;
            assert!(
                (-1e-9..4.0 * STEEP * STEEP).contains(&less),
                "{less} of {best}"
            );
        }
    }

    #[test]
    fn a_number_that_comes_back_is_in_the_shift() {
        let way = vec![1.0, 1.0, 0.0, 0.0];
        // The column does what is left, and something that only the number can take back.
        let projection = beside(vec![-1.0, -1.0, 3.0, 0.0], &[way]);
        let alone = beside(vec![-1.0, -1.0, 3.0, 0.0], &[]);
        let column = vec![-2.0, -2.0, 3.0, 0.0];
        let tested = projection.test(column.clone(), true).unwrap();
        assert!((tested.strength - 1.0).abs() < 1e-12, "{}", tested.strength);
        assert!((tested.shift[0] + 2.0).abs() < 1e-12, "{:?}", tested.shift);
        assert!((tested.statistic - 11.0).abs() < 1e-12);
        assert!(alone.test(column, true).unwrap().statistic < 10.8);
    }
}
