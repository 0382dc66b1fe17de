//! A plant with given parameters on recordings: their initial states, predictions, and tests of what is left.
//!
//! The whitened residual of a right plant is `e = e0 + J d`: `e0` is white, `J` holds the derivatives by the parameters and the
//! initial states, `d` their errors. The tests are those of [`estimate`](super::estimate()) under the covariance of that sum,
//! `s^2 I + J P J'`: on a recording that the plant has not seen `P` is the covariance of the parameters, on its own nothing is
//! known of `d` (`P` is infinite), for the estimation has removed that part. Initial states are always unknown. By the matrix
//! inversion lemma, `(I + J P J')^-1 = I - J (P^-1 + J'J)^-1 J'`. The error of an observer's gain is left out.

use nalgebra::{DMatrix, DVector};

use super::adequacy::{self, Question, ResidualTest};
use super::deviance::{Deviance, invert};
use super::free_run::white_fit;
use super::optimise::{Range, minimise};
use super::problem::Problem;
use super::{EstimateError, EstimateOptions, Form, PlantRecording, ROUND, estimate};
use crate::noise::{Colour, Colours, Noise, kept};
use crate::physics::simulation::{Hold, Plant, Point};

/// Eigenvalues of the regressors' correlation below this are rounding.
const RANK: f64 = 1e-9;
/// Samples of each recording that the search for initial states begins with.
const FIRST_SAMPLES: usize = 30;
const FIRST_SAMPLES_A_STATE: usize = 10;
/// Precision that stands for a number that is certain.
const CERTAIN: f64 = 1e200;

/// A noise model.
#[derive(Debug, Clone, PartialEq)]
pub struct HeldNoise {
    /// Standard deviation of the innovations of each output.
    pub std: Vec<f64>,
    /// Coefficients of the autoregression of each output.
    pub autoregression: Vec<Vec<f64>>,
    /// Coefficients of the moving average of each output.
    pub moving_average: Vec<Vec<f64>>,
    /// Degrees of freedom of Student's t; infinite for Gaussian.
    pub degrees: f64,
}

/// What is known of a plant.
#[derive(Debug, Clone)]
pub struct Held<'a> {
    /// Parameters.
    pub point: &'a Point,
    /// Places of the estimated parameters, and their covariance.
    pub uncertainty: Option<(Vec<usize>, &'a DMatrix<f64>)>,
    /// How inputs behave between samples.
    pub hold: Hold,
    /// Gain of the observer, for the innovation form.
    pub gain: Option<&'a DMatrix<f64>>,
    /// The noise; without it the plant states that there is none but white noise.
    pub noise: Option<HeldNoise>,
    /// Whether the plant was estimated from these recordings.
    pub own: bool,
    /// Initial states of each recording; none estimates them.
    pub starts: Option<Vec<Vec<f64>>>,
}

/// A plant on recordings. Series are a column for each recording and output.
#[derive(Debug, Clone)]
pub struct Evaluation {
    /// Parameters and, for each recording, initial states.
    pub points: Vec<Point>,
    /// Standard deviations of the initial states of each recording; 0 for those that are certain.
    pub start_std: Vec<Vec<f64>>,
    /// Free run, where there is one.
    pub simulated: Option<Vec<Vec<f64>>>,
    /// Predictions one sample ahead.
    pub predicted: Vec<Vec<f64>>,
    /// Whitened residuals, of variance 1 when the noise is as stated.
    pub innovations: Vec<Vec<f64>>,
    /// Tests of the residuals.
    pub tests: Vec<ResidualTest>,
}

