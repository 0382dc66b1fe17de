//! Grey-box estimation: parameters and initial states of a plant in equations by maximum likelihood, with their covariance.
//!
//! Two forms. *Free run*: the plant is simulated from the inputs alone, and what is left is coloured noise,
//! `y = simulated + H e`. *Innovation form*: an observer with a constant gain, `x += K (y - yhat)` after each sample, and what is
//! left is white; for plants that integrate or are unstable, and for noise that enters the states. The likelier form, by
//! Schwarz's criterion, is taken. Both are prediction error methods (L. Ljung, *System Identification*, 2nd ed., chapters 7
//! and 9), which hold under feedback as long as the noise model does.

mod adequacy;
mod determined;
mod deviance;
mod evaluate;
mod free_run;
mod observer;
mod optimise;
mod plant_recording;
mod problem;
mod profile;
mod study;

pub use adequacy::{Question, ResidualTest};
pub use determined::Undetermined;
pub use evaluate::{Evaluation, Held, HeldNoise, evaluate, start_by_least_squares};
pub use plant_recording::PlantRecording;
pub use problem::EstimateError;
pub(crate) use problem::VALUES_A_NUMBER;
pub(crate) use study::Study;

use nalgebra::DMatrix;
use rayon::prelude::*;

use self::deviance::Deviance;
use self::free_run::{
    GLANCED_SAMPLES, coloured_fit, continue_free_run, fit_free_run, leaves_noise,
};
use self::optimise::ATTEMPTS;
pub(crate) use self::optimise::Effort;
use self::problem::Problem;
use super::simulated::Simulated;
use super::simulation::{Hold, Point};
use crate::noise::{Noise, kept};

/// How the predictions of a plant are formed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// From the inputs alone; noise is added to the outputs.
    FreeRun,
    /// From the inputs and the outputs so far.
    Innovation,
}

/// What is estimated, and how.
#[derive(Debug, Clone)]
pub struct EstimateOptions {
    /// Which parameters are free, in the order of [`ModelSpec::parameters`](super::ModelSpec::parameters).
    pub free: Vec<bool>,
    /// How inputs behave between samples.
    pub hold: Hold,
    /// The form; none chooses by likelihood.
    pub form: Option<Form>,
    /// Least squares in free run: noise is taken as white. For simulation, where the equations are known to be approximate.
    pub least_squares: bool,
}

/// An estimated parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct EstimatedParameter {
    /// Place in [`ModelSpec::parameters`](super::ModelSpec::parameters).
    pub index: usize,
    /// Estimate.
    pub value: f64,
    /// Standard deviation.
    pub std: f64,
    /// 95 % interval: by the profile of the likelihood where that is not a parabola.
    pub interval: (f64, f64),
    /// True when it is at one of its bounds.
    pub at_bound: bool,
}

/// A plant with its estimated parameters.
#[derive(Debug, Clone)]
pub struct PlantEstimate {
    /// Parameters and, for each recording, initial states.
    pub points: Vec<Point>,
    /// The free parameters.
    pub parameters: Vec<EstimatedParameter>,
    /// Covariance of the free parameters, in their order.
    pub covariance: DMatrix<f64>,
    /// Standard deviations of the free initial states, for each recording; 0 for those that are certain.
    pub start_std: Vec<Vec<f64>>,
    /// The form that was taken.
    pub form: Form,
    /// Gain of the observer, for the innovation form.
    pub gain: Option<DMatrix<f64>>,
    /// `-2 log` likelihood of each form that was fitted.
    pub deviance: f64,
    /// Schwarz's criterion of the form taken, and of the other where it was fitted.
    pub criterion: f64,
    /// Schwarz's criterion of the other form.
    pub other_criterion: Option<f64>,
    /// Values that were fitted.
    pub samples: usize,
    /// Standard deviation of the innovations of each output.
    pub noise_std: Vec<f64>,
    /// Poles, zeros and tails of the noise: autoregression and moving average of each output, degrees of freedom.
    pub noise: (Vec<Vec<f64>>, Vec<Vec<f64>>, f64),
    /// Free run: a column for each recording and output.
    pub simulated: Vec<Vec<f64>>,
    /// Whitened residuals: a column for each recording and output.
    pub innovations: Vec<Vec<f64>>,
    /// Free run of parameters and initial states that were estimated from the first [`HELD_OUT_FROM`] of each recording only.
    pub held_out: Option<Vec<Vec<f64>>>,
    /// What the recordings do not determine.
    pub undetermined: Vec<Undetermined>,
    /// Tests of the residuals.
    pub tests: Vec<ResidualTest>,
}

/// Rounds of noise model and parameters.
const ROUNDS: usize = 4;
/// A round that gains less than this in the deviance is the last.
const SETTLED: f64 = 0.05;
/// Effort of a search.
const SEARCH: Effort = Effort {
    iterations: 60,
    settled: 1e-2,
    attempts: ATTEMPTS,
};
const ROUND: Effort = Effort {
    iterations: 20,
    settled: 1e-3,
    attempts: ATTEMPTS,
};
/// A criterion that is larger than that of a rival by this is not improved further.
const HOPELESS: f64 = 200.0;
/// Part of what was measured in each recording that the held-out fit is estimated from; the rest is judged.
pub const HELD_OUT_FROM: f64 = 2.0 / 3.0;

