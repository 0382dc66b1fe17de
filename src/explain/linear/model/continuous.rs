//! The continuous plant that a linear plant is the zero-order-hold equivalent of: derivatives and integrals of its outputs,
//! and its response to inputs that change within a sample.

use nalgebra::DMatrix;

use super::linear_plant::{Plant, row_major};

/// Rows that read a plant's outputs, their time derivatives and their integrals off the state.
#[derive(Debug, Clone)]
pub(crate) struct Derivatives {
    /// `C A_c`, a row an output (`l x n`).
    pub(crate) rate: Vec<Vec<f64>>,
    /// `C B_c`, a row an output (`l x r`): what an input adds to the derivative directly.
    pub(crate) rate_feedthrough: Vec<Vec<f64>>,
    /// `C A_c^-1`, a row an output, where that exists.
    pub(crate) integral: Option<Vec<Vec<f64>>>,
}

impl Derivatives {
    /// Of the continuous plant that `plant` is the zero-order-hold equivalent of; where there is none (a pole on the
    /// negative real axis), of the increments.
    pub(crate) fn new(plant: &Plant) -> Self {
        let l = plant.outputs;
        let h = plant.sample_time;
        let c = plant.c_matrix();
        let (a_c, b_c) = continuous(plant);
        let (a_c, b_c) = (a_c / h, b_c / h);
        let rows = |m: DMatrix<f64>| -> Vec<Vec<f64>> {
            let flat = row_major(&m);
            (0..l)
                .map(|o| flat[o * m.ncols()..(o + 1) * m.ncols()].to_vec())
                .collect()
        };
        let integral = a_c
            .clone()
            .try_inverse()
            .filter(|inverse| {
                inverse.iter().all(|v| v.is_finite()) && inverse.norm() * a_c.norm() < 1e9
            })
            .map(|inverse| rows(&c * inverse));
        Self {
            rate: rows(&c * &a_c),
            rate_feedthrough: rows(&c * &b_c),
            integral,
        }
    }
}

/// What the [`Moments`](crate::explain::effects::Moments) of each input within a sample interval add to the state, beyond its mean: two
/// columns an input.
///
/// The responses to the inputs `1`, `x` and `x^2/2` over the interval are blocks of the exponential of a plant behind a chain
/// of integrators (Van Loan 1978); Legendre's polynomials have the squares `1/12` and `1/180`.
pub(crate) fn moment_columns(plant: &Plant) -> Vec<[Vec<f64>; 2]> {
    let (n, r) = (plant.states, plant.inputs);
    let (a, b) = continuous(plant);
    let mut chain = DMatrix::zeros(n + 3 * r, n + 3 * r);
    chain.view_mut((0, 0), (n, n)).copy_from(&a);
    chain.view_mut((0, n), (n, r)).copy_from(&b);
    for j in 0..2 * r {
        chain[(n + j, n + r + j)] = 1.0;
    }
    let response = crate::linalg::exponential(&chain);
    let to = |power: usize, j: usize| response.view((0, n + power * r + j), (n, 1)).into_owned();
    (0..r)
        .map(|j| {
            let (constant, ramp, parabola) = (to(0, j), to(1, j), to(2, j));
            let first = (&ramp - &constant * 0.5) * 12.0;
            let second = (parabola * 2.0 - ramp + constant / 6.0) * 180.0;
            [first.as_slice().to_vec(), second.as_slice().to_vec()]
        })
        .collect()
}

/// `A_c h` and `B_c h` of the continuous plant that `plant` is the zero-order-hold equivalent of; where there is none (a pole
/// on the negative real axis), the increments.
fn continuous(plant: &Plant) -> (DMatrix<f64>, DMatrix<f64>) {
    let (n, r) = (plant.states, plant.inputs);
    let mut both = DMatrix::identity(n + r, n + r);
    both.view_mut((0, 0), (n, n)).copy_from(&plant.a_matrix());
    both.view_mut((0, n), (n, r)).copy_from(&plant.b_matrix());
    let log =
        crate::linalg::logarithm(&both).unwrap_or_else(|| &both - DMatrix::identity(n + r, n + r));
    (
        log.view((0, 0), (n, n)).into_owned(),
        log.view((0, n), (n, r)).into_owned(),
    )
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use nalgebra::DVector;

    /// Two states, three inputs of which the second only passes through and the third does nothing, two outputs.
    pub(crate) fn continuous_plant() -> (DMatrix<f64>, DMatrix<f64>, Plant) {
        let h = 0.2;
        let a = DMatrix::from_row_slice(2, 2, &[-0.3, 1.0, -4.0, -0.8]);
        let b = DMatrix::from_row_slice(2, 3, &[0.2, 0.0, 0.0, 1.5, 0.0, 0.0]);
        let mut both = DMatrix::zeros(5, 5);
        both.view_mut((0, 0), (2, 2)).copy_from(&(&a * h));
        both.view_mut((0, 2), (2, 3)).copy_from(&(&b * h));
        let held = crate::linalg::exponential(&both);
        let plant = Plant {
            states: 2,
            inputs: 3,
            outputs: 2,
            a: row_major(&held.view((0, 0), (2, 2)).into_owned()),
            b: row_major(&held.view((0, 2), (2, 3)).into_owned()),
            c: vec![1.0, 0.3, -0.5, 2.0],
            d: vec![0.0, 0.0, 0.0, 0.0, 0.7, 0.0],
            sample_time: h,
        };
        (a, b, plant)
    }

    #[test]
    fn rows_are_those_of_the_continuous_plant() {
        let (a, b, plant) = continuous_plant();
        let c = plant.c_matrix();
        let found = Derivatives::new(&plant);
        let close = |rows: &[Vec<f64>], wanted: DMatrix<f64>| {
            assert_eq!(rows.len(), wanted.nrows());
            for (row, wanted) in rows.iter().zip(wanted.row_iter()) {
                assert_eq!(row.len(), wanted.len());
                for (found, wanted) in row.iter().zip(wanted.iter()) {
                    assert!((found - wanted).abs() < 1e-10, "{found} {wanted}");
                }
            }
        };
        close(&found.rate, &c * &a);
        close(&found.rate_feedthrough, &c * &b);
        close(
            &found.integral.unwrap(),
            &c * a.clone().try_inverse().unwrap(),
        );
    }

    /// By summation over the interval.
    #[test]
    fn moments_move_the_state_as_the_continuous_plant_does() {
        let (a, b, plant) = continuous_plant();
        let found = moment_columns(&plant);
        const STEPS: usize = 4000;
        let h = plant.sample_time / STEPS as f64;
        for (j, columns) in found.iter().enumerate() {
            let mut sums = [DVector::zeros(2), DVector::zeros(2)];
            for i in 0..STEPS {
                let x = (i as f64 + 0.5) / STEPS as f64;
                let left = crate::linalg::exponential(&(&a * (plant.sample_time * (1.0 - x))));
                let push = left * b.column(j) * h;
                sums[0] += &push * (12.0 * (x - 0.5));
                sums[1] += &push * (180.0 * (x * x - x + 1.0 / 6.0));
            }
            for (column, sum) in columns.iter().zip(&sums) {
                for (found, wanted) in column.iter().zip(sum.iter()) {
                    assert!((found - wanted).abs() < 1e-5, "{j}: {found} {wanted}");
                }
            }
        }
    }
}
