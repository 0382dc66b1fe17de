//! Invariant zeros.
//!
//! They are the `z` where `P(z) = [A - zI, B; C, D]` loses rank. The generalised eigenvalues of this
//! pencil hold the zeros at infinity too, one for each output and each step of delay, in Jordan blocks
//! that rounding scatters over `1 / eps^(1/d)`: for a delay of `d = 4` samples they look like finite zeros
//! of modulus 1e3, and no threshold tells them apart. So the infinite zeros are taken out first, with
//! orthogonal transformations and rank decisions only (Emami-Naeini & Van Dooren, *Computation of zeros of
//! linear multivariable systems*, Automatica 18, 1982, the method of SLICOT's AB08ND): outputs without
//! feedthrough are replaced by what their being zero says about the states, until the feedthrough has full
//! row rank; the same on the transposed system makes it square and invertible; the zeros are then ordinary
//! finite eigenvalues. This handles systems that are not square as well: generically they have no zero.

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;

use super::model_error::ModelError;
use super::poles::{Pole, slowest_first};
use super::state_space::StateSpace;
use crate::linalg::{generalised_eigenvalues, svd_thin};

/// A zero farther out than this counts as infinite: its inverse is below what an estimated model holds.
const FARTHEST: f64 = 1e8;

/// A zero whose left and right directions are closer to orthogonal than this is multiple to working
/// precision, and has no derivative.
const MULTIPLE: f64 = 1e-7;

/// The directions of an invariant zero: `[w1; w2]^T P(z) = 0` and `P(z) [v1; v2] = 0`, left ones scaled so
/// that `w1^T v1 = 1`.
#[derive(Debug, Clone)]
pub(crate) struct ZeroDirections {
    /// `w1` (`n`).
    pub(crate) left_state: DVector<Complex64>,
    /// `w2` (`l`).
    pub(crate) left_output: DVector<Complex64>,
    /// `v1` (`n`).
    pub(crate) right_state: DVector<Complex64>,
    /// `v2` (`r`).
    pub(crate) right_input: DVector<Complex64>,
}

/// The matrices of `P(z)` with inputs and outputs scaled to unit size, which leaves the zeros alone.
#[derive(Debug, Clone)]
struct Pencil {
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    c: DMatrix<f64>,
    d: DMatrix<f64>,
}

impl StateSpace {
    /// Invariant zeros from input to output, with their continuous-time reading (which for a zero speaks
    /// of how fast the input that it blocks decays); largest modulus first.
    ///
    /// # Errors
    /// [`ModelError::Linalg`] when a factorisation fails.
    pub fn zeros(&self) -> Result<Vec<Pole>, ModelError> {
        if self.inputs() == 0 {
            return Ok(Vec::new());
        }
        let (pencil, _, _) = Pencil::scaled(self);
        let tolerance = pencil.tolerance();
        let reduced = pencil.reduce(tolerance)?.transpose().reduce(tolerance)?;
        let values = reduced.finite_zeros()?;
        Ok(slowest_first(&values)
            .into_iter()
            .map(|i| Pole::new(values[i], self.sample_time))
            .collect())
    }
}

impl Pencil {
    /// With unit columns `[B; D]` and unit rows `[C D]`; returns the factors of columns and rows too.
    fn scaled(system: &StateSpace) -> (Self, Vec<f64>, Vec<f64>) {
        let unit = |norm: f64| if norm > 0.0 { 1.0 / norm } else { 1.0 };
        let (mut b, mut c, mut d) = (system.b.clone(), system.c.clone(), system.d.clone());
        let mut columns = Vec::with_capacity(b.ncols());
        for j in 0..b.ncols() {
            let factor = unit(b.column(j).norm().hypot(d.column(j).norm()));
            b.column_mut(j).scale_mut(factor);
            d.column_mut(j).scale_mut(factor);
            columns.push(factor);
        }
        let mut rows = Vec::with_capacity(c.nrows());
        for i in 0..c.nrows() {
            let factor = unit(c.row(i).norm().hypot(d.row(i).norm()));
            c.row_mut(i).scale_mut(factor);
            d.row_mut(i).scale_mut(factor);
            rows.push(factor);
        }
        let a = system.a.clone();
        (Self { a, b, c, d }, columns, rows)
    }

