//! Prediction errors of a recording and their derivatives, as a triangular factor.

use nalgebra::{DMatrix, DVector};

use crate::covariance::ParameterLayout;
use crate::linalg::{LinalgError, all_finite, pseudo_inverse, qr_r};
use crate::model::{ModelError, StateSpace, estimate_initial_state};

/// Rows that are compressed at a time.
const BLOCK: usize = 4096;
/// Directions of the initial state that matter less than this, relative to the one that matters most, are left alone.
const UNDETERMINED: f64 = 1e-10;

/// An experiment: one column of deviations a channel, inputs then outputs.
pub(crate) type Signals = [Vec<f64>];

/// Inputs and outputs as slices.
fn split(signals: &Signals, inputs: usize) -> (Vec<&[f64]>, Vec<&[f64]>) {
    let columns: Vec<&[f64]> = signals.iter().map(Vec::as_slice).collect();
    let (u, y) = columns.split_at(inputs);
    (u.to_vec(), y.to_vec())
}

/// The initial state that fits best, and the sum of squares of the prediction errors from it (`l x l`).
///
/// # Errors
/// [`ModelError`] when the signals do not fit the system.
pub(super) fn prediction_errors(
    system: &StateSpace,
    signals: &Signals,
    innovation_covariance: &DMatrix<f64>,
) -> Result<(DVector<f64>, DMatrix<f64>), ModelError> {
    let (u, y) = split(signals, system.inputs());
    let x0 = estimate_initial_state(system, &u, &y, Some(innovation_covariance))?;
    let errors = system.one_step(&u, &y, Some(&x0))?.innovations;
    let l = errors.len();
    let sum = DMatrix::from_fn(l, l, |i, j| {
        errors[i].iter().zip(&errors[j]).map(|(a, b)| a * b).sum()
    });
    Ok((x0, sum))
}

/// Triangular factor of `[dE/dtheta | E]` over all samples, whitened, after the initial state has been eliminated
/// (variable projection in the approximation of Kaufman 1975).
///
/// `directions` holds one column of changes of the packed matrices for each coordinate; `whitener` times the
/// prediction errors has unit covariance.
///
/// # Errors
/// [`LinalgError`] for numbers that are not finite.
pub(super) fn linearised_errors(
    system: &StateSpace,
    layout: &ParameterLayout,
    directions: &DMatrix<f64>,
    signals: &Signals,
    x0: &DVector<f64>,
    whitener: &DMatrix<f64>,
) -> Result<DMatrix<f64>, LinalgError> {
    let (n, inputs, outputs) = (layout.states, layout.inputs, layout.outputs);
    let coordinates = directions.ncols();
    let samples = signals.first().map_or(0, Vec::len);
    // Columns: initial state, coordinates, prediction error.
    let total = n + coordinates + 1;
    let pieces = Pieces::new(system, layout, directions);

    let mut x: Vec<f64> = x0.iter().copied().collect();
    let mut next = vec![0.0; n];
    // State sensitivities, one column of n for the initial state's and the coordinates' directions each.
    let mut moved = vec![0.0; n * (n + coordinates)];
    for i in 0..n {
        moved[i * n + i] = 1.0;
    }
    let mut regressor = vec![0.0; n + inputs + outputs];
    let mut errors = vec![0.0; outputs];
    let mut of_error = vec![0.0; outputs];
    let mut column = vec![0.0; n];

    let mut compressed = DMatrix::zeros(0, total);
    let mut first = 0;
    while first < samples {
        let count = (BLOCK / outputs).max(1).min(samples - first);
        let mut rows = DMatrix::zeros(count * outputs, total);
        for sample in first..first + count {
            let row = (sample - first) * outputs;
            regressor[..n].copy_from_slice(&x);
            for (slot, channel) in regressor[n..].iter_mut().zip(&signals[..inputs]) {
                *slot = channel[sample];
            }
            for (o, error) in errors.iter_mut().enumerate() {
                let mut predicted = 0.0;
                for (j, value) in x.iter().enumerate() {
                    predicted += system.c[(o, j)] * value;
                }
                for j in 0..inputs {
                    predicted += system.d[(o, j)] * regressor[n + j];
                }
                *error = signals[inputs + o][sample] - predicted;
            }
            regressor[n + inputs..].copy_from_slice(&errors);
            for (o, error) in errors.iter().enumerate() {
                rows[(row + o, total - 1)] = *error;
            }
            for (direction, state) in moved.chunks_exact_mut(n.max(1)).enumerate() {
                let own = direction.checked_sub(n);
                for (o, slot) in of_error.iter_mut().enumerate() {
                    let mut sum = 0.0;
                    for (j, value) in state.iter().enumerate() {
                        sum -= system.c[(o, j)] * value;
                    }
                    if let Some(p) = own {
                        sum -= dot(pieces.output(p, o), &regressor[..n + inputs]);
                    }
                    *slot = sum;
                    rows[(row + o, direction)] = sum;
                }
                for (i, slot) in column.iter_mut().enumerate() {
                    let mut sum = 0.0;
                    for (j, value) in state.iter().enumerate() {
                        sum += system.a[(i, j)] * value;
                    }
                    for (o, value) in of_error.iter().enumerate() {
                        sum += system.k[(i, o)] * value;
                    }
                    if let Some(p) = own {
                        sum += dot(pieces.state(p, i), &regressor);
                    }
                    *slot = sum;
                }
                state.copy_from_slice(&column);
            }
            for (i, slot) in next.iter_mut().enumerate() {
                let mut sum = 0.0;
                for (j, value) in x.iter().enumerate() {
                    sum += system.a[(i, j)] * value;
                }
                for j in 0..inputs {
                    sum += system.b[(i, j)] * regressor[n + j];
                }
                for (o, error) in errors.iter().enumerate() {
                    sum += system.k[(i, o)] * error;
                }
                *slot = sum;
            }
            x.copy_from_slice(&next);
        }
        whiten(&mut rows, whitener);
        if !all_finite(&rows) {
            return Err(LinalgError::NotFinite {
                what: "prediction errors",
            });
        }
        let head = compressed.nrows();
        let stacked = if head == 0 {
            rows
        } else {
            let mut both = DMatrix::zeros(head + rows.nrows(), total);
            both.rows_mut(0, head).copy_from(&compressed);
            both.rows_mut(head, rows.nrows()).copy_from(&rows);
            both
        };
        compressed = qr_r(&stacked);
        first += count;
    }
    without_initial_state(&compressed, n)
}