/// Evaluates a plant on recordings of it.
///
/// # Errors
/// As [`estimate`](super::estimate()), or when the plant cannot be simulated with these parameters.
pub fn evaluate(
    plant: &Plant,
    recordings: &[PlantRecording],
    held: &Held,
) -> Result<Evaluation, EstimateError> {
    let plant = plant.with_values(&held.point.parameters);
    let places = held.uncertainty.as_ref().map_or(&[][..], |(p, _)| p);
    let options = EstimateOptions {
        free: (0..held.point.parameters.len())
            .map(|i| places.contains(&i))
            .collect(),
        hold: held.hold,
        form: None,
        least_squares: false,
    };
    let problem = Problem::new(&plant, recordings, &options)?;
    let (point, noise, estimated) = initial_states(&problem, &plant, held)?;
    let form = form(held);
    let mut objective = Deviance::new(&problem, form, noise);
    let (Some(residual), Some(jacobian)) =
        (objective.residual(&point), objective.derivatives(&point))
    else {
        return Err(problem.why_not());
    };
    let noise = objective.noise.clone();
    let l = problem.outputs();
    // Of a plant without a noise model all of the residual is unexplained; a colour only keeps the other tests sound.
    let stated = match estimated {
        true => Noise::white(&residual, l, &problem.mask),
        false => noise.clone(),
    };
    let innovations = stated.whiten(&residual, &problem.mask);
    let recorded = recordings.iter().flat_map(|r| &r.outputs);
    let predicted = recorded
        .zip(&innovations)
        .enumerate()
        .map(|(s, (y, e))| {
            let scale = stated.scale[s % l];
            y.iter().zip(e).map(|(y, e)| y - scale * e).collect()
        })
        .collect();
    let simulated = Deviance::new(&problem, Form::FreeRun, noise.clone())
        .simulated(&point)
        .filter(|s| s.iter().flatten().all(|v| v.is_finite()));
    let signals = match &simulated {
        Some(simulated) => simulated,
        None => &predicted,
    };
    let left = Left::new(&problem, held, &noise, &residual, jacobian);
    let raw = estimated.then_some(innovations.as_slice());
    let tests = left.tests(&problem, &noise, signals, (raw, held.own));
    let mut points = problem.points(&point);
    points
        .iter_mut()
        .for_each(|p| p.parameters.clone_from(&held.point.parameters));
    Ok(Evaluation {
        points,
        start_std: problem.start_stds(&left.covariance),
        simulated,
        predicted,
        innovations,
        tests,
    })
}

fn form(held: &Held) -> Form {
    match held.gain {
        Some(_) => Form::Innovation,
        None => Form::FreeRun,
    }
}

/// Free numbers with the initial states that are given or fit best, the noise, and whether that was estimated.
fn initial_states(
    problem: &Problem,
    plant: &Plant,
    held: &Held,
) -> Result<(Vec<f64>, Noise, bool), EstimateError> {
    let (l, p) = (problem.outputs(), problem.free.len());
    let mut point = problem.nominal();
    if let Some(starts) = &held.starts {
        let known = starts.iter().flat_map(|s| {
            problem
                .starts
                .iter()
                .map(|&i| s.get(i).copied().unwrap_or(0.0))
        });
        point[p..].iter_mut().zip(known).for_each(|(to, x)| *to = x);
    }
    let numbers = point.len();
    if let Some(gain) = held.gain {
        point.extend(problem.places_of_gains().map(|at| gain[at]));
    }
    let pinned = |&value: &f64| Range::held(value);
    let mut ranges: Vec<Range> = point[..p].iter().map(pinned).collect();
    ranges.extend(problem.ranges().into_iter().skip(p));
    ranges.extend(point[numbers..].iter().map(pinned));
    let known = held.noise.as_ref().and_then(known_noise);
    let mut objective = Deviance::new(problem, form(held), Noise::unit(l));
    let searched = held.starts.is_none() && numbers > p;
    if searched {
        start_where_measured(problem, plant, &mut point);
        search(problem, form(held), &mut point, &ranges).ok_or_else(|| problem.why_not())?;
    }
    let estimated = known.is_none();
    objective.noise = match known {
        Some(noise) => noise,
        None => {
            let residual = objective
                .residual(&point)
                .ok_or_else(|| problem.why_not())?;
            problem.estimated(&residual, Colours::All)
        }
    };
    if searched {
        minimise(&mut objective, &mut point, &ranges, ROUND).ok_or_else(|| problem.why_not())?;
    }
    Ok((point, objective.noise, estimated))
}

/// The initial state of a recording by least squares of the free run, with the parameters of the plant: one value for each state, in its
/// unit, `None` where that of the text is certain. The search starts from the text, and where the first sample shows states; what leaves
/// less is taken.
///
/// # Errors
/// As [`estimate`](super::estimate()).
pub fn start_by_least_squares(
    plant: &Plant,
    recording: &PlantRecording,
    hold: Hold,
) -> Result<Vec<Option<f64>>, EstimateError> {
    let options = EstimateOptions {
        free: vec![false; plant.nominal().parameters.len()],
        hold,
        form: Some(Form::FreeRun),
        least_squares: true,
    };
    let recordings = std::slice::from_ref(recording);
    let found = estimate(plant, recordings, &options)?;
    let from_text = found.points.into_iter().next();
    let from_text = from_text.map_or_else(|| plant.nominal().start, |point| point.start);
    let problem = Problem::new(plant, recordings, &options)?;
    let mut point = problem.nominal();
    start_where_measured(&problem, plant, &mut point);
    let mut measured = || {
        search(&problem, Form::FreeRun, &mut point, &problem.ranges())?;
        let deviance = white_fit(&problem, &mut point, ROUND)?;
        let start = problem.points(&point).into_iter().next()?.start;
        (deviance < found.deviance).then_some(start)
    };
    Ok(measured().unwrap_or(from_text))
}

