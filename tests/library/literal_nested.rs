//! Chiuso & Picci (3.1)-(3.5) written out, with the conditional covariances and Kronecker products of the paper, against
//! the compact form; and what the errors in print do.

use innovant::covariance::{ParameterCovariance, frequency_response_covariance};
use innovant::identify::{Prediction, Weight};
use innovant::internal::identify::{AsymptoticMethod, asymptotic_covariance};
use innovant::internal::linalg::discrete_lyapunov;
use innovant::internal::systems::{ClosedLoop, chiuso_picci_one, van_wingerden_one};
use nalgebra::DMatrix;

type Matrix = DMatrix<f64>;

/// Which of the printed errors are kept.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Print {
    Repaired,
    /// `A - K C` in `M_x1`.
    PredictorInState,
    /// `tau = h - k` in (3.5).
    Lag,
}

/// Exact second-order moments of a closed loop, and the paper's quantities made of them.
struct Literal {
    plant: ClosedLoop,
    past: usize,
    future: usize,
    /// `E z[k + tau] z[k]'`, `tau = 0, 1, ...`
    lagged: Vec<Matrix>,
    /// `E x[t] z[t - i]'`, `i = 1, 2, ...`
    state_with: Vec<Matrix>,
}

fn inverse(matrix: &Matrix) -> Matrix {
    matrix.clone().try_inverse().unwrap()
}

impl Literal {
    fn new(plant: ClosedLoop, past: usize, future: usize) -> Self {
        let joint = plant.joint().unwrap();
        let noise = &joint.noise_to_state * joint.noise_to_state.transpose();
        let states = discrete_lyapunov(&joint.transition, &noise).unwrap();
        let mut state = &joint.transition * &states * joint.output.transpose()
            + &joint.noise_to_state * joint.noise_to_output.transpose();
        let mut lagged = vec![
            &joint.output * &states * joint.output.transpose()
                + &joint.noise_to_output * joint.noise_to_output.transpose(),
        ];
        let mut state_with = Vec::new();
        for _ in 0..=past + future {
            lagged.push(&joint.output * &state);
            state_with.push(state.rows(0, plant.plant.states()).into_owned());
            state = &joint.transition * state;
        }
        Self {
            plant,
            past,
            future,
            lagged,
            state_with,
        }
    }

    fn channels(&self) -> usize {
        self.plant.plant.inputs() + self.plant.plant.outputs()
    }

    /// `E z_[a, b) z_[c, d)'`, oldest first.
    fn between(&self, (a, b): (isize, isize), (c, d): (isize, isize)) -> Matrix {
        let q = self.channels();
        let mut out = Matrix::zeros((b - a) as usize * q, (d - c) as usize * q);
        for i in a..b {
            for j in c..d {
                let block = if i >= j {
                    self.lagged[(i - j) as usize].clone()
                } else {
                    self.lagged[(j - i) as usize].transpose()
                };
                out.view_mut(((i - a) as usize * q, (j - c) as usize * q), (q, q))
                    .copy_from(&block);
            }
        }
        out
    }

    /// `E[ z^{k}_[first] (z^{h}_[second])' ]`: each window less its projection on the window after it.
    fn conditional(
        &self,
        (first, after_first): ((isize, isize), (isize, isize)),
        (second, after_second): ((isize, isize), (isize, isize)),
    ) -> Matrix {
        let projection = |window, after: (isize, isize)| {
            (after.1 > after.0)
                .then(|| self.between(window, after) * inverse(&self.between(after, after)))
        };
        let (left, right) = (
            projection(first, after_first),
            projection(second, after_second),
        );
        let mut out = self.between(first, second);
        if let Some(left) = &left {
            out -= left * self.between(after_first, second);
        }
        if let Some(right) = &right {
            out -= self.between(first, after_second) * right.transpose();
        }
        if let (Some(left), Some(right)) = (&left, &right) {
            out += left * self.between(after_first, after_second) * right.transpose();
        }
        out
    }