/// The factor of what is left after the first `n` columns have been regressed out.
fn without_initial_state(factor: &DMatrix<f64>, n: usize) -> Result<DMatrix<f64>, LinalgError> {
    let (rows, total) = factor.shape();
    let rest = factor.columns(n, total - n).into_owned();
    let size = factor.columns(0, n).amax();
    let determined = (0..n.min(rows)).all(|i| factor[(i, i)].abs() > UNDETERMINED * size);
    if determined && rows >= n {
        return Ok(rest.rows(n, rows - n).into_owned());
    }
    let of_state = factor.columns(0, n).into_owned();
    Ok(&rest - &of_state * (pseudo_inverse(&of_state, UNDETERMINED)? * &rest))
}

fn whiten(rows: &mut DMatrix<f64>, whitener: &DMatrix<f64>) {
    let outputs = whitener.nrows();
    let mut whitened = vec![0.0; outputs];
    for mut column in rows.column_iter_mut() {
        for sample in column.as_mut_slice().chunks_exact_mut(outputs) {
            for (i, slot) in whitened.iter_mut().enumerate() {
                *slot = (0..outputs).map(|j| whitener[(i, j)] * sample[j]).sum();
            }
            sample.copy_from_slice(&whitened);
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The directions, row by row.
struct Pieces {
    states: usize,
    outputs: usize,
    width: usize,
    /// `[dA dB dK]`, row major, for each coordinate.
    of_state: Vec<f64>,
    /// `[dC dD]`, row major, for each coordinate.
    of_output: Vec<f64>,
}

impl Pieces {
    fn new(system: &StateSpace, layout: &ParameterLayout, directions: &DMatrix<f64>) -> Self {
        let (n, inputs, outputs) = (layout.states, layout.inputs, layout.outputs);
        let mut of_state = Vec::new();
        let mut of_output = Vec::new();
        let still = StateSpace {
            d: DMatrix::zeros(outputs, inputs),
            ..system.clone()
        };
        for direction in directions.column_iter() {
            let direction: Vec<f64> = direction.iter().copied().collect();
            let change = layout.unpack(&direction, &still);
            for i in 0..n {
                of_state.extend(change.a.row(i).iter());
                of_state.extend(change.b.row(i).iter());
                of_state.extend(change.k.row(i).iter());
            }
            for o in 0..outputs {
                of_output.extend(change.c.row(o).iter());
                of_output.extend(change.d.row(o).iter());
            }
        }
        Self {
            states: n,
            outputs,
            width: n + inputs,
            of_state,
            of_output,
        }
    }

    fn state(&self, coordinate: usize, row: usize) -> &[f64] {
        let width = self.width + self.outputs;
        let from = (coordinate * self.states + row) * width;
        &self.of_state[from..from + width]
    }

    fn output(&self, coordinate: usize, row: usize) -> &[f64] {
        let from = (coordinate * self.outputs + row) * self.width;
        &self.of_output[from..from + self.width]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is left of central differences of the prediction errors when those by the initial state are regressed out.
    #[test]
    fn derivatives_are_those_of_differences() {
        let system = StateSpace {
            a: DMatrix::from_row_slice(3, 3, &[0.7, 0.2, 0.0, -0.3, 0.8, 0.1, 0.1, 0.0, 0.5]),
            b: DMatrix::from_row_slice(3, 1, &[1.0, 0.3, -0.6]),
            c: DMatrix::from_row_slice(2, 3, &[1.0, 0.0, 0.2, 0.4, -1.0, 0.7]),
            d: DMatrix::from_row_slice(2, 1, &[0.1, -0.2]),
            k: DMatrix::from_row_slice(3, 2, &[0.3, 0.1, -0.1, 0.2, 0.0, 0.25]),
            sample_time: 1.0,
        };
        let signal = |rate: f64, shift: f64| -> Vec<f64> {
            (0..60)
                .map(|k| (rate * f64::from(k * k) + shift).sin())
                .collect()
        };
        let signals = [signal(0.37, 0.0), signal(0.11, 1.0), signal(0.23, 2.0)];
        let (u, y) = split(&signals, 1);
        let x0 = DVector::from_column_slice(&[0.5, -1.0, 0.8]);
        let layout = ParameterLayout::of(&system, true);
        let whitener = DMatrix::from_row_slice(2, 2, &[2.0, 0.0, -0.7, 0.5]);
        let theta = layout.pack(&system);
        let errors = |theta: &[f64], x0: &DVector<f64>| {
            let of = layout.unpack(theta, &system);
            let e = of.one_step(&u, &y, Some(x0)).unwrap().innovations;
            DVector::from_iterator(
                2 * e[0].len(),
                (0..e[0].len())
                    .flat_map(|k| [2.0 * e[0][k], -0.7 * e[0][k] + 0.5 * e[1][k]])
                    .collect::<Vec<f64>>(),
            )
        };
        let h = 1e-6;
        let by_state = |i: usize| {
            let (mut up, mut down) = (x0.clone(), x0.clone());
            up[i] += h;
            down[i] -= h;
            (errors(&theta, &up) - errors(&theta, &down)) / (2.0 * h)
        };
        let by_number = |p: usize| {
            let (mut up, mut down) = (theta.clone(), theta.clone());
            up[p] += h;
            down[p] -= h;
            (errors(&up, &x0) - errors(&down, &x0)) / (2.0 * h)
        };
        let of_state = DMatrix::from_columns(&[by_state(0), by_state(1), by_state(2)]);
        let mut columns: Vec<DVector<f64>> = (0..theta.len()).map(by_number).collect();
        columns.push(errors(&theta, &x0));
        let all = DMatrix::from_columns(&columns);
        let inverse = of_state.clone().pseudo_inverse(1e-12).unwrap();
        let left = &all - &of_state * (inverse * &all);
        let expected = left.transpose() * &left;
        let directions = DMatrix::identity(theta.len(), theta.len());
        let factor =
            linearised_errors(&system, &layout, &directions, &signals, &x0, &whitener).unwrap();
        let found = factor.transpose() * &factor;
        assert!(
            (&found - &expected).amax() < 1e-6 * expected.amax(),
            "{}",
            (&found - &expected).amax() / expected.amax()
        );
    }
}
