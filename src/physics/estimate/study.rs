//! A plant and its recordings, for what is fitted many times: with other terms, from other starts.

use nalgebra::DMatrix;

use super::deviance::{Deviance, Slopes};
use super::free_run::{follows, left, white_fit_holding};
use super::observer::{self, unbounded};
use super::optimise::{Effort, Range, minimise};
use super::plant_recording::PlantRecording;
use super::problem::{EstimateError, Problem, penalty};
use super::{EstimateOptions, Fit, Form, SEARCH, best_fit};
use crate::noise::{Colours, Mask, Noise, Series, effective_samples};
use crate::physics::simulation::{Hold, Observer, Plan, Plant, Point, Trajectory};

/// Part of the information of single numbers below which a direction changes no prediction: the accuracy of derivatives, squared.
const UNCHANGED: f64 = 1e-9;
/// A free run whose error is more than twice that of an observer strays: the logarithm of the ratio of their variances.
const STRAYS: f64 = 1.386;

/// A problem of estimation that is looked at from several sides.
pub(crate) struct Study<'a> {
    problem: Problem<'a>,
    plant: &'a Plant,
    /// Information in a value, as a part of that in a value with independent noise.
    information: f64,
}

impl<'a> Study<'a> {
    pub(crate) fn new(
        plant: &'a Plant,
        recordings: &'a [PlantRecording],
        options: &'a EstimateOptions,
    ) -> Result<Self, EstimateError> {
        Ok(Self {
            problem: Problem::new(plant, recordings, options)?,
            plant,
            information: 1.0,
        })
    }

    /// The same for another plant.
    pub(crate) fn of(
        &self,
        plant: &'a Plant,
        options: &'a EstimateOptions,
    ) -> Result<Self, EstimateError> {
        let other = Self::new(plant, self.problem.recordings, options)?;
        Ok(Self {
            information: self.information,
            ..other
        })
    }

    /// The same where a value counts as this part of one with independent noise: least squares takes what a free run leaves
    /// as white, which it is not.
    pub(crate) fn with_information(self, information: f64) -> Self {
        Self {
            information,
            ..self
        }
    }

    /// Steps a sample that the plant needs with the values of its text, an implicit one counted as those that it costs.
    pub(crate) fn steps_a_sample(&self) -> usize {
        let plans = self.problem.plans.iter();
        let cost: usize = plans.map(Plan::cost).sum();
        cost.div_ceil(self.samples().max(1))
    }

    /// Samples of all recordings.
    pub(crate) fn samples(&self) -> usize {
        self.problem.recordings.iter().map(|r| r.samples()).sum()
    }

    /// Information in a value, as a part of that in a value with independent noise.
    pub(crate) fn information(&self) -> f64 {
        self.information
    }

    /// Effective samples of what a fit leaves, over all samples.
    pub(crate) fn effective_share(&self, fit: &Fit) -> Option<f64> {
        let residual = self.residual(fit)?;
        Some(effective_samples(&residual, &self.problem.mask) / self.count().max(1) as f64)
    }

    /// Schwarz's criterion of a fit, with the information that values have here.
    pub(crate) fn criterion(&self, fit: &Fit) -> f64 {
        let of_gain = fit.point.len() - self.problem.nominal().len();
        let numbers = self.problem.nominal().len() + fit.noise.len() + of_gain;
        let values = (self.information * self.count() as f64).max(1.0);
        self.information * fit.deviance + penalty(numbers, values, self.count())
    }

    /// Schwarz's criterion of a least-squares fit under the noise model of its own residual. What a plant leaves out makes its residual
    /// slow, and few of its values independent: a count of them from there hides what is missing, the more of it the more (T. J.
    /// Vogelsang, *J. Econometrics* 88, 1999, on tests whose power falls so).
    pub(crate) fn criterion_in_colour(&self, fit: &Fit) -> Option<f64> {
        let (residual, mask) = (self.residual(fit)?, &self.problem.mask);
        let noise = self.problem.estimated(&residual, Colours::All);
        let numbers = self.problem.nominal().len() + noise.len();
        let values = self.count();
        Some(noise.deviance(&residual, mask) + penalty(numbers, values as f64, values))
    }

    /// What a number more adds to the criterion, about.
    pub(crate) fn cost_of_a_number(&self) -> f64 {
        (self.information * self.count() as f64).max(1.0).ln()
    }

    /// The free numbers as the text has them.
    pub(crate) fn nominal(&self) -> Vec<f64> {
        self.problem.nominal()
    }

