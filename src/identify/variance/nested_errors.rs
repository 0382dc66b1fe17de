//! First-order errors of the whitening filter and of innovation estimation, in compact form.
//!
//! The only random quantity is the correlation of the innovations with the window of `p + f` samples before them.
//! Written newest block first, `w = [(u[j];) z[j-1]; z[j-2]; ...]`, let `R' R` be the covariance of `w`: the errors of
//! the nested regressions are then
//!
//! ```text
//! dTheta_k = N^{-1/2} F Omega[:, ..d_k] R_k'^-1,    F F' = Lambda,   Omega (l x d) white of unit variance,
//! ```
//!
//! with `R_k` the leading `d_k = (p + k) q (+ r)` rows and columns of `R`: nothing as long as the record, nothing that
//! grows with its square, and the covariance is the product of a matrix with its transpose. What follows is the
//! chain through the state:
//!
//! ```text
//! d[A B K] = (K dTheta_0 - A S D1) G1 + S D2 G2,      d[C (D)] = (dTheta_0 - C S D1) Gc
//! ```
//!
//! where `D1`, `D2` are the errors of the stacked predictions from the past and from the past and one sample more,
//! and `G1`, `G2`, `Gc` the regressions of those windows on the states. For innovation estimation the errors of the
//! coefficients on future outputs, times `C A^j`, join those on the past, and `S` is `S G` with `G` the block Toeplitz
//! matrix of the impulse response of the noise model.
//!
//! This is Chiuso & Picci (3.1)-(3.5) with the printed errors repaired (`tests/library/literal_nested.rs` holds the two forms
//! against each other): `M_x1 = K [I 0] - A Gamma^-L` with **A**, where `A - K C` is printed; `M_.2` goes with the longer
//! past `z-bar^-` and `M_x2`; in (3.5) the lag is `h - k + 1`; section 4 keeps all columns of the QR factor to the last.

use nalgebra::DMatrix;

use super::propagation::Propagation;
use crate::covariance::ParameterLayout;
use crate::identify::subspace::Prediction;
use crate::linalg::{LinalgError, multiply, solve_upper_transposed, symmetric_square_root_factor};
use crate::model::StateSpace;

/// What the errors of a nested estimate follow from: estimated, or exact.
#[derive(Debug, Clone)]
pub(crate) struct NestedErrors<'a> {
    /// Which algorithm.
    pub(crate) prediction: Prediction,
    /// The system, in the basis of `state_map`.
    pub(crate) system: &'a StateSpace,
    /// Covariance of the innovations.
    pub(crate) innovation_covariance: &'a DMatrix<f64>,
    /// `S`, `n x f l`.
    pub(crate) state_map: &'a DMatrix<f64>,
    /// `zeta [x; u; e]^+`, `(p+1) q x (n + r + l)`, oldest block first.
    pub(crate) state_regression: &'a DMatrix<f64>,
    /// `zeta [x; (u)]^+`, `(p+1) q x (n (+ r))`.
    pub(crate) output_regression: &'a DMatrix<f64>,
    /// Upper triangular factor of the covariance of `w` (newest block first), one window's worth.
    pub(crate) window_factor: &'a DMatrix<f64>,
    /// Number of windows.
    pub(crate) columns: f64,
    /// Past window.
    pub(crate) past: usize,
    /// Whether `D` is estimated.
    pub(crate) feedthrough: bool,
}

/// Columns of a factor of `blocks` blocks of `channels` channels (and, with feedthrough, the inputs of one block
/// more) in the order of `w`: newest block first.
pub(crate) fn newest_first(blocks: usize, channels: usize, direct: usize) -> Vec<usize> {
    let mut columns: Vec<usize> = (blocks * channels..blocks * channels + direct).collect();
    for block in (0..blocks).rev() {
        columns.extend(block * channels..(block + 1) * channels);
    }
    columns
}

