//! The extended observability matrix with its orthogonal complement, and the least-squares problem that both the
//! input and the noise part share.

use nalgebra::DMatrix;

use super::future_regression::Regression;
use crate::identify::IdentifyError;
use crate::linalg::{
    LinalgError, multiply, multiply_tn, qr_thin, reciprocal_condition_upper, solve_upper,
    solve_upper_transposed, svd_thin,
};

/// Relative size below which columns are dependent to working precision.
const DEPENDENT: f64 = 1e-12;

/// `Gamma_h` and `Gamma_h` perpendicular.
#[derive(Debug, Clone)]
pub(crate) struct Observability {
    /// `Gamma_h`, `h l x n`.
    pub(crate) gamma: DMatrix<f64>,
    /// Orthonormal complement of its columns, `h l x (h l - n)`.
    pub(crate) complement: DMatrix<f64>,
    /// Number of outputs `l`.
    pub(crate) outputs: usize,
}

/// The singular value decomposition (13) with the weight (14).
#[derive(Debug, Clone)]
pub(crate) struct Decomposition {
    /// All `h l` left singular vectors.
    pub(crate) left: DMatrix<f64>,
    /// Singular values, `h l` (zero where there are fewer columns).
    pub(crate) values: Vec<f64>,
    /// Right singular vectors in the coordinates of `W_p` times the weight, `i (m + l) x h l`.
    pub(crate) right: DMatrix<f64>,
    /// Number of outputs `l`.
    pub(crate) outputs: usize,
}

impl Decomposition {
    /// Of `Theta_p (W_p W_p')^(1/2)`. Any root gives the same left vectors: the triangular one is at hand.
    ///
    /// # Errors
    /// [`LinalgError`] when the decomposition does not converge.
    pub(crate) fn new(regression: &Regression) -> Result<Self, LinalgError> {
        let product = multiply(
            &regression.past_coefficients(),
            &regression.past_factor().transpose(),
        );
        let (rows, columns) = product.shape();
        // Zero columns make the left vectors a complete basis.
        let svd = svd_thin(&product.resize_horizontally(columns.max(rows), 0.0))?;
        let (mut left, mut right) = (svd.u, svd.v);
        for j in 0..rows {
            // The sign of a singular vector is arbitrary: fix it, so that results are reproducible.
            if left[(left.column(j).icamax(), j)] < 0.0 {
                left.column_mut(j).neg_mut();
                right.column_mut(j).neg_mut();
            }
        }
        Ok(Self {
            left,
            values: svd.values.iter().copied().collect(),
            right: right.rows(0, columns).into_owned(),
            outputs: regression.outputs,
        })
    }

    /// `Gamma_h` of order `n`, (15), with its complement.
    ///
    /// # Errors
    /// [`IdentifyError::Order`] when the horizon does not allow the order.
    pub(crate) fn observability(&self, order: usize) -> Result<Observability, IdentifyError> {
        let rows = self.left.nrows();
        check_order(order, rows / self.outputs, self.outputs)?;
        Ok(Observability {
            gamma: self.left.columns(0, order).into_owned(),
            complement: self.left.columns(order, rows - order).into_owned(),
            outputs: self.outputs,
        })
    }
}

/// The largest order for `future` samples of `outputs` outputs is `(h - 1) l`: (23) shifts by one block.
fn check_order(order: usize, future: usize, outputs: usize) -> Result<(), IdentifyError> {
    let largest = (future - 1) * outputs;
    if order == 0 || order > largest {
        return Err(IdentifyError::Order {
            order,
            largest,
            reason: format!(
                "a future window of {future} samples of {outputs} outputs is shifted by one sample"
            ),
        });
    }
    Ok(())
}

/// `[C; C A; ...; C A^(blocks-1)]`.
pub(crate) fn extended_observability(
    a: &DMatrix<f64>,
    c: &DMatrix<f64>,
    blocks: usize,
) -> DMatrix<f64> {
    let (outputs, n) = c.shape();
    let mut out = DMatrix::zeros(blocks * outputs, n);
    let mut row = c.clone();
    for k in 0..blocks {
        out.rows_mut(k * outputs, outputs).copy_from(&row);
        row = &row * a;
    }
    out
}

