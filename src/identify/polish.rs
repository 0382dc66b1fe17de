//! The Gauss-Newton polish: the maximum-likelihood model of the given order, computed from `R` alone.
//!
//! The vector ARX coefficients are a sufficient statistic as long as the past window is long enough, so
//! the prediction-error estimate is the model whose own coefficients
//! `Xi(theta) = [C At^{p-1} [B~ K] ... C [B~ K] (D)]`, `At = A - K C`, `B~ = B - K D`, are nearest to the
//! estimated ones in their own metric:
//!
//! `min_theta | Lambda^{-1/2} (Ry' - Xi(theta) Rz') |_F^2`.
//!
//! At the minimum the cost is chi-square with `l m - n (r + 2 l) (- l r)` degrees of freedom when order
//! and window are right, which makes a test of both; and the inverse of the information matrix is the
//! Cramer-Rao bound. Indirect prediction-error method of Soderstrom, Stoica & Friedlander (1991) applied
//! to the first step of PBSID.

use nalgebra::{DMatrix, DVector};

use super::stable::with_poles_inside;
use super::varx::Varx;
use crate::covariance::{ParameterCovariance, ParameterLayout};
use crate::linalg::{
    LinalgError, cholesky_upper, eigen, multiply, multiply_nt, multiply_tn, qr_thin,
    solve_upper_transposed, spectral_radius, stabilising_observer_gain, svd_thin,
};
use crate::model::StateSpace;

/// The iteration ends when a step promises less than this in the cost, which is in units of chi-square:
/// far below what a standard deviation is (1).
const DECREASE: f64 = 1e-9;
/// A Gauss-Newton iteration that has not ended by then will not.
const ITERATIONS: usize = 100;
/// Steps of which the one that decreases the cost most is taken: length of the step, and Levenberg-Marquardt
/// damping relative to the largest singular value of the Jacobian. An order too high makes the Jacobian
/// nearly singular, and only damping helps there.
const TRIES: [(f64, f64); 9] = [
    (1.0, 0.0),
    (0.5, 0.0),
    (0.25, 0.0),
    (1.0, 1e-5),
    (1.0, 1e-4),
    (1.0, 1e-3),
    (1.0, 1e-2),
    (1.0, 1e-1),
    (1.0, 1.0),
];
/// Steps in a row that each gain less than [`GAIN`] end the iteration: a flat valley, where the cost, and
/// with it every prediction, no longer changes.
const FLAT_STEPS: usize = 3;
/// See [`FLAT_STEPS`]; in units of chi-square.
const GAIN: f64 = 1e-5;
/// Singular values of the Jacobian below this share of the largest are not determined by the data.
const DETERMINED: f64 = 1e-13;
/// Radius of `A - K C` beyond which the predictor is replaced by its stabilised mirror image before the
/// first step: powers of it up to the past window would overflow the regression.
const LARGEST_PREDICTOR_RADIUS: f64 = 0.9999;

/// Result of the polish, in scaled units.
#[derive(Debug, Clone)]
pub struct Polished {
    /// The system at the minimum.
    pub system: StateSpace,
    /// Inverse information, `(X' X)^+`, in the basis of the system.
    pub covariance: ParameterCovariance,
    /// Cost at the start and at the minimum (chi-square units).
    pub start_cost: f64,
    /// Cost at the minimum.
    pub cost: f64,
    /// Degrees of freedom of the cost.
    pub degrees_of_freedom: usize,
    /// Number of Gauss-Newton steps.
    pub iterations: usize,
    /// Whether the iteration ended by its criterion.
    pub converged: bool,
}

/// Data of the weighted least-squares problem.
struct Problem<'a> {
    varx: &'a Varx,
    layout: ParameterLayout,
    /// Inverse of the lower Cholesky factor of Lambda.
    whitener: DMatrix<f64>,
    /// `L^-1 Ry'`, `l x m`.
    target: DMatrix<f64>,
}