impl NestedErrors<'_> {
    fn channels(&self) -> usize {
        self.system.inputs() + self.system.outputs()
    }

    fn direct(&self) -> usize {
        if self.feedthrough {
            self.system.inputs()
        } else {
            0
        }
    }

    /// `C A^j`, `j = 0 .. f - 1`.
    fn observability(&self, future: usize) -> Vec<DMatrix<f64>> {
        let mut row = self.system.c.clone();
        (0..future)
            .map(|_| {
                let next = &row * &self.system.a;
                std::mem::replace(&mut row, next)
            })
            .collect()
    }

    /// `S`, or `S G` for innovation estimation.
    fn map_of_errors(&self) -> DMatrix<f64> {
        let outputs = self.system.outputs();
        let future = self.state_map.ncols() / outputs;
        if self.prediction == Prediction::Whitening {
            return self.state_map.clone();
        }
        let mut toeplitz = DMatrix::identity(future * outputs, future * outputs);
        for (lag, row) in self.observability(future).iter().enumerate() {
            let response = row * &self.system.k;
            for j in 0..future.saturating_sub(lag + 1) {
                toeplitz
                    .view_mut(((j + lag + 1) * outputs, j * outputs), (outputs, outputs))
                    .copy_from(&response);
            }
        }
        multiply(self.state_map, &toeplitz)
    }

    /// Errors as a linear function of white noise of unit variance, `l d` columns.
    ///
    /// # Errors
    /// [`LinalgError`] when the innovation covariance cannot be decomposed.
    pub(crate) fn propagation(&self) -> Result<Propagation, LinalgError> {
        let layout = ParameterLayout::of(self.system, self.feedthrough);
        let (n, outputs) = (layout.states, layout.outputs);
        let q = self.channels();
        let future = self.state_map.ncols() / outputs;
        let width = self.past * q;
        let direct = self.direct();
        let size = self.window_factor.nrows();
        // R'^-1: its leading blocks are the inverses of the leading blocks of R'.
        let inverse = solve_upper_transposed(self.window_factor, &DMatrix::identity(size, size))
            / self.columns.sqrt();
        let noise = symmetric_square_root_factor(self.innovation_covariance)?;

        let map = self.map_of_errors();
        let minus_a_map = -multiply(&self.system.a, &map);
        let minus_c_map = -multiply(&self.system.c, &map);
        let observability = self.observability(future);
        let abk = {
            let mut out = DMatrix::zeros(n, n + q);
            out.columns_mut(0, n).copy_from(&self.system.a);
            out.columns_mut(n, layout.inputs).copy_from(&self.system.b);
            out.columns_mut(n + layout.inputs, outputs)
                .copy_from(&self.system.k);
            out
        };
        // The state as a function of the regressors.
        let selects = |columns: usize| DMatrix::<f64>::identity(n, columns);

        let mut terms = Vec::with_capacity(3 * future + 2);
        let current = self.state_regression.rows(0, width).into_owned();
        let of_outputs = self.output_regression.rows(0, width).into_owned();
        let errors = Errors {
            observability: &observability,
            of_outputs: self.prediction == Prediction::InnovationEstimation,
            channels: q,
            inputs: layout.inputs,
            outputs,
            direct,
        };
        let first_output = layout.c();
        for k in 0..future {
            let block = |m: &DMatrix<f64>| m.columns(k * outputs, outputs).into_owned();
            let longer = errors.of(k, self.past + 1, self.state_regression, &abk);
            terms.push((0, block(&map), longer));
            let now = errors.of(k, self.past, &current, &selects(n + q));
            terms.push((0, block(&minus_a_map), now));
            let out = errors.of(k, self.past, &of_outputs, &selects(of_outputs.ncols()));
            terms.push((first_output, block(&minus_c_map), out));
        }
        // The residual and the output themselves: dTheta_0 on everything it was regressed on.
        let whole = |zeta: &DMatrix<f64>| errors.of_first(self.past, zeta);
        let identity = DMatrix::identity(outputs, outputs);
        terms.push((0, self.system.k.clone(), whole(self.state_regression)));
        terms.push((first_output, identity, whole(self.output_regression)));
        let coefficients = self.coefficient_errors(&inverse, &noise);
        Ok(Propagation {
            layout,
            parameters: collected(&terms, &inverse, &noise, layout.len()),
            coefficients,
        })
    }

    /// Errors of `vec Theta_0`, oldest block first, in the same noise.
    fn coefficient_errors(&self, inverse: &DMatrix<f64>, noise: &DMatrix<f64>) -> DMatrix<f64> {
        let outputs = noise.nrows();
        let q = self.channels();
        let size = inverse.nrows();
        let order = newest_first(self.past, q, self.direct());
        let regressors = order.len();
        let mut out = DMatrix::zeros(outputs * regressors, outputs * size);
        for (place, &column) in order.iter().enumerate() {
            for w in 0..regressors {
                for o in 0..outputs {
                    for v in 0..outputs {
                        out[(o + outputs * column, v + outputs * w)] =
                            noise[(o, v)] * inverse[(w, place)];
                    }
                }
            }
        }
        out
    }
}