/// An output is linear in a state if a step misses it by less than this part.
const LINEAR: f64 = 1e-6;

/// Initial states that an output shows alone begin where the first sample shows them: an angle may be many turns from that of the
/// text, and a search from there stops at the first turn that looks alike.
fn start_where_measured(problem: &Problem, plant: &Plant, point: &mut [f64]) {
    let (first, count) = (problem.free.len(), problem.starts.len());
    for (r, (at, recording)) in (problem.points(point).iter().zip(problem.recordings)).enumerate() {
        let mut state = plant.start(at);
        let inputs: Vec<f64> = recording.inputs.iter().map(|u| u[0]).collect();
        let mut lineariser = plant.lineariser(at);
        let mut linear = |state: &[f64]| lineariser.at(state, &inputs, recording.start_time);
        for (o, y) in recording.outputs.iter().enumerate() {
            let now = linear(&state);
            let missed = y[0] - now.output[o];
            let shown: Vec<usize> = (0..state.len()).filter(|&i| now.c[(o, i)] != 0.0).collect();
            let &[i] = &shown[..] else {
                continue;
            };
            let Some(k) = problem.starts.iter().position(|&s| s == i) else {
                continue;
            };
            let mut moved = state.clone();
            moved[i] += missed / now.c[(o, i)];
            if (linear(&moved).output[o] - y[0]).abs() <= LINEAR * missed.abs() {
                point[first + r * count + k] = moved[i];
                state = moved;
            }
        }
    }
}

/// Initial states by least squares, on the first samples of each recording and then on twice as many until there are no more:
/// over a long free run a state far off has many summits around it.
fn search(problem: &Problem, form: Form, point: &mut Vec<f64>, ranges: &[Range]) -> Option<()> {
    let longest = problem
        .recordings
        .iter()
        .map(|r| r.outputs[0].len())
        .max()?;
    let mut samples = FIRST_SAMPLES.max(FIRST_SAMPLES_A_STATE * problem.states());
    loop {
        let parts = problem.parts(|r| r.before_measured(samples));
        let part = problem.with_recordings(&parts);
        let mut objective = Deviance::new(&part, form, Noise::unit(problem.outputs()));
        for _ in 0..2 {
            objective.noise = objective.rescale(point)?;
            minimise(&mut objective, point, ranges, ROUND)?;
        }
        if samples >= longest {
            return Some(());
        }
        samples *= 2;
    }
}

fn known_noise(held: &HeldNoise) -> Option<Noise> {
    let colours: Option<Vec<Colour>> = held
        .autoregression
        .iter()
        .zip(&held.moving_average)
        .map(|(ar, ma)| Colour::new(ar.clone(), ma.clone()))
        .collect();
    let scale = held.std.clone();
    let sound = scale.iter().all(|s| s.is_finite() && *s > 0.0);
    let colours = colours.filter(|c| sound && c.len() == scale.len())?;
    Some(Noise {
        colours,
        scale,
        degrees: held.degrees,
    })
}

/// The whitened residual without what the errors of parameters and initial states make of it.
struct Left {
    /// One value for each that counts, as the rows of `jacobian`.
    residual: DVector<f64>,
    /// Parameters and initial states, then a constant for each output.
    jacobian: DMatrix<f64>,
    /// Covariance of all of them given the recordings, in units of the residual's variance; what moves nothing is 0.
    inverse: DMatrix<f64>,
    /// Covariance of parameters and initial states.
    covariance: DMatrix<f64>,
    /// First row of each recording and output, and the number of rows.
    first: Vec<usize>,
    outputs: usize,
}

impl Left {
    fn new(
        problem: &Problem,
        held: &Held,
        noise: &Noise,
        residual: &Vec<Vec<f64>>,
        jacobian: DMatrix<f64>,
    ) -> Self {
        let e = DVector::from_vec(noise.whiten_kept(residual, &problem.mask));
        let mut first = vec![0];
        for mask in &problem.mask {
            first.push(first[first.len() - 1] + mask.iter().filter(|k| **k).count());
        }
        let (l, p) = (problem.outputs(), problem.free.len());
        let own = p + problem.starts.len() * problem.recordings.len();
        let mut jacobian = jacobian
            .columns(0, own)
            .into_owned()
            .resize_horizontally(own + l, 0.0);
        for s in 0..problem.mask.len() {
            jacobian
                .view_mut((first[s], own + s % l), (first[s + 1] - first[s], 1))
                .fill(1.0);
        }
        let variance = e.norm_squared() / e.len().max(1) as f64;
        let mut information = jacobian.tr_mul(&jacobian);
        if let Some((_, covariance)) = held.uncertainty.as_ref().filter(|_| !held.own)
            && let Some(precision) = invert(covariance)
        {
            for i in 0..p {
                for j in 0..p {
                    information[(i, j)] += (variance * precision[(i, j)]).min(CERTAIN);
                }
            }
        }
        let size = own + l;
        let covariance = invert(&information)
            .unwrap_or_else(|| DMatrix::from_diagonal_element(size, size, f64::INFINITY));
        let inverse = covariance.map(|v| if v.is_finite() { v } else { 0.0 });
        let residual = &e - &jacobian * (&inverse * jacobian.tr_mul(&e));
        Self {
            residual,
            jacobian,
            inverse,
            covariance: variance * covariance,
            first,
            outputs: l,
        }
    }

