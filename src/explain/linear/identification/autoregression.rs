//! The linear system behind a column of simulated outputs.

use nalgebra::{DMatrix, DVector};

use crate::explain::linear::data::{Data, Segment};
use crate::explain::linear::model::linear_plant::Plant;
use crate::explain::linear::model::time_stepping::{Grid, run};
use crate::linalg::{least_squares, svd_thin};
use crate::model::StateSpace;

/// Residual, as a share of the simulated output, below which the simulator counts as linear: files hold about nine
/// digits, and rounding is amplified by the regression.
const LINEAR: f64 = 1e-4;
/// Singular values of the Hankel matrix below this share of the largest are rounding.
const RANK: f64 = 1e-7;
/// Highest autoregressive order tried.
const MOST_ORDER: usize = 8;

/// What a column of simulated outputs tells about the simulator.
#[derive(Debug, Clone)]
pub(crate) struct Simulator {
    pub(crate) plant: Plant,
    /// State at the beginning of each segment.
    pub(crate) initial: Vec<Vec<f64>>,
    /// Root mean square of what the linear system misses, over that of the simulated outputs.
    pub(crate) misfit: f64,
}

impl Simulator {
    /// Whether the simulator is linear to rounding.
    pub(crate) fn is_linear(&self) -> bool {
        self.misfit < LINEAR
    }
}

/// Identifies the simulator from its noise-free outputs (in `data.outputs`): an autoregression of rising order on
/// inputs and outputs, then a realisation of its impulse response (Ho and Kalman) of minimal order.
pub(crate) fn identify_simulator(data: &Data) -> Option<Simulator> {
    let mut best: Option<Simulator> = None;
    for order in 1..=MOST_ORDER {
        let Some(found) = of_order(data, order) else {
            continue;
        };
        let better = best.as_ref().is_none_or(|b| found.misfit < 0.5 * b.misfit);
        let exact = found.misfit < LINEAR * 1e-3;
        if better {
            best = Some(found);
        }
        if exact {
            break;
        }
    }
    best
}

/// Regression of the outputs on the present inputs and the past of all channels, each scaled to one size.
pub(super) struct Autoregression {
    /// Rows `[u(k), z(k-1), ..., z(k-order)]` with `z = [u; y]`, then a one if there is a constant.
    pub(super) regressors: DMatrix<f64>,
    /// Rows `y(k)`.
    pub(super) targets: DMatrix<f64>,
    pub(super) input_scale: Vec<f64>,
    pub(super) output_scale: Vec<f64>,
}

impl Autoregression {
    /// `None` with too few samples for so many coefficients.
    pub(crate) fn new(data: &Data, order: usize, constant: bool) -> Option<Self> {
        let (r, l) = (data.inputs, data.outputs);
        let rows: usize = data
            .segments
            .iter()
            .map(|s| s.samples().saturating_sub(order))
            .sum();
        let columns = r + order * (r + l) + usize::from(constant);
        if rows < 3 * columns {
            return None;
        }
        let (input_scale, output_scale) = (data.input_scale(), data.output_scale());
        let mut regressors = DMatrix::zeros(rows, columns);
        let mut targets = DMatrix::zeros(rows, l);
        let times = data
            .segments
            .iter()
            .flat_map(|segment| (order..segment.samples()).map(move |k| (segment, k)));
        for (row, (segment, k)) in times.enumerate() {
            for lag in 0..=order {
                for j in 0..r {
                    regressors[(row, Self::column(data, lag, j))] =
                        segment.inputs[j][k - lag] / input_scale[j];
                }
                for o in (0..l).filter(|_| lag > 0) {
                    regressors[(row, Self::column(data, lag, r + o))] =
                        segment.outputs[o][k - lag] / output_scale[o];
                }
            }
            if constant {
                regressors[(row, columns - 1)] = 1.0;
            }
            for o in 0..l {
                targets[(row, o)] = segment.outputs[o][k] / output_scale[o];
            }
        }
        Some(Self {
            regressors,
            targets,
            input_scale,
            output_scale,
        })
    }

