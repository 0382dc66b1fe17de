//! Derivative of the estimate with respect to what is random in it: the regression coefficients `Theta` and the
//! residual covariance `P`.
//!
//! The state basis is held: with the left singular vectors `[U1 U2]` of the decomposition, a change of `Theta_p`
//! turns `U1` by `dU1 = U2 X` and `U2` by `dU2 = -U1 X'`; a turn of `U1` within its own span only changes the basis.
//! Everything else follows `Gamma_h = U1`, `Gamma_perp = U2` in closed form, so the chain rule runs through the
//! `n (h l - n)` entries of `X`.

use nalgebra::DMatrix;

use super::deterministic::Deterministic;
use super::future_regression::Regression;
use super::observability::{
    Decomposition, LeastSquares, extended_observability, stacked, toeplitz_regressor,
};
use super::stochastic::{NoiseModel, ResidualStep, gain_of_factor, right_quotient};
use crate::covariance::ParameterLayout;
use crate::identify::IdentifyError;
use crate::linalg::{cholesky_upper, multiply, multiply_tn, solve_upper, solve_upper_transposed};

/// Jacobian of `[theta; vech R]`, `theta` laid out by `layout`, `vech R` the lower triangle of the innovation
/// covariance column by column.
#[derive(Debug, Clone)]
pub(crate) struct Jacobian {
    /// Order of the parameters.
    pub(crate) layout: ParameterLayout,
    /// With respect to `Theta[a, b]`, one column for each at `a + h l b`.
    pub(crate) of_coefficients: DMatrix<f64>,
    /// With respect to a symmetric change of `P`: the derivative is `trace(S dP)` with the symmetric `S` of row `p`
    /// stored as a column vector, entry `(a, b)` at `a + h l b`.
    pub(crate) of_covariance: DMatrix<f64>,
}

impl Jacobian {
    /// Number of parameters with those of the innovation covariance.
    pub(crate) fn rows(&self) -> usize {
        self.of_coefficients.nrows()
    }
}

/// The pieces that every direction shares.
struct Shared<'a> {
    regression: &'a Regression,
    deterministic: &'a Deterministic,
    step: ResidualStep,
    layout: ParameterLayout,
    upper: LeastSquares,
    regressor: DMatrix<f64>,
    extended: DMatrix<f64>,
    /// Lower Cholesky factor of `P`.
    factor: DMatrix<f64>,
    g: DMatrix<f64>,
    k: DMatrix<f64>,
}

/// What moves with a direction.
struct Change {
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    c: DMatrix<f64>,
    d: DMatrix<f64>,
    k: DMatrix<f64>,
    r: DMatrix<f64>,
}

/// The Jacobian of Knudsen's estimate of one order.
///
/// `noise` is the noise model before any exchange for a minimum-phase one.
///
/// # Errors
/// As the estimate itself.
pub(crate) fn jacobian(
    regression: &Regression,
    decomposition: &Decomposition,
    deterministic: &Deterministic,
    noise: &NoiseModel,
    step: ResidualStep,
    feedthrough: bool,
) -> Result<Jacobian, IdentifyError> {
    let (a, c) = (&deterministic.a, &deterministic.c);
    let (outputs, n) = c.shape();
    let observability = &deterministic.observability;
    let factor = cholesky_upper(&regression.residual_covariance)?.transpose();
    let g = match step {
        ResidualStep::Cholesky => gain_of_factor(&factor, observability, a, c)?.0,
        ResidualStep::FirstColumn => DMatrix::identity(outputs, outputs),
    };
    let shared = Shared {
        regression,
        deterministic,
        step,
        layout: ParameterLayout {
            states: n,
            inputs: regression.inputs,
            outputs,
            feedthrough,
        },
        upper: LeastSquares::new(&observability.upper(), "the observability matrix")?,
        regressor: observability.toeplitz_regressor(a, c),
        extended: extended_observability(a, c, observability.future()),
        factor,
        g,
        k: noise.k.clone(),
    };
    let rows = regression.future * outputs;
    let free = rows - n;
    let parameters = shared.layout.len() + outputs * (outputs + 1) / 2;

    // Through X, entry (alpha, beta) at alpha + free beta.
    let mut of_turn = DMatrix::zeros(parameters, free * n);
    for beta in 0..n {
        for alpha in 0..free {
            let change = shared.along_turn(alpha, beta)?;
            of_turn
                .column_mut(alpha + free * beta)
                .copy_from_slice(&shared.pack(&change));
        }
    }
    let mut of_coefficients = DMatrix::zeros(parameters, rows * regression.regressors());
    let past = turn_of_past(regression, decomposition, n);
    let past_columns = rows * regression.past_rows();
    of_coefficients
        .columns_mut(0, past_columns)
        .copy_from(&multiply(&of_turn, &past));

    shared.of_future(&mut of_coefficients, past_columns)?;

    let mut of_covariance = DMatrix::zeros(parameters, rows * rows);
    for b in 0..rows {
        for a in b..rows {
            let change = shared.along_covariance(a, b)?;
            let packed = shared.pack(&change);
            // The direction is E_ab + E_ba: trace(S dP) = 2 S_ab.
            for (parameter, value) in packed.iter().enumerate() {
                let share = if a == b { *value } else { 0.5 * value };
                of_covariance[(parameter, a + rows * b)] = share;
                of_covariance[(parameter, b + rows * a)] = share;
            }
        }
    }
    Ok(Jacobian {
        layout: shared.layout,
        of_coefficients,
        of_covariance,
    })
}