/// Powers that the predictor coefficients are made of.
struct Powers {
    /// `C At^i`, `i = 0 .. p-1`.
    observability: Vec<DMatrix<f64>>,
    /// `At^i [B~ K]`, `i = 0 .. p-1`.
    controllability: Vec<DMatrix<f64>>,
}

fn powers(system: &StateSpace, past: usize) -> Powers {
    let predictor = &system.a - &system.k * &system.c;
    let n = system.states();
    let q = system.inputs() + system.outputs();
    let mut input = DMatrix::zeros(n, q);
    input
        .columns_mut(0, system.inputs())
        .copy_from(&(&system.b - &system.k * &system.d));
    input
        .columns_mut(system.inputs(), system.outputs())
        .copy_from(&system.k);
    let mut observability = Vec::with_capacity(past);
    let mut controllability = Vec::with_capacity(past);
    let mut row = system.c.clone();
    let mut column = input;
    for _ in 0..past {
        let next_row = &row * &predictor;
        let next_column = &predictor * &column;
        observability.push(std::mem::replace(&mut row, next_row));
        controllability.push(std::mem::replace(&mut column, next_column));
    }
    Powers {
        observability,
        controllability,
    }
}

/// Coefficients of the one-step predictor, `l x m`, oldest block first.
pub fn predictor_coefficients(system: &StateSpace, past: usize, feedthrough: bool) -> DMatrix<f64> {
    let (inputs, outputs) = (system.inputs(), system.outputs());
    let q = inputs + outputs;
    let regressors = past * q + if feedthrough { inputs } else { 0 };
    let powers = powers(system, past);
    let mut out = DMatrix::zeros(outputs, regressors);
    for (lag, column) in powers.controllability.iter().enumerate() {
        out.columns_mut((past - 1 - lag) * q, q)
            .copy_from(&(&system.c * column));
    }
    if feedthrough {
        out.columns_mut(past * q, inputs).copy_from(&system.d);
    }
    out
}

impl Problem<'_> {
    fn residual(&self, system: &StateSpace) -> DMatrix<f64> {
        let coefficients = predictor_coefficients(system, self.varx.past, self.layout.feedthrough);
        let model = multiply_nt(&coefficients, &self.varx.regressor_factor);
        &self.target - multiply(&self.whitener, &model)
    }

    fn cost(&self, system: &StateSpace) -> f64 {
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
    fn jacobian(&self, system: &StateSpace) -> DMatrix<f64> {
        let ParameterLayout {
            states: n,
            inputs,
            outputs,
            feedthrough,
        } = self.layout;
        let q = inputs + outputs;
        let past = self.varx.past;
        let regressors = self.varx.regressors();
        let Powers {
            observability,
            controllability,
        } = powers(system, past);
        let parameters = self.layout.len();

        // d C At^i [B~ K] / d At[a, b] = sum_{s+t=i-1} (C At^s)[:, a] (At^t [B~ K])[b, :], kept for all lags:
        // entry (o, j) of lag i at ((i * q + j) * outputs + o), one column an (a, b).
        let block = q * outputs;
        let mut of_predictor = DMatrix::<f64>::zeros(past * block, n * n);
        for b in 0..n {
            for a in 0..n {
                let mut column = of_predictor.column_mut(a + n * b);
                let out = column.as_mut_slice();
                for (s, row) in observability.iter().enumerate() {
                    for (t, input) in controllability.iter().enumerate().take(past - 1 - s) {
                        let lag = s + t + 1;
                        let slice = &mut out[lag * block..(lag + 1) * block];
                        for j in 0..q {
                            let factor = input[(b, j)];
                            for o in 0..outputs {
                                slice[j * outputs + o] += row[(o, a)] * factor;
                            }
                        }
                    }
                }
            }
        }
        // One row a parameter and output: (parameter * outputs + o) x regressors.
        let mut derivative = DMatrix::<f64>::zeros(parameters * outputs, regressors);
        let column_of = |lag: usize, j: usize| (past - 1 - lag) * q + j;
        let add_predictor =
            |derivative: &mut DMatrix<f64>, parameter: usize, ab: usize, factor: f64| {
                if factor == 0.0 {
                    return;
                }
                let column = of_predictor.column(ab);
                for lag in 0..past {
                    for j in 0..q {
                        for o in 0..outputs {
                            derivative[(parameter * outputs + o, column_of(lag, j))] +=
                                factor * column[lag * block + j * outputs + o];
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
                        derivative[(parameter * outputs + o, column_of(lag, j))] += row[(o, a)];
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
                        derivative[(parameter * outputs + o, column_of(lag, inputs + v))] +=
                            row[(o, a)];
                        for j in 0..inputs {
                            derivative[(parameter * outputs + o, column_of(lag, j))] -=
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
                        derivative[(parameter * outputs + v, column_of(lag, j))] += input[(b, j)];
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
                            derivative[(parameter * outputs + o, column_of(lag, j))] -= value;
                        }
                    }
                    derivative[(parameter * outputs + v, past * q + j)] += 1.0;
                }
            }
        }

        let weighted = multiply_nt(&derivative, &self.varx.regressor_factor);
        let mut out = DMatrix::zeros(outputs * regressors, parameters);
        for parameter in 0..parameters {
            let rows = weighted.rows(parameter * outputs, outputs).into_owned();
            let whitened = multiply(&self.whitener, &rows);
            out.column_mut(parameter)
                .copy_from_slice(whitened.as_slice());
        }
        out
    }
}

