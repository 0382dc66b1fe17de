//! The two examples of Chiuso & Picci, section 5. All printed numbers are used as they are.

use nalgebra::DMatrix;

use super::closed_loop::ClosedLoop;
use crate::model::StateSpace;

/// The eight frequencies (rad/sample) at which the studies of these examples look, `logspace(0.02, 3)`.
pub fn chiuso_picci_frequencies() -> [f64; 8] {
    let (low, high) = (0.02_f64.ln(), 3.0_f64.ln());
    std::array::from_fn(|i| (low + (high - low) * i as f64 / 7.0).exp())
}

/// Example 1: first order, `u = 5 r - y`; past window 10, future window 5, 1000 columns in the paper. The closed
/// loop has its pole at -0.5, and because `K = B` the noise does not reach the state.
pub fn chiuso_picci_one() -> ClosedLoop {
    let one = |value: f64| DMatrix::from_element(1, 1, value);
    ClosedLoop {
        plant: StateSpace {
            a: one(0.9),
            b: one(1.0),
            c: one(1.4),
            d: one(0.0),
            k: one(1.0),
            sample_time: 1.0,
        },
        innovation_covariance: one(1.0),
        controller: gain(-1.0),
        reference_gain: one(5.0),
    }
}

/// Example 2: fifth order with a pole at one, `u = r - H(z) y` with a controller of order four; past window 25,
/// future window 15, 2000 columns in the paper. The predictor `A - K C` has its eigenvalues at 0.8, 0.7, 0.6, -0.1
/// and 0.1, so that a past window of 25 truncates noticeably.
pub fn chiuso_picci_two() -> ClosedLoop {
    let one = |value: f64| DMatrix::from_element(1, 1, value);
    let mut a = DMatrix::zeros(5, 5);
    for (i, value) in [4.40, -8.09, 7.83, -4.0, 0.86].into_iter().enumerate() {
        a[(i, 0)] = value;
        if i < 4 {
            a[(i, i + 1)] = 1.0;
        }
    }
    let column = |values: [f64; 5]| DMatrix::from_column_slice(5, 1, &values);
    ClosedLoop {
        plant: StateSpace {
            a,
            b: column([0.00098, 0.01299, 0.01859, 0.0033, -0.00002]),
            c: DMatrix::from_row_slice(1, 5, &[1.0, 0.0, 0.0, 0.0, 0.0]),
            d: one(0.0),
            k: column([2.3, -6.64, 7.515, -4.0146, 0.86336]),
            sample_time: 1.0,
        },
        innovation_covariance: one(1.0),
        controller: minus_filter(
            &[0.63, -2.083, 2.8222, -1.865, 0.4978],
            &[1.0, -2.65, 3.11, -1.75, 0.39],
        ),
        reference_gain: one(1.0),
    }
}

fn gain(value: f64) -> StateSpace {
    minus_filter(&[-value], &[1.0])
}

/// `-N(q^-1) / D(q^-1)` in observer form; both polynomials have the same length, and `D` begins with one.
fn minus_filter(numerator: &[f64], denominator: &[f64]) -> StateSpace {
    let n = denominator.len() - 1;
    let direct = numerator[0];
    StateSpace {
        a: DMatrix::from_fn(n, n, |i, j| {
            if j == 0 {
                -denominator[i + 1]
            } else if j == i + 1 {
                1.0
            } else {
                0.0
            }
        }),
        b: DMatrix::from_fn(n, 1, |i, _| direct * denominator[i + 1] - numerator[i + 1]),
        c: DMatrix::from_fn(1, n, |_, j| if j == 0 { 1.0 } else { 0.0 }),
        d: DMatrix::from_element(1, 1, -direct),
        k: DMatrix::zeros(n, 1),
        sample_time: 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::{eigenvalues, spectral_radius};

    #[test]
    fn closed_loops_are_those_of_the_notes() {
        let one = chiuso_picci_one().joint().unwrap();
        assert!((one.transition[(0, 0)] + 0.5).abs() < 1e-15);
        let two = chiuso_picci_two();
        let radius = spectral_radius(&two.joint().unwrap().transition).unwrap();
        assert!((radius - 0.98886).abs() < 1e-5, "{radius}");
        let predictor = &two.plant.a - &two.plant.k * &two.plant.c;
        let mut values: Vec<f64> = eigenvalues(&predictor)
            .unwrap()
            .iter()
            .map(|v| v.re)
            .collect();
        values.sort_by(f64::total_cmp);
        for (found, expected) in values.iter().zip([-0.1, 0.1, 0.6, 0.7, 0.8]) {
            assert!((found - expected).abs() < 1e-9, "{values:?}");
        }
    }

    #[test]
    fn controller_of_example_two_has_the_printed_response() {
        use num_complex::Complex64;
        let controller = chiuso_picci_two().controller;
        let w = 0.7;
        let polynomial = |c: [f64; 5]| -> Complex64 {
            (0..5)
                .map(|i| c[i] * Complex64::from_polar(1.0, -w * i as f64))
                .sum()
        };
        let printed = polynomial([0.63, -2.083, 2.8222, -1.865, 0.4978])
            / polynomial([1.0, -2.65, 3.11, -1.75, 0.39]);
        let found = controller.frequency_response(w)[0];
        assert!((found + printed).norm() < 1e-12);
    }
}