    /// (3.3)-(3.5): the covariance of `[vec d_0; ...]` of both families of regressions.
    fn sigma(&self, print: Print) -> Matrix {
        let (past, f) = (self.past as isize, self.future as isize);
        let lambda = &self.plant.innovation_covariance;
        let l = lambda.nrows();
        // z^- with its k lags of future, and z-bar^- with its k - 1, both shifted by tau.
        let short = |k: isize, tau: isize| ((tau - past, tau), (tau, tau + k));
        let long = |k: isize, tau: isize| ((tau - past, tau + 1), (tau + 1, tau + k));
        let whiten = |window| {
            let own = self.conditional(window, window);
            inverse(&own).kronecker(&Matrix::identity(l, l))
        };
        let size = self.past * self.channels() * l;
        let longer = (self.past + 1) * self.channels() * l;
        let total = self.future * (size + longer);
        let mut sigma = Matrix::zeros(total, total);
        for k in 1..=f {
            for h in 1..=f {
                let (row, column) = ((k - 1) as usize, (h - 1) as usize);
                let tau = h - k;
                let own = self.conditional(short(k - 1, tau), short(h - 1, 0));
                let block =
                    whiten(short(k - 1, 0)) * own.kronecker(lambda) * whiten(short(h - 1, 0));
                sigma
                    .view_mut((row * size, column * size), (size, size))
                    .copy_from(&block);
                let second = self.future * size;
                let own = self.conditional(long(k, tau), long(h, 0));
                let block = whiten(long(k, 0)) * own.kronecker(lambda) * whiten(long(h, 0));
                sigma
                    .view_mut(
                        (second + row * longer, second + column * longer),
                        (longer, longer),
                    )
                    .copy_from(&block);
                // Both regressions carry the noise of the same sample: one step more than printed.
                let tau = if print == Print::Lag { tau } else { tau + 1 };
                let own = self.conditional(short(k - 1, tau), long(h, 0));
                let block = whiten(short(k - 1, 0)) * own.kronecker(lambda) * whiten(long(h, 0));
                sigma
                    .view_mut((row * size, second + column * longer), (size, longer))
                    .copy_from(&block);
                sigma
                    .view_mut((second + column * longer, row * size), (longer, size))
                    .copy_from(&block.transpose());
            }
        }
        sigma
    }

    /// `P`: from `[vec d_0; ..; vec d_{f-1}]` to `vec [d_0; ..; d_{f-1}]`, `d_k` of `l x columns`.
    fn permutation(&self, columns: usize) -> Matrix {
        let l = self.plant.plant.outputs();
        let f = self.future;
        let mut p = Matrix::zeros(f * l * columns, f * l * columns);
        for k in 0..f {
            for c in 0..columns {
                for r in 0..l {
                    p[(c * f * l + k * l + r, k * l * columns + c * l + r)] = 1.0;
                }
            }
        }
        p
    }