    /// The likelier form of free run and observer, as [`estimate`](super::estimate) finds it.
    pub(crate) fn fit(&self, form: Option<Form>) -> Result<Fit, EstimateError> {
        Ok(best_fit(&self.problem, form)?.0)
    }

    /// Least squares in free run from a point.
    pub(crate) fn least_squares(&self, from: &[f64]) -> Option<Fit> {
        self.least_squares_with(from, SEARCH)
    }

    /// The same with a given effort.
    pub(crate) fn least_squares_with(&self, from: &[f64], effort: Effort) -> Option<Fit> {
        let mut point = from[..self.problem.nominal().len()].to_vec();
        let (deviance, noise) = white_fit_holding(&self.problem, &mut point, effort, None)?;
        let fit = Fit {
            form: Form::FreeRun,
            point,
            noise,
            deviance,
            criterion: 0.0,
        };
        let criterion = self.criterion(&fit);
        Some(Fit { criterion, ..fit })
    }

    /// Where a free run strays from the recording, the same parameters with an observer that keeps the states near what the
    /// outputs show.
    pub(crate) fn along_recording(&self, free_run: &Fit) -> Option<Fit> {
        let numbers = self.problem.nominal().len();
        let white = self.gaussian(free_run)?;
        let starts = observer::starts(&self.problem, &free_run.point[..numbers]);
        let observed = starts.into_iter().next()?;
        (white.deviance - observed.deviance > STRAYS * self.count() as f64).then_some(observed)
    }

    /// The same numbers under Gaussian noise of the size of the residual, where every value counts as much as any other.
    pub(crate) fn gaussian(&self, fit: &Fit) -> Option<Fit> {
        let residual = self.residual(fit)?;
        let noise = Noise::white(&residual, self.outputs(), self.mask());
        Some(Fit {
            deviance: noise.deviance(&residual, self.mask()),
            noise,
            ..fit.clone()
        })
    }

    /// A fit from a point with the noise and the observer of another: a first comparison of candidates.
    pub(crate) fn glance(&self, from: &Fit, effort: Effort) -> Option<Fit> {
        self.fit_from(from, 0, effort, (Slopes::Frozen, true), &[])
    }

    /// The same with an observer and a noise model of its own.
    pub(crate) fn compare(&self, from: &Fit, effort: Effort) -> Option<Fit> {
        self.fit_from(from, 1, effort, (Slopes::Frozen, false), &[])
    }

    /// A fit from a point with the noise of another, and then `rounds` times with a noise model of its own.
    pub(crate) fn refit(&self, from: &Fit, rounds: usize, effort: Effort) -> Option<Fit> {
        self.fit_from(from, rounds, effort, (Slopes::FrozenFirst, false), &[])
    }

    /// A fit from a point with the noise of another, and with some of the numbers held where they are.
    pub(crate) fn holding(&self, from: &Fit, held: &[usize], effort: Effort) -> Option<Fit> {
        self.fit_from(from, 0, effort, (Slopes::FrozenFirst, false), held)
    }

    fn fit_from(
        &self,
        from: &Fit,
        rounds: usize,
        effort: Effort,
        (slopes, gain_held): (Slopes, bool),
        held: &[usize],
    ) -> Option<Fit> {
        let mut point = from.point.clone();
        let mut ranges = self.problem.ranges();
        ranges.extend(unbounded(point.len() - ranges.len()));
        for &i in held {
            ranges[i] = Range::held(point[i]);
        }
        let mut objective = Deviance::new(&self.problem, from.form, from.noise.clone());
        objective.gain_held = gain_held;
        objective.slopes = slopes;
        let mut deviance = minimise(&mut objective, &mut point, &ranges, effort)?;
        for _ in 0..rounds {
            let residual = objective.residual(&point)?;
            objective.noise = match from.form {
                Form::FreeRun => self.problem.noise(&residual),
                Form::Innovation => self.problem.estimated(&residual, Colours::White),
            };
            deviance = minimise(&mut objective, &mut point, &ranges, effort)?;
        }
        let fit = Fit {
            form: from.form,
            point,
            noise: objective.noise,
            deviance,
            criterion: 0.0,
        };
        let criterion = self.criterion(&fit);
        Some(Fit { criterion, ..fit })
    }

    /// What inputs do between samples.
    pub(crate) fn hold(&self) -> Hold {
        self.problem.options.hold
    }

    pub(crate) fn outputs(&self) -> usize {
        self.problem.outputs()
    }

    /// Free elements of the gain of an observer.
    pub(crate) fn gains(&self) -> usize {
        self.problem.gains()
    }

    /// Number of values that are fitted.
    pub(crate) fn count(&self) -> usize {
        self.problem.count()
    }

