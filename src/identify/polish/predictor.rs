//! The coefficients of a model's own one-step predictor, and their derivative.

use nalgebra::DMatrix;

use crate::covariance::ParameterLayout;
use crate::identify::subspace::Varx;
use crate::linalg::{LinalgError, cholesky_upper, multiply, multiply_nt, solve_upper_transposed};
use crate::model::StateSpace;

/// Data of the weighted least-squares problem.
pub(crate) struct Problem<'a> {
    varx: &'a Varx,
    layout: ParameterLayout,
    /// Inverse of the lower Cholesky factor of Lambda.
    whitener: DMatrix<f64>,
    /// `Ry L^-T`, `m x l`.
    target: DMatrix<f64>,
}

/// `C At^i`, `i = 0 .. p-1`.
pub(super) fn observability(system: &StateSpace, past: usize) -> Vec<DMatrix<f64>> {
    let predictor = system.predictor_matrix();
    let next = |row: &DMatrix<f64>| Some(row * &predictor);
    std::iter::successors(Some(system.c.clone()), next)
        .take(past)
        .collect()
}

/// `At^i [B~ K]`, `i = 0 .. p-1`.
pub(super) fn controllability(system: &StateSpace, past: usize) -> Vec<DMatrix<f64>> {
    let predictor = system.predictor_matrix();
    let mut input = DMatrix::zeros(system.states(), system.inputs() + system.outputs());
    input
        .columns_mut(0, system.inputs())
        .copy_from(&(&system.b - &system.k * &system.d));
    input
        .columns_mut(system.inputs(), system.outputs())
        .copy_from(&system.k);
    let next = |column: &DMatrix<f64>| Some(&predictor * column);
    std::iter::successors(Some(input), next)
        .take(past)
        .collect()
}

/// The entries of matrices as series over the list, column-major entry by entry.
fn series(list: &[DMatrix<f64>]) -> Vec<f64> {
    let entries = list.first().map_or(0, DMatrix::len);
    (0..entries)
        .flat_map(|entry| list.iter().map(move |matrix| matrix[entry]))
        .collect()
}

/// `out[i] += sum_{s+t=i-1} a[s] b[t]`.
fn add_convolution(out: &mut [f64], a: &[f64], b: &[f64]) {
    for (s, factor) in a.iter().enumerate() {
        for (to, value) in out[s + 1..].iter_mut().zip(b) {
            *to += factor * value;
        }
    }
}

/// Coefficients of the one-step predictor, `l x m`, oldest block first.
pub fn predictor_coefficients(system: &StateSpace, past: usize, feedthrough: bool) -> DMatrix<f64> {
    let (inputs, outputs) = (system.inputs(), system.outputs());
    let q = inputs + outputs;
    let regressors = past * q + if feedthrough { inputs } else { 0 };
    let mut out = DMatrix::zeros(outputs, regressors);
    for (lag, column) in controllability(system, past).iter().enumerate() {
        out.columns_mut((past - 1 - lag) * q, q)
            .copy_from(&(&system.c * column));
    }
    if feedthrough {
        out.columns_mut(past * q, inputs).copy_from(&system.d);
    }
    out
}

impl<'a> Problem<'a> {
    /// Whitens the vector ARX estimate by its innovation covariance.
    ///
    /// # Errors
    /// [`LinalgError::NotPositiveDefinite`] for a singular innovation covariance.
    pub(crate) fn new(varx: &'a Varx, layout: ParameterLayout) -> Result<Self, LinalgError> {
        let upper = cholesky_upper(&varx.innovation_covariance)?;
        let identity = DMatrix::identity(layout.outputs, layout.outputs);
        let whitener = solve_upper_transposed(&upper, &identity);
        Ok(Self {
            target: multiply_nt(&varx.output_factor, &whitener),
            varx,
            layout,
            whitener,
        })
    }

    /// Whitened difference between the estimated predictions and those of a system, one column an output (`m x l`).
    pub(crate) fn residual(&self, system: &StateSpace) -> DMatrix<f64> {
        let coefficients = predictor_coefficients(system, self.varx.past, self.layout.feedthrough);
        let whitened = multiply(&self.whitener, &coefficients);
        &self.target - multiply_nt(&self.varx.regressor_factor, &whitened)
    }