/// `dX / dTheta_p`: first-order turn of the left singular vectors. With `D = dTheta_p W` (`W` the weight),
/// `X[alpha, beta] = (s_beta (U2' D V1) + s_alpha (U1' D V2)') / (s_beta^2 - s_alpha^2)`.
fn turn_of_past(regression: &Regression, decomposition: &Decomposition, n: usize) -> DMatrix<f64> {
    let left = &decomposition.left;
    let rows = left.nrows();
    let free = rows - n;
    let columns = regression.past_rows();
    // The weight is the transposed triangular factor: row b of it against the right vectors.
    let weighted = multiply(&regression.past_factor().transpose(), &decomposition.right);
    let s = &decomposition.values;
    DMatrix::from_fn(free * n, rows * columns, |x, theta| {
        let (alpha, beta) = (n + x % free, x / free);
        let (a, b) = (theta % rows, theta / rows);
        let denominator = s[beta] * s[beta] - s[alpha] * s[alpha];
        (s[beta] * left[(a, alpha)] * weighted[(b, beta)]
            + s[alpha] * left[(a, beta)] * weighted[(b, alpha)])
            / denominator
    })
}

impl Shared<'_> {
    fn pack(&self, change: &Change) -> Vec<f64> {
        let mut out = Vec::with_capacity(self.layout.len() + change.r.len());
        for matrix in [&change.a, &change.b, &change.k, &change.c] {
            out.extend_from_slice(matrix.as_slice());
        }
        if self.layout.feedthrough {
            out.extend_from_slice(change.d.as_slice());
        }
        for column in 0..change.r.ncols() {
            out.extend(change.r.column(column).iter().skip(column));
        }
        out
    }

    /// `Gamma_h` turns towards vector `alpha` of its complement in its column `beta`.
    fn along_turn(&self, alpha: usize, beta: usize) -> Result<Change, IdentifyError> {
        let observability = &self.deterministic.observability;
        let (a, c) = (&self.deterministic.a, &self.deterministic.c);
        let (outputs, n) = c.shape();
        let rows = observability.gamma.nrows();
        let free = rows - n;
        let mut gamma = DMatrix::zeros(rows, n);
        gamma
            .column_mut(beta)
            .copy_from(&observability.complement.column(alpha));
        let mut complement = DMatrix::zeros(rows, free);
        complement
            .column_mut(alpha)
            .copy_from(&(-observability.gamma.column(beta)));

        let above = gamma.rows(0, rows - outputs).into_owned();
        let below = gamma.rows(outputs, rows - outputs).into_owned();
        let da = {
            let residual = observability.lower() - observability.upper() * a;
            self.upper.solve(&(below - &above * a))
                + self.upper.solve_normal(&multiply_tn(&above, &residual))
        };
        let dc = gamma.rows(0, outputs).into_owned();

        // Derivative of [C; C A; ...], block by block.
        let mut extended = DMatrix::zeros(rows, n);
        let mut block = dc.clone();
        for k in 0..rows / outputs {
            extended.rows_mut(k * outputs, outputs).copy_from(&block);
            block = &block * a + self.extended.rows(k * outputs, outputs) * &da;
        }
        let complement_of = &observability.complement;
        let through_complement = toeplitz_regressor(&complement, &self.extended, outputs);
        let mut through_state = toeplitz_regressor(complement_of, &extended, outputs);
        // The direct columns hold the complement itself, which the state does not move.
        through_state.columns_mut(0, outputs).fill(0.0);
        let regressor = through_complement + through_state;

        let toeplitz = self.regression.future_coefficients();
        let inputs = self.regression.inputs;
        let first = if self.layout.feedthrough { 0 } else { outputs };
        let db = self.moved_solution(
            first,
            &stacked(complement_of, &toeplitz, inputs),
            &stacked(&complement, &toeplitz, inputs),
            Some(&regressor),
        )?;
        let (dk, dr) = match self.step {
            ResidualStep::FirstColumn => {
                let below = self.first_column_below();
                let kr = &self.k * self.first_block();
                let residual = &below - observability.upper() * &kr;
                let moved = -self.upper.solve(&(&above * &kr))
                    + self.upper.solve_normal(&multiply_tn(&above, &residual));
                (
                    self.over_first_block(&moved),
                    DMatrix::zeros(outputs, outputs),
                )
            }
            ResidualStep::Cholesky => self.moved_gain(
                &stacked(&complement, &self.factor, outputs),
                Some(&regressor),
            )?,
        };
        Ok(Change {
            a: da,
            c: dc,
            b: db.rows(outputs - first, n).into_owned(),
            d: if self.layout.feedthrough {
                db.rows(0, outputs).into_owned()
            } else {
                DMatrix::zeros(outputs, inputs)
            },
            k: dk,
            r: dr,
        })
    }

    /// Change of a least-squares solution: `dx = F^+ (db - dF x) + (F' F)^-1 dF' (b - F x)`, for the regressor
    /// without its first columns.
    fn moved_solution(
        &self,
        first: usize,
        right: &DMatrix<f64>,
        right_change: &DMatrix<f64>,
        regressor_change: Option<&DMatrix<f64>>,
    ) -> Result<DMatrix<f64>, IdentifyError> {
        let kept = |m: &DMatrix<f64>| m.columns(first, m.ncols() - first).into_owned();
        let regressor = kept(&self.regressor);
        let problem = LeastSquares::new(&regressor, "the responses to the inputs")?;
        let Some(change) = regressor_change.map(kept) else {
            return Ok(problem.solve(right_change));
        };
        let solution = problem.solve(right);
        let residual = right - &regressor * &solution;
        Ok(problem.solve(&(right_change - &change * &solution))
            + problem.solve_normal(&multiply_tn(&change, &residual)))
    }

    /// `dK` and `dR` of the Cholesky step, column by column as in (38).
    fn moved_gain(
        &self,
        right_change: &DMatrix<f64>,
        regressor_change: Option<&DMatrix<f64>>,
    ) -> Result<(DMatrix<f64>, DMatrix<f64>), IdentifyError> {
        let outputs = self.g.nrows();
        let n = self.k.nrows();
        let right = self
            .deterministic
            .observability
            .stacked(&self.factor, outputs);
        let mut dg = DMatrix::zeros(outputs, outputs);
        let mut dm = DMatrix::zeros(n, outputs);
        for column in 0..outputs {
            let change = self.moved_solution(
                column,
                &right.columns(column, 1).into_owned(),
                &right_change.columns(column, 1).into_owned(),
                regressor_change,
            )?;
            dg.view_mut((column, column), (outputs - column, 1))
                .copy_from(&change.rows(0, outputs - column));
            dm.view_mut((0, column), (n, 1))
                .copy_from(&change.rows(outputs - column, n));
        }
        let dk = right_quotient(&(dm - &self.k * &dg), &self.g)?;
        let half = &dg * self.g.transpose();
        let dr = &half + half.transpose();
        Ok((dk, dr))
    }

    fn first_block(&self) -> DMatrix<f64> {
        let outputs = self.g.nrows();
        self.regression
            .residual_covariance
            .view((0, 0), (outputs, outputs))
            .into_owned()
    }

    fn first_column_below(&self) -> DMatrix<f64> {
        let outputs = self.g.nrows();
        let residual = &self.regression.residual_covariance;
        residual
            .view((outputs, 0), (residual.nrows() - outputs, outputs))
            .into_owned()
    }

    /// `X R^-1`.
    fn over_first_block(&self, x: &DMatrix<f64>) -> DMatrix<f64> {
        let outputs = self.g.nrows();
        let lower = self.factor.view((0, 0), (outputs, outputs)).into_owned();
        let upper = lower.transpose();
        solve_upper(&upper, &solve_upper_transposed(&upper, &x.transpose())).transpose()
    }

    /// Derivatives with respect to `Theta_f`: only `[D; B]` moves, and each input by itself.
    fn of_future(&self, out: &mut DMatrix<f64>, first_column: usize) -> Result<(), IdentifyError> {
        let ParameterLayout {
            states: n,
            inputs,
            outputs,
            feedthrough,
        } = self.layout;
        let complement = &self.deterministic.observability.complement;
        let rows = complement.nrows();
        let free = complement.ncols();
        let first = if feedthrough { 0 } else { outputs };
        let kept = self
            .regressor
            .columns(first, self.regressor.ncols() - first)
            .into_owned();
        let problem = LeastSquares::new(&kept, "the responses to the inputs")?;
        for block in 0..rows / outputs {
            // All rows of one block column of H at once.
            let mut right = DMatrix::zeros(kept.nrows(), rows);
            right
                .view_mut((block * free, 0), (free, rows))
                .copy_from(&complement.transpose());
            let change = problem.solve(&right);
            for input in 0..inputs {
                for a in 0..rows {
                    let column = first_column + a + rows * (block * inputs + input);
                    for state in 0..n {
                        out[(self.layout.b() + state + n * input, column)] =
                            change[(outputs - first + state, a)];
                    }
                    if feedthrough {
                        for output in 0..outputs {
                            out[(self.layout.d() + output + outputs * input, column)] =
                                change[(output, a)];
                        }
                    }
                }
            }
        }
        Ok(())
    }

    /// `P` changes by `E_ab + E_ba` (by `E_aa` on the diagonal).
    fn along_covariance(&self, a: usize, b: usize) -> Result<Change, IdentifyError> {
        let ParameterLayout {
            states: n,
            inputs,
            outputs,
            ..
        } = self.layout;
        let rows = self.factor.nrows();
        let mut change = DMatrix::zeros(rows, rows);
        change[(a, b)] = 1.0;
        change[(b, a)] = 1.0;
        let (k, r) = match self.step {
            ResidualStep::FirstColumn => {
                let dr = change.view((0, 0), (outputs, outputs)).into_owned();
                let below = change
                    .view((outputs, 0), (rows - outputs, outputs))
                    .into_owned();
                let dkr = self.upper.solve(&below);
                (self.over_first_block(&(dkr - &self.k * &dr)), dr)
            }
            ResidualStep::Cholesky => {
                // dL = L low(L^-1 dP L'^-1), low: the lower triangle with half the diagonal.
                let upper = self.factor.transpose();
                let half = solve_upper_transposed(&upper, &change);
                let mut whitened = solve_upper_transposed(&upper, &half.transpose());
                for j in 0..rows {
                    whitened[(j, j)] *= 0.5;
                    for i in 0..j {
                        whitened[(i, j)] = 0.0;
                    }
                }
                let factor = multiply(&self.factor, &whitened);
                let complement = &self.deterministic.observability.complement;
                self.moved_gain(&stacked(complement, &factor, outputs), None)?
            }
        };
        Ok(Change {
            a: DMatrix::zeros(n, n),
            b: DMatrix::zeros(n, inputs),
            c: DMatrix::zeros(outputs, n),
            d: DMatrix::zeros(outputs, inputs),
            k,
            r,
        })
    }
}