/// Vectors that the errors `dTheta_k` are multiplied by, in the order of `w` and without what is beyond regression
/// `k`: `dTheta_k` times such a vector `v` of length `d_k` is `F Omega[:, ..d_k] R_k'^-1 v`.
struct Errors<'a> {
    observability: &'a [DMatrix<f64>],
    /// Whether the coefficients on future outputs count.
    of_outputs: bool,
    channels: usize,
    inputs: usize,
    outputs: usize,
    direct: usize,
}

impl Errors<'_> {
    /// Regression `k` after a past of `past` samples: its coefficients on the past meet `zeta` (`past q x m`, oldest
    /// block first) and, for innovation estimation, those on the future outputs meet `C A^j x` of the states `states`
    /// (`n x m`).
    fn of(
        &self,
        k: usize,
        past: usize,
        zeta: &DMatrix<f64>,
        states: &DMatrix<f64>,
    ) -> DMatrix<f64> {
        let q = self.channels;
        let blocks = past + k;
        let mut vectors = DMatrix::zeros(blocks * q + self.direct, zeta.ncols());
        for block in 0..past {
            let newest = self.direct + (blocks - 1 - block) * q;
            vectors
                .rows_mut(newest, q)
                .copy_from(&zeta.rows(block * q, q));
        }
        if self.of_outputs {
            for (j, row) in self.observability.iter().enumerate().take(k) {
                let newest = self.direct + (k - 1 - j) * q + self.inputs;
                vectors
                    .rows_mut(newest, self.outputs)
                    .copy_from(&(row * states));
            }
        }
        vectors
    }

    /// Regression 0 and everything it was regressed on: `zeta` with its last block, of which only the inputs count,
    /// and only with feedthrough.
    fn of_first(&self, past: usize, zeta: &DMatrix<f64>) -> DMatrix<f64> {
        let order = newest_first(past, self.channels, self.direct);
        DMatrix::from_fn(order.len(), zeta.ncols(), |i, j| zeta[(order[i], j)])
    }
}

/// The sum of `left F Omega R'^-1 v` over the terms `(first, left, v)`, `left` of `rows x l`, in the parameters from
/// `first` on, `rows` of them per column of `v`.
fn collected(
    terms: &[(usize, DMatrix<f64>, DMatrix<f64>)],
    inverse: &DMatrix<f64>,
    noise: &DMatrix<f64>,
    parameters: usize,
) -> DMatrix<f64> {
    let size = inverse.nrows();
    let outputs = noise.nrows();
    // All vectors side by side: one large product instead of many small ones.
    let mut vectors = DMatrix::zeros(size, terms.iter().map(|t| t.2.ncols()).sum());
    let mut from = 0;
    for (_, _, v) in terms {
        vectors
            .view_mut((0, from), (v.nrows(), v.ncols()))
            .copy_from(v);
        from += v.ncols();
    }
    let whitened = multiply(inverse, &vectors);
    let mut out = DMatrix::zeros(parameters, outputs * size);
    let mut from = 0;
    for (first, left, v) in terms {
        let left = left * noise;
        let rows = left.nrows();
        // The factor is triangular: the inverse of a leading block is the leading block of the inverse, and
        // what the whole one adds further down belongs to no regressor of this regression.
        for w in 0..v.nrows() {
            for o in 0..outputs {
                let mut column = out.column_mut(o + outputs * w);
                for c in 0..v.ncols() {
                    let factor = whitened[(w, from + c)];
                    for a in 0..rows {
                        column[first + rows * c + a] += left[(a, o)] * factor;
                    }
                }
            }
        }
        from += v.ncols();
    }
    out
}
