//! The innovation form: an observer with a constant gain, estimated with the parameters.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::deviance::Deviance;
use super::optimise::{Effort, Range, minimise};
use super::problem::Problem;
use super::{Fit, Form, ROUND, ROUNDS, SEARCH, SETTLED};
use crate::noise::{Colours, Noise};
use crate::physics::expression::{Node, VariableId};
use crate::physics::simulation::{Excitation, LinearPlant, Trajectory};
use crate::physics::spec::{ModelSpec, Unknown};

/// Process noise of a sample as a part of the spread of each state, from which gains are computed to start from.
const DIFFUSION: [f64; 4] = [1e-3, 1e-2, 1e-1, 1.0];
/// Measurement noise as a part of the spread of each output.
const MEASUREMENT: f64 = 0.02;
/// Gains that are searched from, rounds under white Gaussian noise, and the effort of these.
const SEARCHED: usize = 2;
const ROUGH: usize = 2;
const APPROACH: Effort = Effort {
    settled: 0.5,
    ..SEARCH
};
/// Steps of the Riccati equation.
const STEPS: usize = 300;

/// The fit in innovation form, from a point of the other form or from the values of the text.
pub(super) fn fit(problem: &Problem, from: Option<&[f64]>) -> Option<Fit> {
    if problem.gains() == 0 {
        return None;
    }
    let nominal = from.map_or_else(|| problem.nominal(), <[f64]>::to_vec);
    let mut ranges = problem.ranges();
    ranges.extend(unbounded(problem.gains()));
    let mut starts = starts(problem, &nominal);
    starts.truncate(SEARCHED);
    let found: Vec<Fit> = starts
        .into_par_iter()
        .filter_map(|start| from_start(problem, start.point, &ranges))
        .collect();
    found
        .into_iter()
        .min_by(|a, b| a.criterion.total_cmp(&b.criterion))
}

/// Parameters and initial states with the gains that no search has improved yet, best first.
pub(super) fn starts(problem: &Problem, numbers: &[f64]) -> Vec<Fit> {
    let l = problem.outputs();
    let start = |gain: DMatrix<f64>| {
        let mut point = numbers.to_vec();
        point.extend(problem.places_of_gains().map(|at| gain[at]));
        let mut objective = Deviance::new(problem, Form::Innovation, Noise::unit(l));
        objective.noise = objective.rescale(&point)?;
        let residual = objective.residual(&point)?;
        let deviance = objective.noise.deviance(&residual, &problem.mask);
        Some(Fit {
            form: Form::Innovation,
            criterion: problem.criterion(deviance, objective.noise.len(), problem.gains()),
            noise: objective.noise,
            point,
            deviance,
        })
    };
    let mut found: Vec<Fit> = gains(problem).into_iter().filter_map(start).collect();
    found.sort_by(|a, b| a.deviance.total_cmp(&b.deviance));
    found
}

/// The fit from a start: under white Gaussian noise first, then with the tails that are found.
fn from_start(problem: &Problem, mut point: Vec<f64>, ranges: &[Range]) -> Option<Fit> {
    let l = problem.outputs();
    let mut objective = Deviance::new(problem, Form::Innovation, Noise::unit(l));
    let mut last = f64::INFINITY;
    for round in 0..ROUNDS + ROUGH {
        let Some(residual) = objective.residual(&point) else {
            break;
        };
        objective.noise = if round < ROUGH {
            Noise::white(&residual, l, &problem.mask)
        } else {
            problem.estimated(&residual, Colours::White)
        };
        let effort = if round < ROUGH { APPROACH } else { ROUND };
        let Some(deviance) = minimise(&mut objective, &mut point, ranges, effort) else {
            break;
        };
        let settled = last - deviance < SETTLED;
        last = deviance;
        if settled && round >= ROUGH {
            break;
        }
    }
    let criterion = problem.criterion(last, objective.noise.len(), problem.gains());
    last.is_finite().then_some(Fit {
        form: Form::Innovation,
        point,
        noise: objective.noise,
        deviance: last,
        criterion,
    })
}

/// Ranges of numbers without bounds, such as the elements of a gain.
pub(super) fn unbounded(count: usize) -> impl Iterator<Item = Range> {
    std::iter::repeat_n(
        Range {
            min: f64::NEG_INFINITY,
            max: f64::INFINITY,
            reach: f64::INFINITY,
        },
        count,
    )
}

/// Whether the plant, linearised at its mean, forgets its state more slowly than the longest recording lasts, or never.
pub(super) fn integrates(problem: &Problem) -> bool {
    let mut slow = false;
    problem.each(|excitation, outputs| {
        let Some((linear, _, _)) = mean_linearisation(problem, excitation, outputs) else {
            return;
        };
        let length = excitation.sample_time * excitation.length as f64;
        // A static plant has no poles, and the decomposition none to find.
        if linear.a.is_empty() {
            return;
        }
        let poles = linear.a.complex_eigenvalues();
        slow |= poles.iter().any(|p| p.re * length > -1.0);
    });
    slow
}