    /// (3.1) with the weight `W = I`, `N` times the covariance of `[vec A; vec B; vec K; vec C]`.
    fn covariance(&self, print: Print) -> ParameterCovariance {
        let system = &self.plant.plant;
        let (n, r, l) = (system.states(), system.inputs(), system.outputs());
        let (q, p, f) = (self.channels(), self.past, self.future);
        let predictor = &system.a - &system.k * &system.c;
        let mut gamma = Matrix::zeros(f * l, n);
        let mut row = system.c.clone();
        for i in 0..f {
            gamma.rows_mut(i * l, l).copy_from(&row);
            row = &row * &predictor;
        }
        let left_inverse = inverse(&(gamma.transpose() * &gamma)) * gamma.transpose();
        let mut first = Matrix::zeros(l, f * l);
        first.fill_with_identity();
        let in_state = if print == Print::PredictorInState {
            &predictor
        } else {
            &system.a
        };
        let m_x1 = &system.k * &first - in_state * &left_inverse;
        let m_x2 = left_inverse.clone();
        let m_y = &first - &system.c * &left_inverse;

        // The state and the residual that the finite past makes, with the input, as functions of z_[t-p, t].
        let past = self.between((-(p as isize), 0), (-(p as isize), 0));
        let both = self.between((-(p as isize), 1), (-(p as isize), 1));
        let mut with_state = Matrix::zeros(n, p * q);
        for i in 1..=p {
            with_state
                .columns_mut((p - i) * q, q)
                .copy_from(&self.state_with[i - 1]);
        }
        let mut of_window = Matrix::zeros(n + r + l, (p + 1) * q);
        of_window
            .view_mut((0, 0), (n, p * q))
            .copy_from(&(with_state * inverse(&past)));
        for i in 0..r {
            of_window[(n + i, p * q + i)] = 1.0;
        }
        let outputs = both.view((p * q + r, 0), (l, p * q)).into_owned();
        of_window
            .view_mut((n + r, 0), (l, p * q))
            .copy_from(&(-outputs * inverse(&past)));
        for i in 0..l {
            of_window[(n + r + i, p * q + r + i)] = 1.0;
        }
        let with_window = &of_window * &both;
        let own = &with_window * of_window.transpose();

        // Sigma_{aa|b}^-1 Sigma_{z a|b}' for a the rows `of`, b the other rows, z the first `width` of the window.
        let conditional = |of: std::ops::Range<usize>, given: Vec<usize>, width: usize| {
            let a: Vec<usize> = of.collect();
            let pick = |rows: &[usize], columns: &[usize]| {
                Matrix::from_fn(rows.len(), columns.len(), |i, j| own[(rows[i], columns[j])])
            };
            let z = |rows: &[usize]| {
                Matrix::from_fn(rows.len(), width, |i, j| with_window[(rows[i], j)])
            };
            let (mut aa, mut az) = (pick(&a, &a), z(&a));
            if !given.is_empty() {
                let onto = pick(&a, &given) * inverse(&pick(&given, &given));
                aa -= &onto * pick(&given, &a);
                az -= &onto * z(&given);
            }
            inverse(&aa) * az
        };
        let others = |of: &std::ops::Range<usize>| {
            (0..n + r + l)
                .filter(|i| !of.contains(i))
                .collect::<Vec<_>>()
        };
        let (short, long) = (p * q, (p + 1) * q);
        let (p_short, p_long) = (self.permutation(short), self.permutation(long));
        let mut rows: Vec<Matrix> = Vec::new();
        let side_by_side = |left: Matrix, right: Matrix| {
            let mut out = Matrix::zeros(left.nrows(), left.ncols() + right.ncols());
            out.columns_mut(0, left.ncols()).copy_from(&left);
            out.columns_mut(left.ncols(), right.ncols())
                .copy_from(&right);
            out
        };
        for of in [0..n, n..n + r, n + r..n + r + l] {
            let given = others(&of);
            let one = conditional(of.clone(), given.clone(), short).kronecker(&m_x1) * &p_short;
            let two = conditional(of, given, long).kronecker(&m_x2) * &p_long;
            rows.push(side_by_side(one, two));
        }
        let one = conditional(0..n, Vec::new(), short).kronecker(&m_y) * &p_short;
        rows.push(side_by_side(one, Matrix::zeros(l * n, f * l * long)));
        let height = rows.iter().map(Matrix::nrows).sum();
        let mut stacked = Matrix::zeros(height, rows[0].ncols());
        let mut from = 0;
        for block in &rows {
            stacked.rows_mut(from, block.nrows()).copy_from(block);
            from += block.nrows();
        }
        let matrix = &stacked * self.sigma(print) * stacked.transpose();
        let layout = innovant::covariance::ParameterLayout {
            states: n,
            inputs: r,
            outputs: l,
            feedthrough: false,
        };
        ParameterCovariance::new(layout, matrix, None).unwrap()
    }
}

fn compact(plant: &ClosedLoop, past: usize, future: usize) -> ParameterCovariance {
    let method = AsymptoticMethod::Nested(Prediction::Whitening);
    asymptotic_covariance(plant, method, Weight::Identity, past, future).unwrap()
}

fn two_by_two() -> ClosedLoop {
    ClosedLoop {
        innovation_covariance: DMatrix::from_row_slice(2, 2, &[1.0, 0.4, 0.4, 0.5]),
        ..ClosedLoop::from(&van_wingerden_one())
    }
}

#[test]
fn compact_form_is_the_papers() {
    for (name, plant, past, future) in [
        ("example 1", chiuso_picci_one(), 10, 5),
        ("two by two", two_by_two(), 5, 3),
    ] {
        let literal = Literal::new(plant.clone(), past, future).covariance(Print::Repaired);
        let compact = compact(&plant, past, future);
        let error = (&literal.matrix - &compact.matrix).amax() / literal.matrix.amax();
        println!("{name}: compact against (3.1) {error:.1e}");
        assert!(error < 1e-9, "{name}: {error:e}");
    }
}

/// As printed, the variance of the frequency response comes out several times too large or too small.
#[test]
fn printed_errors_change_the_variance() {
    let plant = chiuso_picci_one();
    let (past, future) = (10, 5);
    let literal = Literal::new(plant.clone(), past, future);
    let variance = |covariance: &ParameterCovariance, w: f64| {
        let c = frequency_response_covariance(&plant.plant, covariance, w).unwrap()[0];
        c[0][0] + c[1][1]
    };
    let right = compact(&plant, past, future);
    for print in [Print::PredictorInState, Print::Lag] {
        let wrong = literal.covariance(print);
        let ratios: Vec<f64> = [0.02, 0.35, 3.0]
            .iter()
            .map(|&w| variance(&wrong, w) / variance(&right, w))
            .collect();
        println!("{print:?}: variance of F times {ratios:.1?}");
        assert!(ratios.iter().all(|r| *r > 5.0), "{print:?}: {ratios:?}");
    }
}