    /// Length of the longest recording, in seconds.
    pub(crate) fn duration(&self) -> f64 {
        let of = |r: &PlantRecording| r.outputs[0].len() as f64 * r.sample_time;
        self.problem.recordings.iter().map(of).fold(0.0, f64::max)
    }

    /// Of the first recording.
    pub(crate) fn sample_time(&self) -> f64 {
        self.problem
            .recordings
            .first()
            .map_or(0.0, |r| r.sample_time)
    }

    /// Number of free parameters.
    pub(crate) fn parameters(&self) -> usize {
        self.problem.free.len()
    }

    pub(crate) fn mask(&self) -> &Mask {
        &self.problem.mask
    }

    /// Recording minus prediction.
    pub(crate) fn residual(&self, fit: &Fit) -> Option<Series> {
        Deviance::new(&self.problem, fit.form, fit.noise.clone()).residual(&fit.point)
    }

    /// Deviance with the noise of the fit.
    pub(crate) fn deviance(&self, fit: &Fit) -> Option<f64> {
        Some(fit.noise.deviance(&self.residual(fit)?, self.mask()))
    }

    /// What a fit leaves, whitened, with outliers at the weight that its noise gives them.
    pub(crate) fn weighted_residual(&self, fit: &Fit) -> Option<Vec<f64>> {
        let whitened = fit.noise.whiten_kept(&self.residual(fit)?, self.mask());
        let weighted = whitened.iter().map(|&e| fit.noise.weight(e) * e);
        Some(weighted.collect())
    }

    /// Whitened derivatives of the predictions by the free numbers that are not at a bound.
    pub(crate) fn derivatives(&self, fit: &Fit) -> Option<DMatrix<f64>> {
        let all = self.all_derivatives(fit)?;
        Some(all.select_columns(&self.inside(fit)))
    }

    /// The same by all free numbers.
    pub(crate) fn all_derivatives(&self, fit: &Fit) -> Option<DMatrix<f64>> {
        Deviance::new(&self.problem, fit.form, fit.noise.clone()).derivatives(&fit.point)
    }

    /// How far each of the free numbers may be from its value: between its bounds, or its size; infinite where nothing says it.
    pub(crate) fn reaches(&self, fit: &Fit) -> Vec<f64> {
        let mut reaches: Vec<f64> = self.problem.ranges().iter().map(|r| r.reach).collect();
        reaches.resize(fit.point.len(), f64::INFINITY);
        reaches
    }

    /// The free numbers at a bound, by their places, and the sign of their ways back.
    pub(crate) fn at_bounds(&self, fit: &Fit) -> Vec<(usize, f64)> {
        let ranges = self
            .problem
            .ranges()
            .into_iter()
            .zip(&fit.point)
            .enumerate();
        let way = ranges.map(|(i, (range, x))| (i, if *x <= range.min { 1.0 } else { -1.0 }));
        let inside = self.inside(fit);
        way.filter(|(i, _)| !inside.contains(i)).collect()
    }

    /// The free numbers that are not at a bound, by their places.
    pub(crate) fn inside(&self, fit: &Fit) -> Vec<usize> {
        let ranges = self.problem.ranges();
        let inside = |i: &usize| {
            ranges
                .get(*i)
                .is_none_or(|r| fit.point[*i] > r.min && fit.point[*i] < r.max)
        };
        (0..fit.point.len()).filter(inside).collect()
    }

    /// A fit with those of the first numbers that have gone to a bound back at the values of the text; none where none has. What makes up
    /// for something that is missing stays at its bound while a term is weak.
    pub(crate) fn off_bounds(&self, from: &Fit, numbers: usize) -> Option<Fit> {
        let (inside, nominal) = (self.inside(from), self.nominal());
        let mut point = from.point.clone();
        let mut moved = false;
        for i in (0..numbers).filter(|i| !inside.contains(i)) {
            moved |= point[i] != nominal[i];
            point[i] = nominal[i];
        }
        moved.then(|| Fit {
            point,
            ..from.clone()
        })
    }

    /// The numbers moved, within their bounds.
    pub(crate) fn moved(&self, fit: &Fit, shift: &[f64]) -> Vec<f64> {
        let ranges = self.problem.ranges();
        let each = fit.point.iter().zip(shift).enumerate();
        let moved = each.map(|(i, (x, s))| match ranges.get(i) {
            Some(range) => (x + s).clamp(range.min.min(*x), range.max.max(*x)),
            None => x + s,
        });
        moved.collect()
    }

