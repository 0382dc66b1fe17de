//! What can be read off a state: positions, rates, and integrals of outputs.

use std::sync::OnceLock;

use super::continuous::Derivatives;
use super::linear_plant::Plant;

/// The position and rate that a force looks at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Signal {
    /// An output is the position, its derivative the rate.
    Output(usize),
    /// An output is the rate: its integral is the position.
    Integral(usize),
    /// Position of one output relative to another.
    Difference(usize, usize),
}

/// Rows of a position, its rate, and what inputs add to the rate directly.
#[derive(Debug, Clone)]
pub(crate) struct SignalRows {
    pub(crate) position: Vec<f64>,
    /// What inputs add to the position directly: the level of an output, where the last input is one.
    pub(crate) position_feedthrough: Vec<f64>,
    pub(crate) rate: Vec<f64>,
    pub(crate) rate_feedthrough: Vec<f64>,
    /// What tells whether a push through a direction goes forward: the position that it holds, or the speed that it gives.
    pub(crate) forward: Vec<f64>,
}

/// All rows that a plant's signals can be read with.
#[derive(Debug, Clone)]
pub(crate) struct Functionals {
    derivatives: Derivatives,
    /// Rows of the outputs under a constant push.
    held: OnceLock<Vec<Vec<f64>>>,
    /// Which outputs [`Functionals::integrates`] is true of: asked for every place of every effect.
    integrating: OnceLock<Vec<bool>>,
}

impl Functionals {
    pub(crate) fn new(plant: &Plant) -> Self {
        Self {
            derivatives: Derivatives::new(plant),
            held: OnceLock::new(),
            integrating: OnceLock::new(),
        }
    }

    /// Whether the output's integral can be read off the state of `plant`, whose rows these are: it must be a derivative, with
    /// no static gain.
    pub(crate) fn integrates(&self, plant: &Plant, output: usize) -> bool {
        self.integrating.get_or_init(|| self.integrating(plant))[output]
    }

    fn integrating(&self, plant: &Plant) -> Vec<bool> {
        let none = || vec![false; plant.outputs];
        let Some(integral) = &self.derivatives.integral else {
            return none();
        };
        // d/dt (C A_c^-1 x) = C x + C A_c^-1 B_c u: the second term is minus the static gain.
        let n = plant.states;
        let identity = nalgebra::DMatrix::identity(n, n);
        let Some(inverse) = (identity - plant.a_matrix()).try_inverse() else {
            return none();
        };
        let static_gain = plant.c_matrix() * inverse * plant.b_matrix();
        (0..plant.outputs)
            .map(|output| {
                let row_norm: f64 = integral[output].iter().map(|v| v * v).sum::<f64>().sqrt();
                let peak = impulse_size(plant, output);
                row_norm.is_finite()
                    && (0..plant.inputs).all(|j| static_gain[(output, j)].abs() < 0.02 * peak)
            })
            .collect()
    }

    /// Whether a position can be what `signal` says: an output without static gain is a speed, and positions are its
    /// integral.
    pub(crate) fn sensible(&self, plant: &Plant, signal: Signal) -> bool {
        match signal {
            Signal::Output(o) => !self.integrates(plant, o),
            Signal::Integral(o) => self.integrates(plant, o),
            Signal::Difference(i, j) => !self.integrates(plant, i) && !self.integrates(plant, j),
        }
    }

    /// What outputs hold under a constant push: the limit at low frequency, because a plant that integrates has no gain at none.
    fn held(&self, plant: &Plant) -> &[Vec<f64>] {
        self.held.get_or_init(|| {
            (0..plant.outputs)
                .map(|o| held(plant, plant.c_row(o)).unwrap_or_else(|| plant.c_row(o).to_vec()))
                .collect()
        })
    }

    pub(crate) fn of(&self, plant: &Plant, signal: Signal) -> SignalRows {
        let d = &self.derivatives;
        let minus =
            |a: &[f64], b: &[f64]| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a - b).collect() };
        match signal {
            Signal::Output(o) => SignalRows {
                position: plant.c_row(o).to_vec(),
                position_feedthrough: plant.d_row(o).to_vec(),
                rate: d.rate[o].clone(),
                rate_feedthrough: d.rate_feedthrough[o].clone(),
                forward: self.held(plant)[o].clone(),
            },
            Signal::Integral(o) => SignalRows {
                position: d
                    .integral
                    .as_ref()
                    .map_or_else(|| vec![0.0; plant.states], |rows| rows[o].clone()),
                position_feedthrough: Vec::new(),
                rate: plant.c_row(o).to_vec(),
                rate_feedthrough: plant.d_row(o).to_vec(),
                forward: plant.c_row(o).to_vec(),
            },
            Signal::Difference(i, j) => SignalRows {
                position: minus(plant.c_row(i), plant.c_row(j)),
                position_feedthrough: minus(plant.d_row(i), plant.d_row(j)),
                forward: minus(&self.held(plant)[i], &self.held(plant)[j]),
                rate: minus(&d.rate[i], &d.rate[j]),
                rate_feedthrough: minus(&d.rate_feedthrough[i], &d.rate_feedthrough[j]),
            },
        }
    }
}

/// Sum of the magnitudes of the impulse response of an output: the most that inputs of size 1 can do.
fn impulse_size(plant: &Plant, output: usize) -> f64 {
    let a = plant.a_matrix();
    let mut x = plant.b_matrix();
    let c = plant.c_matrix();
    let mut total = 0.0;
    for _ in 0..2000 {
        total += (c.row(output) * &x).norm();
        x = &a * x;
    }
    total.max(1e-300)
}

/// `row ((1 + e) I - A)^-1`: a row of the state under a push that hardly changes.
fn held(plant: &Plant, row: &[f64]) -> Option<Vec<f64>> {
    /// How far from one on the real axis the response is taken: far beyond the slowest pole, and well above rounding.
    const NEAR_STANDSTILL: f64 = 1e-6;
    let n = plant.states;
    let shifted = nalgebra::DMatrix::identity(n, n) * (1.0 + NEAR_STANDSTILL) - plant.a_matrix();
    let weights = shifted
        .transpose()
        .lu()
        .solve(&nalgebra::DVector::from_column_slice(row))?;
    weights
        .iter()
        .all(|w| w.is_finite())
        .then(|| weights.iter().copied().collect())
}

/// The row that turns the direction of a push into the input `input` that balances it in `row` of the state at standstill.
pub(crate) fn static_equivalent(plant: &Plant, row: &[f64], input: usize) -> Option<Vec<f64>> {
    let weights = held(plant, row)?;
    let of_input = dot(&weights, &plant.b_column(input));
    let size: f64 = weights
        .iter()
        .zip(plant.b_column(input))
        .map(|(w, b)| (w * b).abs())
        .sum();
    (of_input.abs() > 1e-9 * size).then(|| weights.iter().map(|w| w / of_input).collect())
}

/// Sign that lets a positive matched amplitude push forward.
pub(crate) fn matched_sign(plant: &Plant, forward: &[f64], input: usize) -> f64 {
    if dot(forward, &plant.b_column(input)) < 0.0 {
        -1.0
    } else {
        1.0
    }
}

pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
