//! The operating point of a simulated output.
//!
//! A linear simulator that was made about an operating point says `y = y0 + G (u - u0)`: affine in the recorded inputs,
//! `y = c + G u`. Without `c` it would count as nonlinear.

use nalgebra::DMatrix;

use super::autoregression::Autoregression;
use crate::explain::linear::data::Data;
use crate::linalg::least_squares;

/// Highest autoregressive order tried.
const MOST_ORDER: usize = 8;
/// Residual, as a share of the output's deviation, at which a noise-free regression holds: files hold about nine digits.
const EXACT: f64 = 1e-7;

/// `c`, an output each, of the lowest order of autoregression that reproduces the outputs; none where none does, or
/// where a pole at one takes any constant up.
pub(crate) fn operating_point(data: &Data) -> Option<Vec<f64>> {
    (1..=MOST_ORDER).find_map(|order| of_order(data, order, EXACT))
}

/// The same of one order of autoregression, as well as it holds.
pub(crate) fn level_at(data: &Data, order: usize) -> Option<Vec<f64>> {
    of_order(data, order, f64::INFINITY)
}

/// Least squares of `y[k] = sum A_i y[k-i] + sum B_i u[k-i] + k0`, all channels scaled, and `(I - sum A_i) c = k0`.
fn of_order(data: &Data, order: usize, exact: f64) -> Option<Vec<f64>> {
    let (r, l) = (data.inputs, data.outputs);
    let Autoregression {
        regressors,
        targets,
        output_scale,
        ..
    } = Autoregression::new(data, order, true)?;
    let found = least_squares(&regressors, &targets).ok()?;
    let missed = (&targets - crate::linalg::multiply(&regressors, &found)).norm();
    if missed.is_nan() || missed > exact * (targets.len() as f64).sqrt() {
        return None;
    }
    let mut through = DMatrix::<f64>::identity(l, l);
    for lag in 1..=order {
        for o in 0..l {
            for p in 0..l {
                through[(o, p)] -= found[(Autoregression::column(data, lag, r + p), o)];
            }
        }
    }
    let constant = DMatrix::from_fn(l, 1, |o, _| found[(found.nrows() - 1, o)]);
    let c = through.lu().solve(&constant)?;
    let c: Vec<f64> = (0..l).map(|o| c[(o, 0)] * output_scale[o]).collect();
    c.iter().all(|v| v.is_finite()).then_some(c)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explain::linear::data::Segment;

    /// Two coupled outputs about a level: it is found, whatever the initial state.
    #[test]
    fn a_level_is_found() {
        let mut x = [0.4, -1.0];
        let level = [5.0, -3.0];
        let (mut u, mut y) = (Vec::new(), [Vec::new(), Vec::new()]);
        for k in 0..400 {
            let input = (0.13 * f64::from(k)).sin() + (0.031 * f64::from(k * k)).cos();
            u.push(input + 2.0);
            for (y, (x, level)) in y.iter_mut().zip(x.iter().zip(level)) {
                y.push(x + level);
            }
            x = [
                0.8 * x[0] + 0.1 * x[1] + input,
                -0.2 * x[0] + 0.7 * x[1] + 0.5 * input,
            ];
        }
        let data = Data {
            segments: vec![Segment {
                inputs: vec![u],
                outputs: y.to_vec(),
                start_time: 0.0,
            }],
            sample_time: 1.0,
            inputs: 1,
            outputs: 2,
            constant: false,
        };
        let c = operating_point(&data).expect("an operating point");
        // At rest with u = 0: x = (I - A)^-1 B (0 - 2).
        let a = nalgebra::Matrix2::new(0.8, 0.1, -0.2, 0.7);
        let rest = (nalgebra::Matrix2::identity() - a)
            .try_inverse()
            .expect("stable")
            * nalgebra::Vector2::new(1.0, 0.5)
            * -2.0;
        for o in 0..2 {
            assert!((c[o] - level[o] - rest[o]).abs() < 1e-6, "{c:?}");
        }
    }
}