/// The linearised problem in the singular directions of its Jacobian: minimum-norm Gauss-Newton and damped
/// steps, and the pseudo-inverse of the information, all of the rank that the input-output behaviour
/// determines.
struct Linearised {
    /// Right singular vectors, one column a direction.
    directions: DMatrix<f64>,
    /// Singular values.
    values: Vec<f64>,
    /// Residual along the left singular vectors.
    projected: Vec<f64>,
}

impl Linearised {
    fn new(jacobian: &DMatrix<f64>, residual: &[f64], rank: usize) -> Result<Self, LinalgError> {
        let residual = DMatrix::from_column_slice(residual.len(), 1, residual);
        let (q, r) = qr_thin(jacobian);
        let svd = svd_thin(&r)?;
        let rank = rank.min(svd.values.len());
        let projected = multiply_tn(&svd.u, &multiply_tn(&q, &residual));
        Ok(Self {
            directions: svd.v.columns(0, rank).into_owned(),
            values: svd.values.iter().take(rank).copied().collect(),
            projected: projected.iter().take(rank).copied().collect(),
        })
    }

    fn largest(&self) -> f64 {
        self.values.first().copied().unwrap_or(0.0)
    }

    /// Decrease of the cost that a full step promises.
    fn decrease(&self) -> f64 {
        let determined = DETERMINED * self.largest();
        self.values
            .iter()
            .zip(&self.projected)
            .filter(|(value, _)| **value > determined)
            .map(|(_, p)| p * p)
            .sum()
    }

    /// Step with Levenberg-Marquardt damping `damping` (relative to the largest singular value; zero is
    /// Gauss-Newton).
    fn step(&self, damping: f64) -> DVector<f64> {
        let largest = self.largest();
        let coefficients = DVector::from_iterator(
            self.values.len(),
            self.values.iter().zip(&self.projected).map(|(&value, &p)| {
                if value > DETERMINED * largest {
                    p * value / (value * value + (damping * largest).powi(2))
                } else {
                    0.0
                }
            }),
        );
        &self.directions * coefficients
    }

    fn covariance(&self) -> DMatrix<f64> {
        let mut scaled = self.directions.clone();
        for (i, &value) in self.values.iter().enumerate() {
            let inverse = if value > DETERMINED * self.largest() {
                1.0 / value
            } else {
                0.0
            };
            scaled.column_mut(i).scale_mut(inverse);
        }
        multiply_nt(&scaled, &scaled)
    }
}