    /// Column of a channel of `z` at a lag.
    pub(crate) fn column(data: &Data, lag: usize, channel: usize) -> usize {
        if lag == 0 {
            channel
        } else {
            data.inputs + (lag - 1) * (data.inputs + data.outputs) + channel
        }
    }
}

pub(super) fn of_order(data: &Data, order: usize) -> Option<Simulator> {
    let Autoregression {
        regressors,
        targets,
        input_scale,
        output_scale,
    } = Autoregression::new(data, order, false)?;
    let coefficients = least_squares(&regressors, &targets).ok()?;
    if !coefficients.iter().all(|c| c.is_finite()) {
        return None;
    }
    let plant = realise(&coefficients, data, order, &input_scale, &output_scale)?;
    let (initial, misfit) = initial_states(&plant, data)?;
    Some(Simulator {
        plant,
        initial,
        misfit,
    })
}

/// State-space form of the autoregression, of minimal order.
fn realise(
    coefficients: &DMatrix<f64>,
    data: &Data,
    order: usize,
    us: &[f64],
    ys: &[f64],
) -> Option<Plant> {
    let (r, l) = (data.inputs, data.outputs);
    let q = r + l;
    // Impulse response h[i] (l x r), from the recursion itself.
    let length = (4 * order * l).max(24);
    let mut h: Vec<DMatrix<f64>> = Vec::with_capacity(length + 1);
    for i in 0..=length {
        let mut now = DMatrix::zeros(l, r);
        if i == 0 {
            for o in 0..l {
                for j in 0..r {
                    now[(o, j)] = coefficients[(j, o)];
                }
            }
        } else if i <= order {
            let at = r + (i - 1) * q;
            for o in 0..l {
                for j in 0..r {
                    now[(o, j)] = coefficients[(at + j, o)];
                }
            }
        }
        for lag in 1..=order.min(i) {
            let at = r + (lag - 1) * q + r;
            for o in 0..l {
                for p in 0..l {
                    let gain = coefficients[(at + p, o)];
                    for j in 0..r {
                        now[(o, j)] += gain * h[i - lag][(p, j)];
                    }
                }
            }
        }
        h.push(now);
    }
    let half = length / 2;
    let hankel = |shift: usize| {
        let mut m = DMatrix::zeros(half * l, half * r);
        for i in 0..half {
            for j in 0..half {
                m.view_mut((i * l, j * r), (l, r))
                    .copy_from(&h[1 + i + j + shift]);
            }
        }
        m
    };
    let svd = svd_thin(&hankel(0)).ok()?;
    let largest = svd.values.iter().copied().fold(0.0, f64::max);
    if !(largest > 0.0 && largest.is_finite()) {
        return None;
    }
    // Rounding of the coefficients grows with the order: keep what stands out of it.
    let n = svd
        .values
        .iter()
        .filter(|v| **v > RANK * largest)
        .count()
        .min(order * l);
    let root: Vec<f64> = (0..n).map(|i| svd.values[i].sqrt()).collect();
    let observability = DMatrix::from_fn(half * l, n, |i, j| svd.u[(i, j)] * root[j]);
    let controllability = DMatrix::from_fn(n, half * r, |i, j| svd.v[(j, i)] * root[i]);
    let shifted = hankel(1);
    let left = DMatrix::from_fn(n, half * l, |i, j| svd.u[(j, i)] / root[i]);
    let right = DMatrix::from_fn(half * r, n, |i, j| svd.v[(i, j)] / root[j]);
    let a = left * shifted * right;
    let mut b = controllability.columns(0, r).into_owned();
    let mut c = observability.rows(0, l).into_owned();
    let mut d = h[0].clone();
    for j in 0..r {
        for i in 0..n {
            b[(i, j)] /= us[j];
        }
        for o in 0..l {
            d[(o, j)] *= ys[o] / us[j];
        }
    }
    for o in 0..l {
        for i in 0..n {
            c[(o, i)] *= ys[o];
        }
    }
    // Entries that are rounding: a simulator without feedthrough, an input without effect.
    let typical = d.norm() + c.norm() * b.norm();
    d.iter_mut().for_each(|v| {
        if v.abs() < 1e-6 * typical {
            *v = 0.0;
        }
    });
    let b_norm = b.norm();
    for j in 0..r {
        if b.column(j).norm() * us[j] < 1e-6 * b_norm * us.iter().copied().fold(0.0, f64::max) {
            b.column_mut(j).fill(0.0);
        }
    }
    let system = StateSpace::deterministic(a, b, c, d, data.sample_time).ok()?;
    Some(Plant::from_state_space(&system))
}