impl Observability {
    /// That of given `A` and `C`, for a deterministic part that came from another method.
    ///
    /// # Errors
    /// [`IdentifyError::Order`] when the horizon does not allow the order, [`IdentifyError::SingularRegression`] when
    /// the pair is not observable.
    pub(crate) fn of(
        a: &DMatrix<f64>,
        c: &DMatrix<f64>,
        future: usize,
    ) -> Result<Self, IdentifyError> {
        let (outputs, n) = c.shape();
        check_order(n, future, outputs)?;
        let gamma = extended_observability(a, c, future);
        let rows = gamma.nrows();
        // A complete orthonormal basis whose first columns span gamma.
        let svd = svd_thin(&gamma.clone().resize_horizontally(rows, 0.0))?;
        if svd.values[n - 1] <= DEPENDENT * svd.values[0] {
            return Err(IdentifyError::SingularRegression {
                what: "the outputs of an observable state",
            });
        }
        Ok(Self {
            gamma,
            complement: svd.u.columns(n, rows - n).into_owned(),
            outputs,
        })
    }

    /// Future window `h`.
    pub(crate) fn future(&self) -> usize {
        self.gamma.nrows() / self.outputs
    }

    /// All block rows but the last.
    pub(crate) fn upper(&self) -> DMatrix<f64> {
        self.gamma
            .rows(0, self.gamma.nrows() - self.outputs)
            .into_owned()
    }

    /// All block rows but the first.
    pub(crate) fn lower(&self) -> DMatrix<f64> {
        let rows = self.gamma.nrows() - self.outputs;
        self.gamma.rows(self.outputs, rows).into_owned()
    }

    /// `F` of the least-squares problems (24) and (38): with `H` the Toeplitz matrix of `(A, B, C, D)`, its block
    /// column `k` is `S_k [D; B]`, `S_k = [0; [I 0]; [0 Gamma_{h-1-k}(A, C)]]`, so that
    /// `F [D; B] = stack_k(Gamma_perp' H[:, k])`, `F = stack_k(Gamma_perp' S_k)`, `h (h l - n) x (l + n)`.
    pub(crate) fn toeplitz_regressor(&self, a: &DMatrix<f64>, c: &DMatrix<f64>) -> DMatrix<f64> {
        toeplitz_regressor(
            &self.complement,
            &extended_observability(a, c, self.future()),
            self.outputs,
        )
    }

    /// `stack_k(Gamma_perp' H[:, k])` for a matrix of `h` block columns of `width`: `h (h l - n) x width`.
    pub(crate) fn stacked(&self, toeplitz: &DMatrix<f64>, width: usize) -> DMatrix<f64> {
        stacked(&self.complement, toeplitz, width)
    }
}

pub(super) fn toeplitz_regressor(
    complement: &DMatrix<f64>,
    extended: &DMatrix<f64>,
    outputs: usize,
) -> DMatrix<f64> {
    let (rows, free) = complement.shape();
    let n = extended.ncols();
    let future = rows / outputs;
    let mut out = DMatrix::zeros(future * free, outputs + n);
    for k in 0..future {
        let from = k * outputs;
        let below = rows - from - outputs;
        let direct = complement.rows(from, outputs).transpose();
        out.view_mut((k * free, 0), (free, outputs))
            .copy_from(&direct);
        let through_state =
            complement.rows(from + outputs, below).transpose() * extended.rows(0, below);
        out.view_mut((k * free, outputs), (free, n))
            .copy_from(&through_state);
    }
    out
}

pub(super) fn stacked(
    complement: &DMatrix<f64>,
    toeplitz: &DMatrix<f64>,
    width: usize,
) -> DMatrix<f64> {
    let free = complement.ncols();
    let product = multiply_tn(complement, toeplitz);
    let future = product.ncols() / width;
    DMatrix::from_fn(future * free, width, |i, j| {
        product[(i % free, (i / free) * width + j)]
    })
}

/// A least-squares problem with its factor kept, for several right-hand sides and for derivatives.
#[derive(Debug, Clone)]
pub(super) struct LeastSquares {
    q: DMatrix<f64>,
    r: DMatrix<f64>,
}

impl LeastSquares {
    /// Factors the regressors.
    ///
    /// # Errors
    /// [`IdentifyError::SingularRegression`] when columns are dependent to working precision.
    pub(super) fn new(
        regressors: &DMatrix<f64>,
        what: &'static str,
    ) -> Result<Self, IdentifyError> {
        let (q, r) = qr_thin(regressors);
        if r.nrows() < r.ncols() || reciprocal_condition_upper(&r) < DEPENDENT {
            return Err(IdentifyError::SingularRegression { what });
        }
        Ok(Self { q, r })
    }

    /// `F^+ b`.
    pub(super) fn solve(&self, right: &DMatrix<f64>) -> DMatrix<f64> {
        solve_upper(&self.r, &multiply_tn(&self.q, right))
    }

    /// `(F' F)^-1 b`.
    pub(super) fn solve_normal(&self, right: &DMatrix<f64>) -> DMatrix<f64> {
        solve_upper(&self.r, &solve_upper_transposed(&self.r, right))
    }
}