/// The plant linearised at the mean of its free run with the values of the text, that mean, and the spread about it. Where the
/// free run does not follow the recording, as that of an unstable plant, both are what the outputs show of the states, and start
/// values.
fn mean_linearisation(
    problem: &Problem,
    excitation: &Excitation,
    outputs: &[&[f64]],
) -> Option<(LinearPlant, Vec<f64>, Vec<f64>)> {
    let plant = problem.plant.equations()?;
    let point = plant.nominal();
    let inputs: Vec<f64> = excitation
        .inputs
        .iter()
        .map(|c| mean_and_spread(c).0)
        .collect();
    let follows = |run: &Trajectory| {
        run.outputs.iter().zip(outputs).all(|(simulated, y)| {
            let error: Vec<f64> = y.iter().zip(simulated).map(|(y, s)| y - s).collect();
            mean_and_spread(&error).1 < mean_and_spread(y).1
        })
    };
    let run = plant.simulate(&point, excitation, None).ok();
    let (centre, spread): (Vec<f64>, Vec<f64>) = match run.filter(follows) {
        Some(run) => run.states.iter().map(|c| mean_and_spread(c)).unzip(),
        None => {
            let shown = shown(&plant.spec, outputs, excitation.sample_time);
            let start = plant.start(&point);
            let of_start = |&x: &f64| (x, if x == 0.0 { 1.0 } else { x.abs() });
            shown
                .into_iter()
                .zip(&start)
                .map(|(shown, x)| shown.unwrap_or_else(|| of_start(x)))
                .unzip()
        }
    };
    let linear = plant.linearise(&point, &centre, &inputs, excitation.start_time);
    let sound = linear
        .a
        .iter()
        .chain(linear.c.iter())
        .all(|v| v.is_finite());
    sound.then_some((linear, centre, spread))
}

/// Samples over which the rate of an output is taken: over one it would be that of its noise.
const RATE_LAG: usize = 5;

/// Mean and spread of the states that outputs copy, and of those that are the rates of such states.
fn shown(spec: &ModelSpec, outputs: &[&[f64]], sample_time: f64) -> Vec<Option<(f64, f64)>> {
    let copies = |unknown: Unknown, of: VariableId| {
        spec.equations.iter().any(|e| {
            e.unknown == unknown
                && e.coefficient.is_none()
                && spec.expressions.node(e.rest) == Node::Variable(of)
        })
    };
    let output_of = |x: VariableId| {
        let mut all = spec.outputs().into_iter();
        all.position(|y| copies(Unknown::Value(y), x))
    };
    let of_state = |x: VariableId| match output_of(x) {
        Some(o) => Some(mean_and_spread(outputs[o])),
        None => {
            let mut positions = spec.states().into_iter();
            let position = positions.find(|&p| copies(Unknown::Derivative(p), x))?;
            let y = outputs[output_of(position)?];
            let moved = y.iter().zip(y.iter().skip(RATE_LAG));
            let rates: Vec<f64> = moved
                .map(|(a, b)| (b - a) / (RATE_LAG as f64 * sample_time))
                .collect();
            Some(mean_and_spread(&rates))
        }
    };
    spec.states().into_iter().map(of_state).collect()
}

/// Mean and standard deviation of the values that are there.
fn mean_and_spread(column: &[f64]) -> (f64, f64) {
    let known: Vec<f64> = column.iter().copied().filter(|v| v.is_finite()).collect();
    let n = known.len().max(1) as f64;
    let mean = known.iter().sum::<f64>() / n;
    (
        mean,
        (known.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt(),
    )
}

/// Gains of stationary Kalman filters of the plant linearised at its mean, for several sizes of process noise.
fn gains(problem: &Problem) -> Vec<DMatrix<f64>> {
    let (n, l) = (problem.states(), problem.outputs());
    let mut found = Vec::new();
    problem.each(|excitation, outputs| {
        if !found.is_empty() {
            return;
        }
        let Some((linear, centre, spread)) = mean_linearisation(problem, excitation, outputs)
        else {
            return;
        };
        let (phi, _) = linear.discrete(excitation.sample_time);
        if !phi.iter().all(|v| v.is_finite()) {
            return;
        }
        let r = DMatrix::from_fn(l, l, |i, j| {
            if i == j {
                (MEASUREMENT * mean_and_spread(outputs[i]).1)
                    .powi(2)
                    .max(1e-300)
            } else {
                0.0
            }
        });
        for rho in DIFFUSION {
            let q = DMatrix::from_fn(n, n, |i, j| {
                if i == j {
                    (rho * spread[i].max(1e-9 * centre[i].abs()).max(1e-12)).powi(2)
                } else {
                    0.0
                }
            });
            found.extend(stationary(&phi, &linear.c, &q, &r));
        }
    });
    found
}

/// Gain of the filtered state, `P C' (C P C' + R)^-1`, after many steps.
fn stationary(
    phi: &DMatrix<f64>,
    c: &DMatrix<f64>,
    q: &DMatrix<f64>,
    r: &DMatrix<f64>,
) -> Option<DMatrix<f64>> {
    let n = phi.nrows();
    let mut p = q * 100.0;
    let mut gain = DMatrix::zeros(n, c.nrows());
    for _ in 0..STEPS {
        let s = c * &p * c.transpose() + r;
        gain = s.cholesky()?.solve(&(c * &p)).transpose();
        let left = DMatrix::identity(n, n) - &gain * c;
        let filtered = &left * &p * left.transpose() + &gain * r * gain.transpose();
        p = phi * filtered * phi.transpose() + q;
    }
    gain.iter().all(|v| v.is_finite()).then_some(gain)
}