    /// Sum of squares of the residual, in units of chi-square; infinite when it overflows.
    pub(crate) fn cost(&self, system: &StateSpace) -> f64 {
        let residual = self.residual(system);
        let cost = residual.norm_squared();
        if cost.is_finite() {
            cost
        } else {
            f64::INFINITY
        }
    }

    /// Derivative of the whitened predictions `Rz Xi' L^-T` with respect to each parameter, one column a parameter, the
    /// outputs one below the other.
    ///
    /// All of it are combinations of three products with `Rz`, of which the first is nearly all the work: the
    /// derivatives with respect to the predictor matrix `At`, to what enters the state, and to what leaves it.
    pub(crate) fn jacobian(&self, system: &StateSpace) -> DMatrix<f64> {
        let ParameterLayout {
            states: n,
            inputs,
            outputs,
            feedthrough,
        } = self.layout;
        let q = inputs + outputs;
        let past = self.varx.past;
        let factor = self.factor_by_channel(q);
        let rows = factor.nrows();
        let observability: Vec<DMatrix<f64>> = observability(system, past)
            .iter()
            .map(|row| &self.whitener * row)
            .collect();
        let controllability = controllability(system, past);

        // Blocks of `outputs` columns, which are one column of the result each.
        let block = rows * outputs;
        let of_predictor = multiply(
            &factor,
            &predictor_derivative(&observability, &controllability),
        );
        let of_predictor = of_predictor.as_slice();
        let entering = DMatrix::from_fn(past, n * outputs, |lag, column| {
            observability[lag][(column % outputs, column / outputs)]
        });
        let entering: Vec<DMatrix<f64>> = (0..q)
            .map(|j| multiply(&factor.columns(j * past, past).into_owned(), &entering))
            .collect();
        let leaving = DMatrix::from_fn(past * q, n, |row, b| {
            controllability[row % past][(b, row / past)]
        });
        let leaving = multiply(&factor, &leaving);

        let mut out = DMatrix::zeros(block, self.layout.len());
        let columns = out.as_mut_slice();
        let add = |to: &mut [f64], weight: f64, from: &[f64]| {
            for (to, value) in to.iter_mut().zip(from) {
                *to += weight * value;
            }
        };
        columns[..n * n * block].copy_from_slice(of_predictor);
        // B: through B~ only.
        for (j, direct) in entering[..inputs].iter().enumerate() {
            columns[(self.layout.b() + n * j) * block..][..n * block]
                .copy_from_slice(direct.as_slice());
        }
        // K: an input matrix itself; B~ loses K D, At loses K C.
        for v in 0..outputs {
            let to = &mut columns[(self.layout.k() + n * v) * block..][..n * block];
            to.copy_from_slice(entering[inputs + v].as_slice());
            for (j, direct) in entering[..inputs].iter().enumerate() {
                if system.d[(v, j)] != 0.0 {
                    add(to, -system.d[(v, j)], direct.as_slice());
                }
            }
            for b in 0..n {
                add(to, -system.c[(v, b)], &of_predictor[n * b * block..]);
            }
        }
        // C: the output row, and At loses K C.
        for b in 0..n {
            for v in 0..outputs {
                let to = &mut columns[(self.layout.c() + v + outputs * b) * block..][..block];
                for (o, to) in to.chunks_exact_mut(rows).enumerate() {
                    add(to, self.whitener[(o, v)], leaving.column(b).as_slice());
                }
                for a in 0..n {
                    add(to, -system.k[(a, v)], &of_predictor[(a + n * b) * block..]);
                }
            }
        }
        // D: directly, and B~ loses K D.
        if feedthrough {
            for (j, direct) in entering[..inputs].iter().enumerate() {
                let same_sample = self.varx.regressor_factor.column(past * q + j);
                for v in 0..outputs {
                    let to = &mut columns[(self.layout.d() + v + outputs * j) * block..][..block];
                    for (o, to) in to.chunks_exact_mut(rows).enumerate() {
                        add(to, self.whitener[(o, v)], same_sample.as_slice());
                    }
                    for a in 0..n {
                        add(to, -system.k[(a, v)], &direct.as_slice()[a * block..]);
                    }
                }
            }
        }
        out
    }