/// Estimates a plant, in equations or as an external simulator, from recordings of it. External simulators have no states that
/// an observer could correct: they are estimated in free run.
///
/// # Errors
/// When nothing is free, the recordings do not fit the plant, or the plant cannot be simulated at any start.
pub fn estimate(
    plant: &dyn Simulated,
    recordings: &[PlantRecording],
    options: &EstimateOptions,
) -> Result<PlantEstimate, EstimateError> {
    let problem = Problem::new(plant, recordings, options)?;
    let form = if options.least_squares || plant.equations().is_none() {
        Some(Form::FreeRun)
    } else {
        options.form
    };
    let (best, other) = best_fit(&problem, form)?;
    let estimate = finish(&problem, best, other);
    stopped(plant).map_or(Ok(estimate), Err)
}

/// The likelier fit, with the criterion of the other form where that was fitted too.
fn best_fit(problem: &Problem, form: Option<Form>) -> Result<(Fit, Option<f64>), EstimateError> {
    let (free_run, innovation) = match form {
        Some(Form::FreeRun) => (fit_free_run(problem), None),
        Some(Form::Innovation) => (None, observer::fit(problem, None)),
        None if observer::integrates(problem) => {
            // In free run the errors of such a plant grow: it comes second, from where the observer has led.
            let innovation = observer::fit(problem, None);
            let free_run = match &innovation {
                Some(fit) => continue_free_run(problem, fit),
                None => fit_free_run(problem),
            };
            // What looks like a gain of the observer then is one of its many summits where errors grow.
            let noise = free_run.as_ref().is_some_and(|f| leaves_noise(problem, f));
            (free_run, innovation.filter(|_| !noise))
        }
        None => {
            let free_run = fit_free_run(problem);
            // Where free run leaves white noise an observer has nothing to correct.
            let coloured = free_run
                .as_ref()
                .is_none_or(|f| f.noise.colours.iter().any(|c| c.len() > 0));
            let innovation = if coloured {
                promising_innovation(problem, free_run.as_ref())
            } else {
                None
            };
            let wins = |i: &Fit| free_run.as_ref().is_none_or(|f| i.criterion < f.criterion);
            match innovation {
                // From where the observer has led, the free run may find a higher summit.
                Some(i) if wins(&i) => {
                    let again = continue_free_run(problem, &i);
                    let better = again.as_ref().is_some_and(|a| {
                        free_run.as_ref().is_none_or(|f| a.criterion < f.criterion)
                    });
                    (if better { again } else { free_run }, Some(i))
                }
                other => (free_run, other),
            }
        }
    };
    match (free_run, innovation) {
        (Some(a), Some(b)) if b.criterion < a.criterion => Ok((b, Some(a.criterion))),
        (Some(a), b) => Ok((a, b.map(|b| b.criterion))),
        (None, Some(b)) => Ok((b, None)),
        (None, None) => Err(stopped(problem.plant.as_ref()).unwrap_or_else(|| problem.why_not())),
    }
}

/// Why an external simulator asks to end, whatever was found until then.
fn stopped(plant: &dyn Simulated) -> Option<EstimateError> {
    plant.stopped().map(EstimateError::from)
}

/// A fit in one of the forms.
#[derive(Debug, Clone)]
pub(crate) struct Fit {
    pub(crate) form: Form,
    /// Parameters, initial states, and the gain where there is one.
    pub(crate) point: Vec<f64>,
    pub(crate) noise: Noise,
    /// `-2 log` likelihood.
    pub(crate) deviance: f64,
    /// Schwarz's criterion.
    pub(crate) criterion: f64,
}

/// The fit in innovation form, unless free run is the better form on the first part of the recordings already.
fn promising_innovation(problem: &Problem, free_run: Option<&Fit>) -> Option<Fit> {
    let Some(free_run) = free_run else {
        return observer::fit(problem, None);
    };
    let recordings = problem.parts(|r| r.before_measured(GLANCED_SAMPLES));
    let short = problem.with_recordings(&recordings);
    let first = observer::fit(&short, Some(&free_run.point))?;
    let residual =
        Deviance::new(&short, Form::FreeRun, free_run.noise.clone()).residual(&free_run.point)?;
    let deviance = free_run.noise.deviance(&residual, &short.mask);
    let rival = short.criterion(deviance, free_run.noise.len(), 0);
    if first.criterion > rival {
        return None;
    }
    observer::fit(problem, Some(&first.point[..problem.nominal().len()]))
}