    fn tests(
        &self,
        problem: &Problem,
        noise: &Noise,
        signals: &[Vec<f64>],
        (raw, fitted): (Option<&[Vec<f64>]>, bool),
    ) -> Vec<ResidualTest> {
        let l = problem.outputs();
        let mut tests = Vec::new();
        for output in 0..l {
            let places = (output..self.first.len() - 1).step_by(l);
            let series: Vec<Vec<f64>> = match raw {
                Some(raw) => places.map(|s| kept(&raw[s], &problem.mask[s])).collect(),
                None => places
                    .map(|s| self.residual.as_slice()[self.first[s]..self.first[s + 1]].to_vec())
                    .collect(),
            };
            let series: Vec<&[f64]> = series.iter().map(Vec::as_slice).collect();
            let fitted = if fitted {
                noise.colours[output].len()
            } else {
                0
            };
            tests.extend(adequacy::white(output, &series, fitted));
            // A column for each regressor, zero at the other outputs.
            let stacked = |of: &dyn Fn(usize) -> Vec<Vec<f64>>| -> DMatrix<f64> {
                let each: Vec<Vec<Vec<f64>>> = (0..problem.recordings.len()).map(of).collect();
                let count = each.first().map_or(0, Vec::len);
                let mut matrix = DMatrix::zeros(self.residual.len(), count);
                for (r, columns) in each.iter().enumerate() {
                    let s = r * l + output;
                    for (j, column) in columns.iter().enumerate() {
                        let whitened = problem.whiten(noise, output, column, &problem.mask[s]);
                        matrix
                            .view_mut((self.first[s], j), (whitened.len(), 1))
                            .copy_from_slice(&whitened);
                    }
                }
                matrix
            };
            let inputs = stacked(&|r| {
                let inputs = &problem.recordings[r].inputs;
                inputs.iter().flat_map(|u| adequacy::lagged(u)).collect()
            });
            let products = stacked(&|r| {
                let inputs = problem.recordings[r].inputs.iter();
                let signals: Vec<&[f64]> = inputs
                    .chain(&signals[r * l..(r + 1) * l])
                    .map(Vec::as_slice)
                    .collect();
                adequacy::products(&signals)
            });
            tests.extend(self.score(output, Question::Inputs, inputs));
            tests.extend(self.score(output, Question::Products, products));
        }
        tests
    }

    /// Score test of regressors `Z`: `v' W^-1 v / s^2` with `v = Z' S^-1 e`, `W = Z' S^-1 Z`.
    fn score(
        &self,
        output: usize,
        question: Question,
        mut columns: DMatrix<f64>,
    ) -> Option<ResidualTest> {
        for mut column in columns.column_iter_mut() {
            let size = column.norm();
            if size > 0.0 {
                column /= size;
            }
        }
        let of_output = (output..self.first.len() - 1).step_by(self.outputs);
        let (mut rows, mut squares) = (0, 0.0);
        for s in of_output {
            let own = self
                .residual
                .rows(self.first[s], self.first[s + 1] - self.first[s]);
            rows += own.len();
            squares += own.norm_squared();
        }
        if columns.ncols() == 0 || rows < adequacy::VALUES_A_DEGREE * (columns.ncols() + 1) {
            return None;
        }
        let cross = self.jacobian.tr_mul(&columns);
        let w = columns.tr_mul(&columns) - cross.tr_mul(&(&self.inverse * &cross));
        let v = columns.tr_mul(&self.residual);
        let variance = squares / rows as f64;
        let eigen = w.symmetric_eigen();
        let (mut statistic, mut degrees) = (0.0, 0);
        for (i, &value) in eigen.eigenvalues.iter().enumerate() {
            if value > RANK {
                statistic += eigen.eigenvectors.column(i).dot(&v).powi(2) / value;
                degrees += 1;
            }
        }
        adequacy::test(output, question, statistic / variance, degrees)
    }
}