    /// The columns of `Rz` that belong to the past window, channel by channel and the newest sample first: series over
    /// the lags then run along memory.
    fn factor_by_channel(&self, q: usize) -> DMatrix<f64> {
        let past = self.varx.past;
        let factor = &self.varx.regressor_factor;
        let columns: Vec<usize> = (0..q)
            .flat_map(|j| (0..past).map(move |lag| (past - 1 - lag) * q + j))
            .collect();
        factor.select_columns(&columns)
    }
}

/// `d C At^i [B~ K] / d At[a, b] = sum_{s+t=i-1} (C At^s)[:, a] (At^t [B~ K])[b, :]` for all lags `i`: entry `(o, j)` of
/// lag `i` in row `j p + i`, one column an `(a, b)` and `o`. Each is a convolution of two series over the lags.
fn predictor_derivative(
    observability: &[DMatrix<f64>],
    controllability: &[DMatrix<f64>],
) -> DMatrix<f64> {
    let past = observability.len();
    let (outputs, n) = observability.first().map_or((0, 0), DMatrix::shape);
    let q = controllability.first().map_or(0, DMatrix::ncols);
    let rows = series(observability);
    let columns = series(controllability);
    let mut out = DMatrix::<f64>::zeros(past * q, n * n * outputs);
    for b in 0..n {
        for a in 0..n {
            for o in 0..outputs {
                let row = &rows[(o + outputs * a) * past..][..past];
                let mut column = out.column_mut((a + n * b) * outputs + o);
                for (j, lags) in column.as_mut_slice().chunks_exact_mut(past).enumerate() {
                    add_convolution(lags, row, &columns[(b + n * j) * past..][..past]);
                }
            }
        }
    }
    out
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::linalg::qr_r;

    pub(crate) fn system(feedthrough: bool) -> StateSpace {
        StateSpace {
            a: DMatrix::from_row_slice(2, 2, &[0.7, 0.3, -0.3, 0.6]),
            b: DMatrix::from_row_slice(2, 3, &[1.0, 0.2, -0.7, -0.5, 0.9, 0.3]),
            c: DMatrix::from_row_slice(2, 2, &[1.0, 0.2, -0.4, 0.8]),
            d: DMatrix::from_row_slice(2, 3, &[0.3, -0.2, 0.6, 0.1, 0.5, -0.4])
                * f64::from(u8::from(feedthrough)),
            k: DMatrix::from_row_slice(2, 2, &[0.3, 0.1, -0.2, 0.4]),
            sample_time: 1.0,
        }
    }

    /// A vector ARX model whose coefficients are those of `truth`, in a metric that is not the identity.
    pub(crate) fn varx_of(truth: &StateSpace, past: usize, feedthrough: bool) -> Varx {
        let coefficients = predictor_coefficients(truth, past, feedthrough);
        let m = coefficients.ncols();
        let data = DMatrix::from_fn(m + 40, m, |i, j| {
            (((i + 3) * (j + 5) * 7) % 31) as f64 - 15.0 + if i == j { 40.0 } else { 0.0 }
        });
        let regressor_factor = qr_r(&data);
        let output_factor = multiply_nt(&regressor_factor, &coefficients);
        let innovation_covariance = DMatrix::from_row_slice(2, 2, &[0.5, 0.1, 0.1, 0.8]);
        Varx {
            coefficients,
            regressor_factor,
            output_factor,
            sum_of_squares: &innovation_covariance * 40.0,
            innovation_covariance,
            columns: m + 40,
            past,
            dependent: false,
            feedthrough,
        }
    }

    #[test]
    fn jacobian_agrees_with_finite_differences() {
        for feedthrough in [false, true] {
            let truth = system(feedthrough);
            let varx = varx_of(&truth, 5, feedthrough);
            let layout = ParameterLayout {
                states: 2,
                inputs: 3,
                outputs: 2,
                feedthrough,
            };
            let problem = Problem::new(&varx, layout).unwrap();
            let jacobian = problem.jacobian(&truth);
            let theta = layout.pack(&truth);
            for parameter in 0..layout.len() {
                let moved = |by: f64| {
                    let mut theta = theta.clone();
                    theta[parameter] += by;
                    problem.residual(&layout.unpack(&theta, &truth))
                };
                let numeric = (moved(-1e-6) - moved(1e-6)) / 2e-6;
                for (a, b) in jacobian.column(parameter).iter().zip(numeric.iter()) {
                    assert!((a - b).abs() < 1e-5 * jacobian.amax(), "{parameter}");
                }
            }
        }
    }
}