fn finish(problem: &Problem, fit: Fit, other_criterion: Option<f64>) -> PlantEstimate {
    let mut objective = Deviance::new(problem, fit.form, fit.noise.clone());
    let covariances = objective.covariances(&fit.point);
    let covariance = &covariances.joint;
    let free = problem.free.clone();
    let undetermined = determined::undetermined(problem, &fit.point, covariance);
    let ranges = problem.ranges();
    let parameters = free
        .par_iter()
        .enumerate()
        .map(|(i, &index)| {
            let mut objective = Deviance::new(problem, fit.form, fit.noise.clone());
            let value = fit.point[i];
            EstimatedParameter {
                index,
                value,
                std: covariance[(i, i)].max(0.0).sqrt(),
                interval: profile::interval(&mut objective, problem, &fit, &covariances, i),
                at_bound: value <= ranges[i].min || value >= ranges[i].max,
            }
        })
        .collect();
    let start_std = problem.start_stds(covariance);
    let points = problem.points(&fit.point);
    let residual = objective.residual(&fit.point).unwrap_or_default();
    let innovations = fit.noise.whiten(&residual, &problem.mask);
    let simulated = Deviance::new(problem, Form::FreeRun, fit.noise.clone())
        .simulated(&fit.point)
        .unwrap_or_default();
    let tests = residual_tests(problem, &fit, &innovations, &simulated);
    let held_out = if problem.plant.costly() {
        None
    } else {
        held_out(problem, &fit)
    };
    PlantEstimate {
        points,
        parameters,
        covariance: covariance
            .view((0, 0), (free.len(), free.len()))
            .into_owned(),
        start_std,
        form: fit.form,
        gain: (fit.form == Form::Innovation).then(|| problem.gain(&fit.point)),
        deviance: fit.deviance,
        criterion: fit.criterion,
        other_criterion,
        samples: problem.count(),
        noise_std: fit.noise.scale.clone(),
        noise: (
            fit.noise.colours.iter().map(|c| c.ar.clone()).collect(),
            fit.noise.colours.iter().map(|c| c.ma.clone()).collect(),
            fit.noise.degrees,
        ),
        simulated,
        innovations,
        held_out,
        undetermined,
        tests,
    }
}

/// Free run over the whole recordings of a fit to their first part, in the same form, from the fit to all.
fn held_out(problem: &Problem, fit: &Fit) -> Option<Vec<Vec<f64>>> {
    let recordings = problem.parts(|r| r.first_part(HELD_OUT_FROM));
    let short = problem.with_recordings(&recordings);
    let numbers = problem.nominal().len();
    if short.count() <= 2 * fit.point.len() {
        return None;
    }
    let again = match fit.form {
        Form::FreeRun => coloured_fit(&short, fit.point.clone(), f64::INFINITY)?,
        Form::Innovation => observer::fit(&short, Some(&fit.point[..numbers]))?,
    };
    Deviance::new(problem, Form::FreeRun, again.noise).simulated(&again.point[..numbers])
}

/// Tests of the residuals: are they white, and no function of the inputs? What the parameters could do is taken out of neither
/// side, so that the tests are somewhat too mild.
fn residual_tests(
    problem: &Problem,
    fit: &Fit,
    innovations: &[Vec<f64>],
    simulated: &[Vec<f64>],
) -> Vec<ResidualTest> {
    let l = problem.outputs();
    let mut tests = Vec::new();
    for output in 0..l {
        let of_output = (innovations.iter().zip(&problem.mask))
            .skip(output)
            .step_by(l);
        let series: Vec<Vec<f64>> = of_output.map(|(e, mask)| kept(e, mask)).collect();
        tests.extend(adequacy::white(
            output,
            &series.iter().map(Vec::as_slice).collect::<Vec<_>>(),
            fit.noise.colours[output].len(),
        ));
        let (mut residuals, mut inputs, mut products) =
            (Vec::new(), Vec::<Vec<f64>>::new(), Vec::<Vec<f64>>::new());
        for (r, recording) in problem.recordings.iter().enumerate() {
            let mask = &problem.mask[r * l + output];
            let whitened = |columns: Vec<Vec<f64>>| -> Vec<Vec<f64>> {
                columns
                    .iter()
                    .map(|c| problem.whiten(&fit.noise, output, c, mask))
                    .collect()
            };
            let append = |to: &mut Vec<Vec<f64>>, columns: Vec<Vec<f64>>| {
                to.resize(columns.len().max(to.len()), Vec::new());
                to.iter_mut().zip(columns).for_each(|(to, c)| to.extend(c));
            };
            residuals.extend(&series[r]);
            append(
                &mut inputs,
                whitened(
                    recording
                        .inputs
                        .iter()
                        .flat_map(|u| adequacy::lagged(u))
                        .collect(),
                ),
            );
            let signals: Vec<&[f64]> = recording
                .inputs
                .iter()
                // None where the free run of an observer's fit leaves the numbers that can be written.
                .chain(simulated.get(r * l..(r + 1) * l).unwrap_or_default())
                .map(Vec::as_slice)
                .collect();
            append(&mut products, whitened(adequacy::products(&signals)));
        }
        tests.extend(adequacy::score(
            output,
            Question::Inputs,
            &residuals,
            &inputs,
        ));
        tests.extend(adequacy::score(
            output,
            Question::Products,
            &residuals,
            &products,
        ));
    }
    tests
}