    /// Below this a singular value counts as zero in the rank decisions.
    fn tolerance(&self) -> f64 {
        let (n, r, l) = (self.a.nrows(), self.b.ncols(), self.c.nrows());
        let norm = [&self.a, &self.b, &self.c, &self.d]
            .iter()
            .map(|m| m.norm_squared())
            .sum::<f64>()
            .sqrt();
        100.0 * ((n + r) * (n + l)) as f64 * f64::EPSILON * norm
    }

    fn transpose(self) -> Self {
        Self {
            a: self.a.transpose(),
            b: self.c.transpose(),
            c: self.b.transpose(),
            d: self.d.transpose(),
        }
    }

    /// The pencil with the same finite zeros whose `D` has full row rank.
    fn reduce(mut self, tolerance: f64) -> Result<Self, ModelError> {
        loop {
            let (l, n) = self.c.shape();
            if l == 0 || n == 0 {
                return Ok(self);
            }
            let (u, rank) = left_basis(&self.d, tolerance)?;
            if rank == l {
                return Ok(self);
            }
            let c = u.tr_mul(&self.c);
            let d = u.tr_mul(&self.d);
            let hidden = c.rows(rank, l - rank).into_owned();
            let (v, seen) = left_basis(&hidden.transpose(), tolerance)?;
            if seen == 0 {
                self.c = c.rows(0, rank).into_owned();
                self.d = d.rows(0, rank).into_owned();
                return Ok(self);
            }
            // States along the first `seen` columns of v must vanish for these outputs to vanish; the
            // next value of these states becomes the output in their place.
            let keep = n - seen;
            let gone = v.columns(0, seen);
            let kept = v.columns(seen, keep);
            let new_rows = rank + seen;
            let mut new_c = DMatrix::zeros(new_rows, keep);
            new_c.rows_mut(0, rank).copy_from(&(c.rows(0, rank) * kept));
            new_c
                .rows_mut(rank, seen)
                .copy_from(&(gone.transpose() * &self.a * kept));
            let mut new_d = DMatrix::zeros(new_rows, d.ncols());
            new_d.rows_mut(0, rank).copy_from(&d.rows(0, rank));
            new_d
                .rows_mut(rank, seen)
                .copy_from(&(gone.transpose() * &self.b));
            self = Self {
                a: kept.transpose() * &self.a * kept,
                b: kept.transpose() * &self.b,
                c: new_c,
                d: new_d,
            };
        }
    }

    /// Zeros of a reduced pencil (square and invertible `D`), on the null space of `[C D]`.
    fn finite_zeros(&self) -> Result<Vec<Complex64>, ModelError> {
        let (n, m) = (self.a.nrows(), self.d.nrows());
        if n == 0 || self.d.ncols() != m {
            return Ok(Vec::new());
        }
        let mut outputs = DMatrix::zeros(m, n + m);
        outputs.columns_mut(0, n).copy_from(&self.c);
        outputs.columns_mut(n, m).copy_from(&self.d);
        let (basis, _) = left_basis(&outputs.transpose(), 0.0)?;
        let null = basis.columns(m, n);
        let states = null.rows(0, n).into_owned();
        let next = &self.a * &states + &self.b * null.rows(n, m);
        Ok(generalised_eigenvalues(&next, &states)?
            .into_iter()
            .filter(|(alpha, beta)| alpha.norm() < FARTHEST * beta.norm())
            .map(|(alpha, beta)| alpha / beta)
            .collect())
    }
}

/// Orthogonal matrix of order `rows` whose first columns span the columns of `matrix`, and their number.
fn left_basis(matrix: &DMatrix<f64>, tolerance: f64) -> Result<(DMatrix<f64>, usize), ModelError> {
    let (rows, columns) = matrix.shape();
    if columns == 0 {
        return Ok((DMatrix::identity(rows, rows), 0));
    }
    // Columns of zeros make the thin decomposition return all the left vectors.
    let padded = matrix.clone().resize(rows, columns.max(rows), 0.0);
    let svd = svd_thin(&padded)?;
    let rank = svd.values.iter().filter(|&&v| v > tolerance).count();
    Ok((svd.u, rank))
}