/// Derivative of the modulus of each eigenvalue of `A` that sits on the circle of `radius`, with respect to
/// the parameters: `d|lambda| = Re(conj(lambda) / |lambda| w dA v)`. One row an eigenvalue, of a complex pair
/// only one.
fn boundary_gradient(
    system: &StateSpace,
    layout: &ParameterLayout,
    radius: f64,
) -> Result<DMatrix<f64>, LinalgError> {
    let decomposition = eigen(&system.a)?;
    let n = system.states();
    let on_boundary: Vec<usize> = (0..n)
        .filter(|&i| {
            let value = decomposition.values[i];
            value.im >= 0.0 && value.norm() > radius * (1.0 - 1e-9)
        })
        .collect();
    Ok(DMatrix::from_fn(
        on_boundary.len(),
        layout.len(),
        |row, p| {
            if p >= n * n {
                return 0.0;
            }
            let i = on_boundary[row];
            let value = decomposition.values[i];
            let change = decomposition.left[(i, p % n)] * decomposition.right[(p / n, i)];
            (value.conj() / value.norm() * change).re
        },
    ))
}

/// The linearised problem, confined to the boundary of the stability radius where a free step would leave
/// it (an active set: an eigenvalue that the step would take inward is let go).
fn linearise(
    jacobian: DMatrix<f64>,
    residual: &[f64],
    rank: usize,
    boundary: &DMatrix<f64>,
) -> Result<Linearised, LinalgError> {
    let free = Linearised::new(&jacobian, residual, rank)?;
    let outward = boundary * free.step(0.0);
    let active: Vec<usize> = (0..boundary.nrows())
        .filter(|&i| outward[i] > 0.0)
        .collect();
    if active.is_empty() {
        return Ok(free);
    }
    let (normal, _) = qr_thin(&boundary.select_rows(&active).transpose());
    let confined = &jacobian - (&jacobian * &normal) * normal.transpose();
    Linearised::new(&confined, residual, rank - active.len())
}

