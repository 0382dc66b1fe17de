//! The data factor and the vector ARX model against a reference with twice the digits (double-double arithmetic: 32
//! digits), from well-conditioned recordings to those at the edge of what doubles can tell: errors in units of the
//! standard deviations that the model states.

use innovant::internal::identify::varx;
use innovant::internal::linalg::{cholesky_upper, solve_upper_transposed};
use innovant::internal::moments::{PanelQr, RFactor, Route, Trend};
use innovant::internal::systems::two_by_two;
use nalgebra::DMatrix;

/// An unevaluated sum of two doubles (Dekker 1971, Knuth).
#[derive(Clone, Copy)]
struct Double {
    high: f64,
    low: f64,
}

impl Double {
    const ZERO: Self = Self {
        high: 0.0,
        low: 0.0,
    };

    fn of(value: f64) -> Self {
        Self {
            high: value,
            low: 0.0,
        }
    }

    fn sum(a: f64, b: f64) -> Self {
        let high = a + b;
        let part = high - a;
        Self {
            high,
            low: (a - (high - part)) + (b - part),
        }
    }

    fn plus(self, other: Self) -> Self {
        let s = Self::sum(self.high, other.high);
        Self::sum(s.high, s.low + self.low + other.low)
    }

    fn times(self, other: Self) -> Self {
        let high = self.high * other.high;
        let low = self.high.mul_add(other.high, -high);
        Self::sum(high, low + self.high * other.low + self.low * other.high)
    }

    fn negative(self) -> Self {
        Self {
            high: -self.high,
            low: -self.low,
        }
    }

    fn over(self, other: Self) -> Self {
        let first = Self::of(self.high / other.high);
        let rest = self.plus(first.times(other).negative());
        first.plus(Self::of(rest.high / other.high))
    }

    fn root(self) -> Self {
        let first = Self::of(self.high.sqrt());
        let rest = self.plus(first.times(first).negative());
        first.plus(Self::of(rest.high / (2.0 * first.high)))
    }
}

fn dot(a: &[Double], b: &[Double]) -> Double {
    a.iter()
        .zip(b)
        .fold(Double::ZERO, |sum, (x, y)| sum.plus(x.times(*y)))
}

/// Least squares of each column of `targets` on `regressors` by modified Gram-Schmidt, done twice.
fn least_squares(regressors: &[Vec<f64>], targets: &[Vec<f64>]) -> DMatrix<f64> {
    let wide = |columns: &[Vec<f64>]| -> Vec<Vec<Double>> {
        let column = |c: &Vec<f64>| c.iter().map(|v| Double::of(*v)).collect();
        columns.iter().map(column).collect()
    };
    let mut q = wide(regressors);
    let y = wide(targets);
    let m = q.len();
    let mut r = vec![vec![Double::ZERO; m]; m];
    for j in 0..m {
        for _ in 0..2 {
            for i in 0..j {
                let (before, from) = q.split_at_mut(j);
                let along = dot(&before[i], &from[0]);
                for (value, unit) in from[0].iter_mut().zip(&before[i]) {
                    *value = value.plus(along.times(*unit).negative());
                }
                r[i][j] = r[i][j].plus(along);
            }
        }
        let length = dot(&q[j], &q[j]).root();
        r[j][j] = length;
        for value in &mut q[j] {
            *value = value.over(length);
        }
    }
    let mut out = DMatrix::zeros(y.len(), m);
    for (row, target) in y.iter().enumerate() {
        let mut right: Vec<Double> = q.iter().map(|unit| dot(unit, target)).collect();
        for j in (0..m).rev() {
            for k in j + 1..m {
                let solved = right[k];
                right[j] = right[j].plus(r[j][k].times(solved).negative());
            }
            right[j] = right[j].over(r[j][j]);
            out[(row, j)] = right[j].high;
        }
    }
    out
}

#[test]
fn the_model_is_that_of_twice_the_digits() {
    const PAST: usize = 4;
    const SAMPLES: usize = 1200;
    let mut routes = Vec::new();
    for (order, pole) in [(0, 0.0), (1, 0.9), (2, 0.97), (4, 0.97), (4, 0.995)] {
        let gain = f64::sqrt(1.0 - pole * pole);
        let mut states = [[0.0; 4]; 2];
        let log = two_by_two().record_with(SAMPLES, 9, |_, channel, white| {
            let filters = &mut states[channel][..order];
            filters.iter_mut().fold(white, |input, state| {
                *state = pole * *state + gain * input;
                *state
            })
        });
        let columns: Vec<&[f64]> = log
            .input_data
            .iter()
            .chain(&log.output_data)
            .map(Vec::as_slice)
            .collect();
        let scale: Vec<f64> = columns
            .iter()
            .map(|c| (c.iter().map(|v| v * v).sum::<f64>() / c.len() as f64).sqrt())
            .collect();

        let windows = SAMPLES - PAST;
        let at = |lag: usize, c: usize| -> Vec<f64> {
            let part = &columns[c][lag..lag + windows];
            part.iter().map(|v| v / scale[c]).collect()
        };
        let regressors: Vec<Vec<f64>> = (0..PAST)
            .flat_map(|lag| (0..4).map(move |c| (lag, c)))
            .map(|(lag, c)| at(lag, c))
            .collect();
        let reference = least_squares(&regressors, &[at(PAST, 2), at(PAST, 3)]);

        let scaled: Vec<Vec<f64>> = (0..4)
            .map(|c| columns[c].iter().map(|v| v / scale[c]).collect())
            .collect();
        let slices: Vec<&[f64]> = scaled.iter().map(Vec::as_slice).collect();
        let factor = RFactor::of_samples(&slices, 2, PAST).unwrap_or_else(|_| {
            let mut panels = PanelQr::new(PAST, &[1.0; 4]);
            panels.start_experiment(&Trend::zero(4));
            panels.push(&slices);
            let (r, columns) = panels.finish();
            RFactor::from_panels(r, columns, 2, &[1.0; 4])
        });
        let found = varx(&factor, false).unwrap();
        let upper = cholesky_upper(&found.innovation_covariance).unwrap();
        let moved = (&found.coefficients - &reference) * found.regressor_factor.transpose();
        let apart = solve_upper_transposed(&upper, &moved).norm();
        println!(
            "reciprocal condition {:.1e}, {:?}: {apart:.1e} standard deviations",
            factor.reciprocal_condition, factor.route
        );
        assert!(apart < 1e-4, "{apart:e}");
        routes.push(factor.route);
    }
    // Both ways to the factor were gone.
    assert!(routes.contains(&Route::LagGram) && routes.contains(&Route::PanelQr));
}