/// Directions of the zero `z` of a square system; `None` for a system that is not square and for a
/// multiple zero.
///
/// # Errors
/// [`ModelError::Linalg`] when the singular value decomposition fails.
pub(crate) fn zero_directions(
    system: &StateSpace,
    z: Complex64,
) -> Result<Option<ZeroDirections>, ModelError> {
    let (n, r, l) = (system.states(), system.inputs(), system.outputs());
    if r != l || n == 0 {
        return Ok(None);
    }
    let (pencil, columns, rows) = Pencil::scaled(system);
    let order = n + l;
    // P = X + jY acts on [Re; Im] as the real matrix [X -Y; Y X]; any vector of its null space is the
    // real form of a null vector of P, because that null space is closed under multiplication by j.
    let mut real = DMatrix::zeros(2 * order, 2 * order);
    for half in [0, order] {
        real.view_mut((half, half), (n, n)).copy_from(&pencil.a);
        real.view_mut((half, half + n), (n, r)).copy_from(&pencil.b);
        real.view_mut((half + n, half), (l, n)).copy_from(&pencil.c);
        real.view_mut((half + n, half + n), (l, r))
            .copy_from(&pencil.d);
        for i in 0..n {
            real[(half + i, half + i)] -= z.re;
        }
    }
    for i in 0..n {
        real[(i, order + i)] = z.im;
        real[(order + i, i)] = -z.im;
    }
    let svd = svd_thin(&real)?;
    let last = 2 * order - 1;
    let vector = |m: &DMatrix<f64>, i: usize, sign: f64| {
        Complex64::new(m[(i, last)], sign * m[(order + i, last)])
    };
    // u^H P = 0, so the row that annihilates P is the conjugate of u.
    let mut left_state = DVector::from_fn(n, |i, _| vector(&svd.u, i, -1.0));
    let mut left_output = DVector::from_fn(l, |i, _| vector(&svd.u, n + i, -1.0) * rows[i]);
    let right_state = DVector::from_fn(n, |i, _| vector(&svd.v, i, 1.0));
    let right_input = DVector::from_fn(r, |i, _| vector(&svd.v, n + i, 1.0) * columns[i]);
    let product: Complex64 = left_state
        .iter()
        .zip(&right_state)
        .map(|(w, v)| w * v)
        .sum();
    if product.norm() < MULTIPLE {
        return Ok(None);
    }
    left_state /= product;
    left_output /= product;
    Ok(Some(ZeroDirections {
        left_state,
        left_output,
        right_state,
        right_input,
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;

    fn deterministic(
        a: DMatrix<f64>,
        b: DMatrix<f64>,
        c: DMatrix<f64>,
        d: DMatrix<f64>,
    ) -> StateSpace {
        StateSpace::deterministic(a, b, c, d, 1.0).unwrap()
    }

    /// Controllable form of `(c0 + c1 z + c2 z^2 + c3 z^3) / (z^4 - 1.1 z^3 + 0.5 z^2 - 0.2 z + 0.05)`,
    /// one row of coefficients per output, in another basis.
    fn canonical(c: DMatrix<f64>) -> StateSpace {
        let a = dmatrix![0.0, 1.0, 0.0, 0.0; 0.0, 0.0, 1.0, 0.0; 0.0, 0.0, 0.0, 1.0;
            -0.05, 0.2, -0.5, 1.1];
        let t = dmatrix![1.0, 0.3, 0.0, 0.1; -0.2, 1.0, 0.4, 0.0; 0.0, 0.5, 1.0, -0.3;
            0.2, 0.0, 0.1, 2.0];
        let d = DMatrix::zeros(c.nrows(), 1);
        deterministic(a, dmatrix![0.0; 0.0; 0.0; 1.0], c, d)
            .transformed(&t)
            .unwrap()
    }

    fn values(system: &StateSpace) -> Vec<Complex64> {
        system.zeros().unwrap().iter().map(|z| z.value).collect()
    }

    fn close(found: &[Complex64], expected: &[(f64, f64)], tolerance: f64) {
        assert_eq!(found.len(), expected.len(), "{found:?}");
        for (z, &(re, im)) in found.iter().zip(expected) {
            assert!((z - Complex64::new(re, im)).norm() < tolerance, "{found:?}");
        }
    }

    #[test]
    fn finite_zeros_for_every_delay() {
        // (z - 0.3)(z + 0.6)(z - 1.5), (z + 0.6)(z - 0.3), z - 0.3, 1
        let one = canonical(dmatrix![0.27, -0.63, -1.2, 1.0]);
        close(&values(&one), &[(1.5, 0.0), (-0.6, 0.0), (0.3, 0.0)], 1e-10);
        let two = canonical(dmatrix![-0.18, 0.3, 1.0, 0.0]);
        close(&values(&two), &[(-0.6, 0.0), (0.3, 0.0)], 1e-10);
        let three = canonical(dmatrix![-0.3, 1.0, 0.0, 0.0]);
        close(&values(&three), &[(0.3, 0.0)], 1e-10);
        let four = canonical(dmatrix![1.0, 0.0, 0.0, 0.0]);
        close(&values(&four), &[], 0.0);
    }

    #[test]
    fn units_of_the_channels_do_not_matter() {
        let mut s = canonical(dmatrix![-0.18, 0.3, 1.0, 0.0]);
        s.b *= 1e-9;
        s.c *= 1e7;
        close(&values(&s), &[(-0.6, 0.0), (0.3, 0.0)], 1e-10);
    }

    #[test]
    fn feedthrough_zeros_are_the_eigenvalues_of_the_inverse() {
        let s = deterministic(
            dmatrix![0.5, 0.3; -0.3, 0.4],
            dmatrix![1.0, 0.0; 0.5, 1.0],
            dmatrix![1.0, 2.0; 0.3, -0.4],
            dmatrix![2.0, 0.5; 0.0, 1.0],
        );
        let inverse = &s.a - &s.b * s.d.clone().try_inverse().unwrap() * &s.c;
        let expected = crate::linalg::eigenvalues(&inverse).unwrap();
        let order = slowest_first(&expected);
        let pairs: Vec<_> = order
            .iter()
            .map(|&i| (expected[i].re, expected[i].im))
            .collect();
        close(&values(&s), &pairs, 1e-11);
    }

    #[test]
    fn only_common_zeros_of_a_system_that_is_not_square() {
        // (z - 0.4)(z - 0.1) and (z - 0.4)(z + 0.7): the common one stays.
        let common = canonical(dmatrix![0.04, -0.5, 1.0, 0.0; -0.28, 0.3, 1.0, 0.0]);
        close(&values(&common), &[(0.4, 0.0)], 1e-9);
        let none = canonical(dmatrix![0.04, -0.5, 1.0, 0.0; -0.28, 0.35, 1.0, 0.0]);
        close(&values(&none), &[], 0.0);
        let mut wide = common.clone();
        wide.a = common.a.transpose();
        wide.b = common.c.transpose();
        wide.c = common.b.transpose();
        wide.d = common.d.transpose();
        close(&values(&wide), &[(0.4, 0.0)], 1e-9);
    }

    #[test]
    fn no_dynamics_and_no_effect_have_no_zero() {
        let gain = deterministic(
            DMatrix::zeros(0, 0),
            DMatrix::zeros(0, 1),
            DMatrix::zeros(1, 0),
            dmatrix![2.0],
        );
        close(&values(&gain), &[], 0.0);
        let dead = deterministic(dmatrix![0.5], dmatrix![0.0], dmatrix![1.0], dmatrix![0.0]);
        // The mode that the input does not reach is an input-decoupling zero in the pencil, but the
        // transfer function vanishes identically: nothing is left of normal rank zero.
        assert!(values(&dead).len() <= 1);
    }

    #[test]
    fn directions_annihilate_the_pencil() {
        let s = StateSpace::deterministic(
            dmatrix![0.6, 0.5, 0.1; -0.5, 0.6, 0.3; 0.0, 0.2, -0.4],
            dmatrix![1.0; 0.2; -0.1],
            dmatrix![1.0, 0.9, 0.0],
            dmatrix![0.7],
            1.0,
        )
        .unwrap();
        let z = values(&s)[0];
        let d = zero_directions(&s, z).unwrap().unwrap();
        let complex = |m: &DMatrix<f64>| m.map(|v| Complex64::new(v, 0.0));
        let (a, b, c, f) = (complex(&s.a), complex(&s.b), complex(&s.c), complex(&s.d));
        let top = &a * &d.right_state - &d.right_state * z + &b * &d.right_input;
        let bottom = &c * &d.right_state + &f * &d.right_input;
        assert!(top.norm() + bottom.norm() < 1e-12);
        let (wa, wc) = (d.left_state.transpose(), d.left_output.transpose());
        assert!((&wa * &a - &wa * z + &wc * &c).norm() < 1e-11);
        assert!((&wa * &b + &wc * &f).norm() < 1e-11);
    }
}