/// Polishes `start` against the vector ARX estimate. When `largest_radius` is given, the spectral radius of
/// `A` stays within it.
///
/// # Errors
/// [`LinalgError`] when the innovation covariance is singular (a noise-free record needs no polish) or
/// the iteration meets numbers that are not finite at its start.
pub fn polish(
    start: &StateSpace,
    varx: &Varx,
    largest_radius: Option<f64>,
) -> Result<Polished, LinalgError> {
    let layout = ParameterLayout {
        states: start.states(),
        inputs: start.inputs(),
        outputs: start.outputs(),
        feedthrough: varx.feedthrough,
    };
    let upper = cholesky_upper(&varx.innovation_covariance)?;
    let outputs = layout.outputs;
    let whitener = solve_upper_transposed(&upper, &DMatrix::identity(outputs, outputs));
    let target = multiply_nt(&whitener, &varx.output_factor);
    let problem = Problem {
        varx,
        layout,
        whitener,
        target,
    };

    let mut system = start.clone();
    if spectral_radius(&(&system.a - &system.k * &system.c))? > LARGEST_PREDICTOR_RADIUS {
        let (gain, _) = stabilising_observer_gain(
            &system.a,
            &system.c,
            &system.k,
            &varx.innovation_covariance,
        )?;
        system.k = gain;
    }
    let rank = layout.identifiable();
    let start_cost = problem.cost(&system);
    if !start_cost.is_finite() {
        return Err(LinalgError::NotFinite {
            what: "predictor coefficients",
        });
    }
    let mut cost = start_cost;
    let mut iterations = 0;
    let mut flat = 0;
    let mut converged = false;
    let covariance = loop {
        let jacobian = problem.jacobian(&system);
        if jacobian.iter().any(|v| !v.is_finite()) {
            return Err(LinalgError::NotFinite {
                what: "Gauss-Newton step",
            });
        }
        let residual = problem.residual(&system);
        let boundary = match largest_radius {
            Some(radius) => boundary_gradient(&system, &layout, radius)?,
            None => DMatrix::zeros(0, layout.len()),
        };
        let linearised = linearise(jacobian, residual.as_slice(), rank, &boundary)?;
        if linearised.decrease() < DECREASE || flat == FLAT_STEPS {
            converged = true;
            break linearised.covariance();
        }
        if iterations == ITERATIONS {
            break linearised.covariance();
        }
        iterations += 1;
        let theta = layout.pack(&system);
        // A cost is cheap beside a Jacobian: try all, take the best.
        let better = TRIES
            .iter()
            .filter_map(|&(length, damping)| {
                let moved: Vec<f64> = theta
                    .iter()
                    .zip(linearised.step(damping).iter())
                    .map(|(value, change)| value + length * change)
                    .collect();
                let candidate = layout.unpack(&moved, &system);
                let candidate = match largest_radius {
                    Some(radius) => with_poles_inside(&candidate, radius).ok()?,
                    None => candidate,
                };
                let candidate_cost = problem.cost(&candidate);
                (candidate_cost < cost).then_some((candidate, candidate_cost))
            })
            .min_by(|a, b| a.1.total_cmp(&b.1));
        match better {
            Some((candidate, candidate_cost)) => {
                flat = if cost - candidate_cost < GAIN {
                    flat + 1
                } else {
                    0
                };
                system = candidate;
                cost = candidate_cost;
            }
            None => {
                // At the minimum to rounding.
                converged = linearised.decrease() < GAIN * (1.0 + cost);
                break linearised.covariance();
            }
        }
    };
    Ok(Polished {
        system,
        covariance: ParameterCovariance {
            layout,
            matrix: covariance,
            degrees_of_freedom: None,
        },
        start_cost,
        cost,
        degrees_of_freedom: (outputs * varx.regressors()).saturating_sub(rank),
        iterations,
        converged,
    })
}

/// Cost of a system against the vector ARX estimate (chi-square units), infinite when its predictor
/// overflows.
///
/// # Errors
/// [`LinalgError`] when the innovation covariance is singular.
pub fn coefficient_cost(system: &StateSpace, varx: &Varx) -> Result<f64, LinalgError> {
    let upper = cholesky_upper(&varx.innovation_covariance)?;
    let coefficients = predictor_coefficients(system, varx.past, varx.feedthrough);
    let difference = &varx.output_factor - multiply_nt(&varx.regressor_factor, &coefficients);
    let cost = solve_upper_transposed(&upper, &difference.transpose()).norm_squared();
    Ok(if cost.is_finite() {
        cost
    } else {
        f64::INFINITY
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::qr_r;

    fn system(feedthrough: bool) -> StateSpace {
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
    fn varx_of(truth: &StateSpace, past: usize, feedthrough: bool) -> Varx {
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
            let whitener = solve_upper_transposed(
                &cholesky_upper(&varx.innovation_covariance).unwrap(),
                &DMatrix::identity(2, 2),
            );
            let problem = Problem {
                target: multiply_nt(&whitener, &varx.output_factor),
                varx: &varx,
                layout,
                whitener,
            };
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

    #[test]
    fn polish_finds_the_system_from_a_perturbed_start() {
        for feedthrough in [false, true] {
            let truth = system(feedthrough);
            let varx = varx_of(&truth, 6, feedthrough);
            let mut start = truth.clone();
            start.a[(0, 1)] += 0.05;
            start.b[(1, 0)] -= 0.1;
            start.k[(0, 0)] += 0.1;
            let result = polish(&start, &varx, None).unwrap();
            assert!(result.converged && result.cost < 1e-10 * result.start_cost);
            let found = predictor_coefficients(&result.system, 6, feedthrough);
            assert!((found - &varx.coefficients).amax() < 1e-8);
            assert!(result.iterations <= 12, "{}", result.iterations);
        }
    }
}
