//! The coefficients of a model's own one-step predictor, and their derivative.

use nalgebra::DMatrix;

use super::super::varx::Varx;
use crate::covariance::ParameterLayout;
use crate::linalg::{LinalgError, cholesky_upper, multiply, multiply_nt, solve_upper_transposed};
use crate::model::StateSpace;

/// Data of the weighted least-squares problem.
pub struct Problem<'a> {
    varx: &'a Varx,
    layout: ParameterLayout,
    /// Inverse of the lower Cholesky factor of Lambda.
    whitener: DMatrix<f64>,
    /// `L^-1 Ry'`, `l x m`.
    target: DMatrix<f64>,
}

/// `C At^i`, `i = 0 .. p-1`.
fn observability(system: &StateSpace, past: usize) -> Vec<DMatrix<f64>> {
    let predictor = system.predictor_matrix();
    let next = |row: &DMatrix<f64>| Some(row * &predictor);
    std::iter::successors(Some(system.c.clone()), next)
        .take(past)
        .collect()
}

/// `At^i [B~ K]`, `i = 0 .. p-1`.
fn controllability(system: &StateSpace, past: usize) -> Vec<DMatrix<f64>> {
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
    pub fn new(varx: &'a Varx, layout: ParameterLayout) -> Result<Self, LinalgError> {
        let upper = cholesky_upper(&varx.innovation_covariance)?;
        let identity = DMatrix::identity(layout.outputs, layout.outputs);
        let whitener = solve_upper_transposed(&upper, &identity);
        Ok(Self {
            target: multiply_nt(&whitener, &varx.output_factor),
            varx,
            layout,
            whitener,
        })
    }

    /// Whitened difference between the estimated predictions and those of a system, `l x m`.
    pub fn residual(&self, system: &StateSpace) -> DMatrix<f64> {
        let coefficients = predictor_coefficients(system, self.varx.past, self.layout.feedthrough);
        let model = multiply_nt(&coefficients, &self.varx.regressor_factor);
        &self.target - multiply(&self.whitener, &model)
    }

    /// Sum of squares of the residual, in units of chi-square; infinite when it overflows.
    pub fn cost(&self, system: &StateSpace) -> f64 {
        let residual = self.residual(system);
        let cost = residual.norm_squared();
        if cost.is_finite() {
            cost
        } else {
            f64::INFINITY
        }
    }

    /// Derivative of the whitened predictions `L^-1 Xi Rz'` with respect to each parameter, one column
    /// a parameter.
    pub fn jacobian(&self, system: &StateSpace) -> DMatrix<f64> {
        let ParameterLayout {
            states: n,
            inputs,
            outputs,
            feedthrough,
        } = self.layout;
        let q = inputs + outputs;
        let past = self.varx.past;
        let regressors = self.varx.regressors();
        let observability = observability(system, past);
        let controllability = controllability(system, past);
        let parameters = self.layout.len();

        // d C At^i [B~ K] / d At[a, b] = sum_{s+t=i-1} (C At^s)[:, a] (At^t [B~ K])[b, :], kept for all lags:
        // entry (o, j) of lag i at ((j * outputs + o) * past + i), one column an (a, b). Each is a convolution of two
        // series over the lags, written so that the inner loop runs along memory: this is most of the work.
        let row_series = series(&observability);
        let column_series = series(&controllability);
        let mut of_predictor = DMatrix::<f64>::zeros(past * q * outputs, n * n);
        for b in 0..n {
            for a in 0..n {
                let mut column = of_predictor.column_mut(a + n * b);
                let mut lags = column.as_mut_slice().chunks_exact_mut(past);
                for j in 0..q {
                    for o in 0..outputs {
                        if let Some(out) = lags.next() {
                            let row = &row_series[(o + outputs * a) * past..][..past];
                            let input = &column_series[(b + n * j) * past..][..past];
                            add_convolution(out, row, input);
                        }
                    }
                }
            }
        }
        // One column a parameter and output: regressors x (parameter * outputs + o).
        let mut derivative = DMatrix::<f64>::zeros(regressors, parameters * outputs);
        let column_of = |lag: usize, j: usize| (past - 1 - lag) * q + j;
        let add_predictor =
            |derivative: &mut DMatrix<f64>, parameter: usize, ab: usize, factor: f64| {
                if factor == 0.0 {
                    return;
                }
                let column = of_predictor.column(ab);
                let mut lags = column.as_slice().chunks_exact(past);
                for j in 0..q {
                    for o in 0..outputs {
                        let mut to = derivative.column_mut(parameter * outputs + o);
                        for (lag, value) in lags.next().unwrap_or(&[]).iter().enumerate() {
                            to[column_of(lag, j)] += factor * value;
                        }
                    }
                }
            };
        // A
        for ab in 0..n * n {
            add_predictor(&mut derivative, ab, ab, 1.0);
        }
        // B: through B~ only.
        for j in 0..inputs {
            for a in 0..n {
                let parameter = self.layout.b() + a + n * j;
                for (lag, row) in observability.iter().enumerate() {
                    for o in 0..outputs {
                        derivative[(column_of(lag, j), parameter * outputs + o)] += row[(o, a)];
                    }
                }
            }
        }
        // K: At loses K C, B~ loses K D, and K is an input matrix itself.
        for v in 0..outputs {
            for a in 0..n {
                let parameter = self.layout.k() + a + n * v;
                for b in 0..n {
                    add_predictor(&mut derivative, parameter, a + n * b, -system.c[(v, b)]);
                }
                for (lag, row) in observability.iter().enumerate() {
                    for o in 0..outputs {
                        derivative[(column_of(lag, inputs + v), parameter * outputs + o)] +=
                            row[(o, a)];
                        for j in 0..inputs {
                            derivative[(column_of(lag, j), parameter * outputs + o)] -=
                                row[(o, a)] * system.d[(v, j)];
                        }
                    }
                }
            }
        }
        // C: the output row, and At loses K C.
        for b in 0..n {
            for v in 0..outputs {
                let parameter = self.layout.c() + v + outputs * b;
                for a in 0..n {
                    add_predictor(&mut derivative, parameter, a + n * b, -system.k[(a, v)]);
                }
                for (lag, input) in controllability.iter().enumerate() {
                    for j in 0..q {
                        derivative[(column_of(lag, j), parameter * outputs + v)] += input[(b, j)];
                    }
                }
            }
        }
        // D: directly, and B~ loses K D.
        if feedthrough {
            for j in 0..inputs {
                for v in 0..outputs {
                    let parameter = self.layout.d() + v + outputs * j;
                    for (lag, row) in observability.iter().enumerate() {
                        for o in 0..outputs {
                            let value: f64 = (0..n).map(|a| row[(o, a)] * system.k[(a, v)]).sum();
                            derivative[(column_of(lag, j), parameter * outputs + o)] -= value;
                        }
                    }
                    derivative[(past * q + j, parameter * outputs + v)] += 1.0;
                }
            }
        }

        let weighted = multiply(&self.varx.regressor_factor, &derivative);
        let mut out = DMatrix::zeros(outputs * regressors, parameters);
        for parameter in 0..parameters {
            for o in 0..outputs {
                for v in 0..=o {
                    let from = weighted.column(parameter * outputs + v);
                    let whitener = self.whitener[(o, v)];
                    for (j, value) in from.iter().enumerate() {
                        out[(o + outputs * j, parameter)] += whitener * value;
                    }
                }
            }
        }
        out
    }
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use crate::linalg::qr_r;

    pub fn system(feedthrough: bool) -> StateSpace {
        StateSpace {
            a: DMatrix::from_row_slice(2, 2, &[0.7, 0.3, -0.3, 0.6]),
            b: DMatrix::from_row_slice(2, 1, &[1.0, -0.5]),
            c: DMatrix::from_row_slice(2, 2, &[1.0, 0.2, -0.4, 0.8]),
            d: DMatrix::from_element(2, 1, if feedthrough { 0.3 } else { 0.0 }),
            k: DMatrix::from_row_slice(2, 2, &[0.3, 0.1, -0.2, 0.4]),
            sample_time: 1.0,
        }
    }

    /// A vector ARX model whose coefficients are those of `truth`, in a metric that is not the identity.
    pub fn varx_of(truth: &StateSpace, past: usize, feedthrough: bool) -> Varx {
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
                inputs: 1,
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
