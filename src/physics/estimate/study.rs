//! A plant and its recordings, for what is fitted many times: with other terms, from other starts.

use nalgebra::DMatrix;

use super::deviance::Deviance;
use super::free_run::white_fit;
use super::observer::unbounded;
use super::optimise::{Effort, minimise};
use super::problem::{EstimateError, PlantRecording, Problem};
use super::{EstimateOptions, Fit, Form, SEARCH, best_fit};
use crate::noise::{Colours, Mask, Noise, Series};
use crate::physics::simulation::{Observer, Plant, Point, Trajectory};

/// A problem of estimation that is looked at from several sides.
pub(crate) struct Study<'a> {
    problem: Problem<'a>,
    plant: &'a Plant,
}

impl<'a> Study<'a> {
    pub fn new(
        plant: &'a Plant,
        recordings: &'a [PlantRecording],
        options: &'a EstimateOptions,
    ) -> Result<Self, EstimateError> {
        Ok(Self {
            problem: Problem::new(plant, recordings, options)?,
            plant,
        })
    }

    /// The likelier form of free run and observer, as [`estimate`](super::estimate) finds it.
    pub fn fit(&self, form: Option<Form>) -> Result<Fit, EstimateError> {
        Ok(best_fit(&self.problem, form)?.0)
    }

    /// Least squares in free run from a point.
    pub fn least_squares(&self, from: &[f64]) -> Option<Fit> {
        let mut point = from[..self.problem.nominal().len()].to_vec();
        let deviance = white_fit(&self.problem, &mut point, SEARCH)?;
        let objective = Deviance::new(&self.problem, Form::FreeRun, Noise::unit(self.outputs()));
        let noise = objective.rescale(&point)?;
        let criterion = self.problem.criterion(deviance, noise.len(), 0);
        Some(Fit {
            form: Form::FreeRun,
            point,
            noise,
            deviance,
            criterion,
        })
    }

    /// A fit from a point with the noise of another, and then `rounds` times with a noise model of its own.
    pub fn refit(&self, from: &Fit, rounds: usize, effort: Effort) -> Option<Fit> {
        let mut point = from.point.clone();
        let mut ranges = self.problem.ranges();
        ranges.extend(unbounded(point.len() - ranges.len()));
        let mut objective = Deviance::new(&self.problem, from.form, from.noise.clone());
        let mut deviance = minimise(&mut objective, &mut point, &ranges, effort)?;
        for _ in 0..rounds {
            let residual = objective.residual(&point)?;
            objective.noise = match from.form {
                Form::FreeRun => self.problem.noise(&residual),
                Form::Innovation => Noise::estimate(
                    &residual,
                    self.outputs(),
                    &self.problem.mask,
                    Colours::White,
                ),
            };
            deviance = minimise(&mut objective, &mut point, &ranges, effort)?;
        }
        let of_gain = point.len() - self.problem.nominal().len();
        let criterion = self
            .problem
            .criterion(deviance, objective.noise.len(), of_gain);
        Some(Fit {
            form: from.form,
            point,
            noise: objective.noise,
            deviance,
            criterion,
        })
    }

    pub fn outputs(&self) -> usize {
        self.problem.outputs()
    }

    /// Number of values that are fitted.
    pub fn count(&self) -> usize {
        self.problem.count()
    }

    /// Number of free parameters.
    pub fn parameters(&self) -> usize {
        self.problem.free.len()
    }

    pub fn mask(&self) -> &Mask {
        &self.problem.mask
    }

    /// Recording minus prediction.
    pub fn residual(&self, fit: &Fit) -> Option<Series> {
        Deviance::new(&self.problem, fit.form, fit.noise.clone()).residual(&fit.point)
    }

    /// Whitened derivatives of the predictions by the free numbers that are not at a bound.
    pub fn derivatives(&self, fit: &Fit) -> Option<DMatrix<f64>> {
        let all =
            Deviance::new(&self.problem, fit.form, fit.noise.clone()).derivatives(&fit.point)?;
        let ranges = self.problem.ranges();
        let inside = |i: &usize| {
            ranges
                .get(*i)
                .is_none_or(|r| fit.point[*i] > r.min && fit.point[*i] < r.max)
        };
        let kept: Vec<usize> = (0..all.ncols()).filter(inside).collect();
        Some(all.select_columns(&kept))
    }

    /// Covariance of the free numbers.
    pub fn covariance(&self, fit: &Fit) -> DMatrix<f64> {
        Deviance::new(&self.problem, fit.form, fit.noise.clone())
            .covariances(&fit.point)
            .joint
    }

    /// Parameters and initial states of each recording.
    pub fn points(&self, fit: &Fit) -> Vec<Point> {
        self.problem.points(&fit.point)
    }

    /// Gain of the observer, in the innovation form.
    pub fn gain(&self, fit: &Fit) -> Option<DMatrix<f64>> {
        (fit.form == Form::Innovation).then(|| self.problem.gain(&fit.point))
    }

    /// The predictions of each recording with their states.
    pub fn trajectories(&self, fit: &Fit) -> Option<Vec<Trajectory>> {
        let gain = self.gain(fit);
        let columns = self.problem.columns();
        let each = self.problem.recordings.iter().zip(&columns);
        each.zip(self.points(fit))
            .map(|((recording, columns), point)| {
                let observer = gain.as_ref().map(|gain| Observer {
                    gain,
                    recorded: &columns.outputs,
                });
                let excitation = self.problem.excitation(recording, columns);
                self.plant
                    .simulate(&point, &excitation, observer.as_ref())
                    .ok()
            })
            .collect()
    }

    /// Free run of each recording.
    pub fn free_run(&self, fit: &Fit) -> Option<Series> {
        let numbers = self.problem.nominal().len();
        Deviance::new(&self.problem, Form::FreeRun, fit.noise.clone())
            .simulated(&fit.point[..numbers])
    }

    /// The plant.
    pub fn plant(&self) -> &Plant {
        self.plant
    }
}