/// Initial state of each segment by least squares, and the relative misfit that is left.
pub(crate) fn initial_states(plant: &Plant, data: &Data) -> Option<(Vec<Vec<f64>>, f64)> {
    let n = plant.states;
    let (mut missed, mut size) = (0.0, 0.0);
    let scale = data.output_scale();
    let mut initial = Vec::new();
    for segment in &data.segments {
        let x0 = initial_state(plant, segment, &scale)?;
        let y = free_run(plant, segment, &x0)?;
        for (o, (y, s)) in segment.outputs.iter().zip(&y).enumerate() {
            let mean = y.iter().sum::<f64>() / y.len().max(1) as f64;
            for (y, s) in y.iter().zip(s) {
                missed += ((y - s) / scale[o]).powi(2);
                size += ((y - mean) / scale[o]).powi(2);
            }
        }
        debug_assert_eq!(x0.len(), n);
        initial.push(x0);
    }
    let misfit = (missed / size.max(1e-300)).sqrt();
    misfit.is_finite().then_some((initial, misfit))
}

fn free_run(plant: &Plant, segment: &Segment, x0: &[f64]) -> Option<Vec<Vec<f64>>> {
    let clock = crate::explain::effects::Clock {
        start: 0.0,
        step: plant.sample_time,
        fresh: false,
    };
    let grid = Grid::of_samples(segment.samples());
    run(plant, &[], x0, &segment.inputs, grid, &clock)
}

/// Least squares over the whole segment, each output on its own scale; directions not seen stay zero.
pub(crate) fn initial_state(plant: &Plant, segment: &Segment, scale: &[f64]) -> Option<Vec<f64>> {
    let n = plant.states;
    let zero = vec![0.0; n];
    let from_rest = free_run(plant, segment, &zero)?;
    let samples = segment.samples();
    let l = plant.outputs;
    let quiet = Segment {
        inputs: vec![vec![0.0; samples]; plant.inputs],
        outputs: Vec::new(),
        start_time: 0.0,
    };
    let mut columns = DMatrix::zeros(samples * l, n);
    for i in 0..n {
        let mut unit = zero.clone();
        unit[i] = 1.0;
        let y = free_run(plant, &quiet, &unit)?;
        for o in 0..l {
            for k in 0..samples {
                columns[(o * samples + k, i)] = y[o][k] / scale[o];
            }
        }
    }
    let target = DMatrix::from_fn(samples * l, 1, |row, _| {
        let (o, k) = (row / samples, row % samples);
        (segment.outputs[o][k] - from_rest[o][k]) / scale[o]
    });
    let gram = columns.tr_mul(&columns);
    let right = columns.tr_mul(&target);
    let solved: DVector<f64> = gram
        .pseudo_inverse(1e-13)
        .map(|inverse| (inverse * right).column(0).into_owned())
        .ok()?;
    let x0: Vec<f64> = solved.iter().copied().collect();
    x0.iter().all(|v| v.is_finite()).then_some(x0)
}