    /// Covariance of the free numbers.
    pub(crate) fn covariance(&self, fit: &Fit) -> DMatrix<f64> {
        let covariances =
            Deviance::new(&self.problem, fit.form, fit.noise.clone()).covariances(&fit.point);
        covariances.joint / self.information
    }

    /// Whether the predictions change by a standard deviation of the noise when the numbers change by what rounding adds to them over the
    /// recording, so many times the rounding error of a sample (N. J. Higham, *Accuracy and Stability of Numerical Algorithms*,
    /// section 3.1). Such a free run is unstable, and agrees with the recording by chance.
    pub(crate) fn depends_on_rounding(&self, fit: &Fit) -> bool {
        let samples = self.duration() / self.sample_time();
        let rounded = |value: &f64| value * (1.0 + samples * f64::EPSILON);
        let moved = Fit {
            point: fit.point.iter().map(rounded).collect(),
            ..fit.clone()
        };
        let whitened = |fit: &Fit| -> Option<Vec<f64>> {
            Some(fit.noise.whiten_kept(&self.residual(fit)?, self.mask()))
        };
        let both = whitened(fit).zip(whitened(&moved));
        both.is_some_and(|(one, other)| {
            let squares = one.iter().zip(&other).map(|(a, b)| (a - b).powi(2));
            squares.sum::<f64>() > 1.0
        })
    }

    /// Whether the noise model foretells nearly all of what the free run leaves of an output: it may stand for physics, and no test after
    /// it says that none is missing.
    pub(crate) fn absorbs(&self, fit: &Fit) -> bool {
        fit.form == Form::FreeRun
            && (self.residual(fit)).is_some_and(|r| fit.noise.absorbs(&r, self.mask()))
    }

    /// By how many standard deviations a number differs from 0 with all others free, whatever their bounds, but for directions in which
    /// no prediction changes: of numbers with a common scale only the ratios are known, and these may be known well.
    pub(crate) fn deviations_from_zero(&self, fit: &Fit, number: usize) -> Option<f64> {
        let mut objective = Deviance::new(&self.problem, fit.form, fit.noise.clone());
        let mut relative = objective.derivatives(&fit.point)?;
        for (mut column, value) in relative.column_iter_mut().zip(&fit.point) {
            column *= if *value == 0.0 { 1.0 } else { value.abs() };
        }
        let normal = relative.tr_mul(&relative);
        let size = normal.diagonal().map(|d| d.sqrt().max(f64::MIN_POSITIVE));
        let scaled = normal.component_div(&(&size * size.transpose()));
        let eigen = scaled.symmetric_eigen();
        let known = eigen.eigenvalues.iter().enumerate();
        let variance: f64 = known
            .filter(|(_, value)| **value > UNCHANGED)
            .map(|(i, value)| eigen.eigenvectors[(number, i)].powi(2) / value)
            .sum();
        let std = variance.sqrt() / size[number];
        Some(self.information.sqrt() / std)
    }

    /// Parameters and initial states of each recording.
    pub(crate) fn points(&self, fit: &Fit) -> Vec<Point> {
        self.problem.points(&fit.point)
    }

    /// Initial states of each recording, also those that are not free.
    pub(crate) fn starts(&self, fit: &Fit) -> Vec<Vec<f64>> {
        let points = self.points(fit);
        points.iter().map(|p| self.plant.start(p)).collect()
    }

    /// Gain of the observer, in the innovation form.
    pub(crate) fn gain(&self, fit: &Fit) -> Option<DMatrix<f64>> {
        (fit.form == Form::Innovation).then(|| self.problem.gain(&fit.point))
    }

    /// The predictions of each recording with their states.
    pub(crate) fn trajectories(&self, fit: &Fit) -> Option<Vec<Trajectory>> {
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
    pub(crate) fn free_run(&self, fit: &Fit) -> Option<Series> {
        let numbers = self.problem.nominal().len();
        Deviance::new(&self.problem, Form::FreeRun, fit.noise.clone())
            .simulated(&fit.point[..numbers])
    }

    /// Whether what a fit leaves of each output is smaller than its spread about its mean.
    pub(crate) fn follows(&self, fit: &Fit) -> bool {
        self.residual(fit)
            .is_some_and(|residual| follows(&self.problem, &residual))
    }

    /// What a fit leaves of each output, as a part of its sum of squares about its mean; none where it cannot be simulated.
    pub(crate) fn left(&self, fit: &Fit) -> Option<Vec<f64>> {
        Some(left(&self.problem, &self.residual(fit)?))
    }

    /// The plant.
    pub(crate) fn plant(&self) -> &Plant {
        self.plant
    }
}
