//! The recursion itself, compiled once for every state dimension.

use super::linear_plant::Plant;
use crate::explain::effects::{Clock, ForceLaw, Motion};
use crate::explain::linear::data::Series;

/// Most states that can be run.
pub(crate) const MOST_STATES: usize = 12;
/// A simulation that gets here has diverged. Far beyond what any unit makes of a sensible number, so that the limit
/// knows no units; squares and products of such numbers still are numbers.
const DIVERGED: f64 = 1e60;

/// How finely the recursion runs.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Grid {
    pub(crate) samples: usize,
    /// Steps of the plant in a sample interval, over which the inputs are held.
    pub(crate) steps: usize,
}

impl Grid {
    /// One step a sample.
    pub(crate) fn of_samples(samples: usize) -> Self {
        Self { samples, steps: 1 }
    }
}

/// A force made ready for one parameter vector.
#[derive(Debug, Clone)]
pub(crate) struct ActiveForce {
    pub(crate) law: ForceLaw,
    pub(crate) parameters: Vec<f64>,
    pub(crate) position: Vec<f64>,
    pub(crate) position_feedthrough: Vec<f64>,
    pub(crate) rate: Vec<f64>,
    pub(crate) rate_feedthrough: Vec<f64>,
    pub(crate) direction: Vec<f64>,
    pub(crate) rate_gain: f64,
    pub(crate) input: usize,
}

/// Outputs of `plant`, whose step is that of `grid` and of `clock`, at the samples, under `inputs` and `forces` from the
/// state `x0`; `None` when they diverge.
pub(crate) fn run(
    plant: &Plant,
    forces: &[ActiveForce],
    x0: &[f64],
    inputs: &[Vec<f64>],
    grid: Grid,
    clock: &Clock,
) -> Option<Series> {
    macro_rules! dispatch {
        ($($n:literal)*) => {
            match plant.states {
                $($n => sized::<$n>(plant, forces, x0, inputs, grid, clock),)*
                _ => None,
            }
        };
    }
    dispatch!(0 1 2 3 4 5 6 7 8 9 10 11 12)
}

struct SizedForce<'a, const N: usize> {
    force: &'a ActiveForce,
    position: [f64; N],
    rate: [f64; N],
    direction: [f64; N],
    position_gain: f64,
    memory: [f64; 3],
    /// Whether the inputs act on the position or on the rate without delay.
    direct: bool,
    /// What the inputs of the sample add to the position and to the rate, and the one that the force is matched with.
    position_input: f64,
    rate_input: f64,
    input: f64,
}

fn array<const N: usize>(values: &[f64]) -> [f64; N] {
    let mut a = [0.0; N];
    for (a, v) in a.iter_mut().zip(values) {
        *a = *v;
    }
    a
}

fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    let mut sum = 0.0;
    for i in 0..N {
        sum += a[i] * b[i];
    }
    sum
}

fn sized<const N: usize>(
    plant: &Plant,
    forces: &[ActiveForce],
    x0: &[f64],
    inputs: &[Vec<f64>],
    grid: Grid,
    clock: &Clock,
) -> Option<Series> {
    let r = plant.inputs;
    // By columns: the next state is a sum of them, all its numbers at once.
    let mut a = [[0.0; N]; N];
    for (j, column) in a.iter_mut().enumerate() {
        for (i, value) in column.iter_mut().enumerate() {
            *value = plant.a[i * N + j];
        }
    }
    let c: Vec<[f64; N]> = (0..plant.outputs).map(|o| array(plant.c_row(o))).collect();
    let b: Vec<[f64; N]> = (0..r).map(|j| array(&plant.b_column(j))).collect();
    let direct: Vec<Vec<usize>> = (0..plant.outputs)
        .map(|o| (0..r).filter(|j| plant.d[o * r + j] != 0.0).collect())
        .collect();
    let mut forces: Vec<SizedForce<N>> = forces
        .iter()
        .map(|force| SizedForce {
            force,
            position: array(&force.position),
            rate: array(&force.rate),
            direction: array(&force.direction),
            position_gain: force
                .position
                .iter()
                .zip(&force.direction)
                .map(|(c, b)| c * b)
                .sum(),
            memory: [0.0; 3],
            direct: force
                .position_feedthrough
                .iter()
                .chain(&force.rate_feedthrough)
                .any(|gain| *gain != 0.0),
            position_input: 0.0,
            rate_input: 0.0,
            input: 0.0,
        })
        .collect();
    let mut outputs = vec![vec![0.0; grid.samples]; plant.outputs];
    let mut x: [f64; N] = array(x0);
    // What the inputs add in a step, and to the rates: the same for all steps of a sample.
    let mut pushed = [0.0; N];
    for k in 0..grid.samples {
        for (o, row) in c.iter().enumerate() {
            let mut y = dot(row, &x);
            for &j in &direct[o] {
                y += plant.d[o * r + j] * inputs[j][k];
            }
            outputs[o][k] = y;
        }
        pushed.fill(0.0);
        for (column, input) in b.iter().zip(inputs) {
            let u = input[k];
            for (pushed, b) in pushed.iter_mut().zip(column) {
                *pushed += b * u;
            }
        }
        for f in &mut forces {
            f.input = inputs.get(f.force.input).map_or(0.0, |u| u[k]);
            if !f.direct {
                continue;
            }
            let direct = |gains: &[f64]| -> f64 {
                gains
                    .iter()
                    .zip(inputs)
                    .map(|(gain, input)| gain * input[k])
                    .sum()
            };
            f.position_input = direct(&f.force.position_feedthrough);
            f.rate_input = direct(&f.force.rate_feedthrough);
        }
        for step in k * grid.steps..(k + 1) * grid.steps {
            let mut next = pushed;
            for (column, x) in a.iter().zip(&x) {
                for (next, a) in next.iter_mut().zip(column) {
                    *next += a * x;
                }
            }
            if !forces.is_empty() && !next.iter().all(|v| v.abs() < DIVERGED) {
                return None;
            }
            for f in &mut forces {
                let motion = Motion {
                    position: dot(&f.position, &x) + f.position_input,
                    position_free: dot(&f.position, &next) + f.position_input,
                    position_gain: f.position_gain,
                    rate: dot(&f.rate, &x) + f.rate_input,
                    rate_free: dot(&f.rate, &next) + f.rate_input,
                    rate_gain: f.force.rate_gain,
                    input: f.input,
                    sample: step,
                    clock: *clock,
                };
                let w = (f.force.law)(&f.force.parameters, &motion, &mut f.memory);
                for (next, b) in next.iter_mut().zip(&f.direction) {
                    *next += b * w;
                }
            }
            x = next;
        }
        if k % 64 == 0 && !x.iter().all(|v| v.abs() < DIVERGED) {
            return None;
        }
    }
    outputs
        .iter()
        .flatten()
        .all(|y| y.abs() < DIVERGED)
        .then_some(outputs)
}
