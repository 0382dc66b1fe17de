//! What is free in an estimation, and the deviance of the recordings with its derivatives.

use std::sync::Arc;

use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng};

use super::EstimateOptions;
use super::optimise::Range;
use super::plant_recording::{Columns, PlantRecording, mask, rounding};
use crate::noise::{Colours, Mask, Noise, Series};
use crate::physics::external::ExternalError;
use crate::physics::simulated::{RunError, Simulated};
use crate::physics::simulation::{Excitation, Plan, Point, SimulationError};
use crate::physics::spec::{ModelSpec, VariableKind};

/// Recordings must have more values than so many for each free parameter and initial state.
pub(crate) const VALUES_A_NUMBER: usize = 2;

/// Why a plant cannot be estimated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EstimateError {
    /// No recording, or one without samples.
    #[error("there is no recording to estimate from")]
    Empty,
    /// A recording of another plant.
    #[error("recording {recording} has {found} {what}, the plant {expected}")]
    Columns {
        /// Counted from 1.
        recording: usize,
        /// Inputs or outputs.
        what: &'static str,
        /// Of the plant.
        expected: usize,
        /// Of the recording.
        found: usize,
    },
    /// More is free than there are values.
    #[error(
        "{free} parameters and initial states are free, and the recordings have only {samples} values: fix some of them, or record longer"
    )]
    TooShort {
        /// Parameters and initial states.
        free: usize,
        /// Values.
        samples: usize,
    },
    /// No start can be simulated.
    #[error("the plant cannot be simulated with the values of the text: {0}")]
    Simulation(#[from] SimulationError),
    /// An external simulator failed.
    #[error(transparent)]
    External(#[from] Box<ExternalError>),
}

impl From<RunError> for EstimateError {
    fn from(error: RunError) -> Self {
        match error {
            RunError::Equations(error) => Self::Simulation(error),
            RunError::External(error) => Self::External(error),
        }
    }
}

/// Recordings, plant and what is free.
pub(super) struct Problem<'a> {
    pub(super) plant: Arc<dyn Simulated>,
    pub(super) recordings: &'a [PlantRecording],
    pub(super) options: &'a EstimateOptions,
    pub(super) mask: Mask,
    /// Places of the free parameters.
    pub(super) free: Vec<usize>,
    /// Places of the states whose start is free.
    pub(super) starts: Vec<usize>,
    /// Places of the states that an observer corrects.
    pub(super) corrected: Vec<usize>,
    /// Ramps of the switches, for each recording.
    pub(super) plans: Vec<Plan>,
    /// What rounding takes off the values of each output, as a standard deviation.
    rounding: Vec<f64>,
    nominal: Point,
}

/// What Schwarz's criterion adds for numbers that are estimated from so many values, independent ones and all, with the
/// correction for few values (A. McQuarrie, *Statistics & Probability Letters* 44, 1999).
pub(super) fn penalty(numbers: usize, independent: f64, values: usize) -> f64 {
    let (k, n) = (numbers as f64, values as f64);
    k * independent.ln() * n / (n - k - 2.0).max(1.0)
}

impl<'a> Problem<'a> {
    pub(crate) fn new(
        plant: &dyn Simulated,
        recordings: &'a [PlantRecording],
        options: &'a EstimateOptions,
    ) -> Result<Self, EstimateError> {
        let spec = plant.spec();
        let (inputs, outputs) = (spec.inputs().len(), spec.outputs().len());
        if recordings.is_empty() || recordings.iter().any(|r| r.samples() == 0) {
            return Err(EstimateError::Empty);
        }
        for (i, r) in recordings.iter().enumerate() {
            for (what, expected, found) in [
                ("inputs", inputs, r.inputs.len()),
                ("outputs", outputs, r.outputs.len()),
            ] {
                if expected != found {
                    return Err(EstimateError::Columns {
                        recording: i + 1,
                        what,
                        expected,
                        found,
                    });
                }
            }
        }
        let free = (0..spec.parameters().len())
            .filter(|&i| options.free.get(i).copied().unwrap_or(true))
            .collect();
        let states = spec.states();
        let starts = (0..states.len())
            .filter(|&i| !spec.variable(states[i]).fixed)
            .collect();
        let corrected = (0..states.len())
            .filter(|&i| !spec.variable(states[i]).uncorrected)
            .collect();
        let nominal = plant.nominal();
        let plant = plant.for_search();
        let mut problem = Self {
            plant,
            recordings,
            options,
            mask: mask(recordings),
            free,
            starts,
            corrected,
            plans: Vec::new(),
            rounding: rounding(recordings),
            nominal,
        };
        let free = problem.nominal().len();
        let samples = problem.count();
        if samples <= VALUES_A_NUMBER * free {
            return Err(EstimateError::TooShort { free, samples });
        }
        let plant = problem.plant.clone();
        problem.plans = recordings
            .iter()
            .map(|r| {
                let columns = r.columns();
                plant.plan(&problem.nominal, &problem.excitation(r, &columns))
            })
            .collect();
        Ok(problem)
    }

    /// The first samples of each recording, so many as `count` says.
    pub(crate) fn parts(&self, count: impl Fn(&PlantRecording) -> usize) -> Vec<PlantRecording> {
        let part = |r: &PlantRecording| {
            let samples = count(r).clamp(1.min(r.samples()), r.samples());
            let cut =
                |columns: &[Vec<f64>]| columns.iter().map(|c| c[..samples].to_vec()).collect();
            PlantRecording {
                inputs: cut(&r.inputs),
                outputs: cut(&r.outputs),
                ..*r
            }
        };
        self.recordings.iter().map(part).collect()
    }

    /// The same problem on other recordings.
    pub(crate) fn with_recordings<'b>(&self, recordings: &'b [PlantRecording]) -> Problem<'b>
    where
        'a: 'b,
    {
        Problem {
            plant: self.plant.clone(),
            recordings,
            options: self.options,
            mask: mask(recordings),
            free: self.free.clone(),
            starts: self.starts.clone(),
            corrected: self.corrected.clone(),
            plans: self.plans.clone(),
            rounding: rounding(recordings),
            nominal: self.nominal.clone(),
        }
    }

    /// Why the values of the text cannot be simulated.
    pub(crate) fn why_not(&self) -> EstimateError {
        for r in self.recordings {
            let columns = r.columns();
            if let Err(e) = self
                .plant
                .first_run(&self.nominal, &self.excitation(r, &columns))
            {
                return e.into();
            }
        }
        EstimateError::Empty
    }

    /// Columns of each recording.
    pub(crate) fn columns(&self) -> Vec<Columns<'_>> {
        self.recordings
            .iter()
            .map(PlantRecording::columns)
            .collect()
    }

    pub(crate) fn excitation<'b>(
        &self,
        r: &PlantRecording,
        columns: &'b Columns<'b>,
    ) -> Excitation<'b> {
        Excitation {
            inputs: &columns.inputs,
            length: r.samples(),
            sample_time: r.sample_time,
            start_time: r.start_time,
            hold: self.options.hold,
        }
    }

    fn spec(&self) -> &ModelSpec {
        self.plant.spec()
    }

    pub(crate) fn outputs(&self) -> usize {
        self.spec().outputs().len()
    }

    pub(crate) fn states(&self) -> usize {
        self.spec().states().len()
    }

    /// Values that count.
    pub(crate) fn count(&self) -> usize {
        self.mask.iter().flatten().filter(|k| **k).count()
    }

    /// Free numbers at the values of the text: parameters, then the initial states of each recording.
    pub(crate) fn nominal(&self) -> Vec<f64> {
        let start = self.plant.start(&self.nominal);
        let starts = self
            .recordings
            .iter()
            .flat_map(|_| self.starts.iter().map(|&i| start[i]));
        self.free
            .iter()
            .map(|&i| self.nominal.parameters[i])
            .chain(starts)
            .collect()
    }

    /// Bounds of the free numbers.
    pub(crate) fn ranges(&self) -> Vec<Range> {
        let spec = self.spec();
        let parameters = spec.parameters();
        let of_parameters = self.free.iter().map(|&i| {
            let v = spec.variable(parameters[i]);
            let width = v.max - v.min;
            let size = 2.0
                * self.nominal.parameters[i]
                    .abs()
                    .max(v.nominal.unwrap_or(0.0).abs());
            let reach = if width.is_finite() {
                width
            } else if size > 0.0 {
                size
            } else {
                f64::INFINITY
            };
            Range {
                min: v.min,
                max: v.max,
                reach,
            }
        });
        let states = spec.states();
        let of_starts = self.recordings.iter().flat_map(|_| {
            self.starts.iter().map(|&i| {
                let v = spec.variable(states[i]);
                Range {
                    min: v.min,
                    max: v.max,
                    reach: f64::INFINITY,
                }
            })
        });
        of_parameters.chain(of_starts).collect()
    }

    /// Starts within the bounds, from a fixed seed: where a parameter has both bounds anywhere between, else within a factor
    /// of 3 of its value. What may be 0 is so in half of them: a plant with fewer terms has fewer summits.
    pub(crate) fn draws(&self, count: usize) -> Vec<Vec<f64>> {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let (nominal, ranges) = (self.nominal(), self.ranges());
        (0..count)
            .map(|_| {
                let mut point = nominal.clone();
                for (p, r) in point.iter_mut().zip(&ranges).take(self.free.len()) {
                    let share: f64 = random.random();
                    let without = random.random::<bool>() && r.min <= 0.0 && 0.0 <= r.max;
                    *p = if without {
                        0.0
                    } else if (r.max - r.min).is_finite() {
                        r.min + share * (r.max - r.min)
                    } else {
                        (*p * 3f64.powf(2.0 * share - 1.0)).clamp(r.min, r.max)
                    };
                }
                point
            })
            .collect()
    }

    /// The values of the text with one parameter at 0, for each that may be 0, and the place of that parameter: a plant with
    /// a term less has fewer summits, and is never better than the whole one.
    pub(crate) fn without_terms(&self) -> Vec<(Vec<f64>, Option<usize>)> {
        let (nominal, ranges) = (self.nominal(), self.ranges());
        let may_vanish =
            |&i: &usize| nominal[i] != 0.0 && ranges[i].min <= 0.0 && 0.0 <= ranges[i].max;
        let count = if self.plant.costly() {
            0
        } else {
            self.free.len()
        };
        let terms = (0..count).filter(may_vanish);
        terms
            .map(|i| {
                let mut point = nominal.clone();
                point[i] = 0.0;
                (point, Some(i))
            })
            .collect()
    }

    /// Whether noise is taken as white, whatever is left.
    pub(crate) fn least_squares(&self) -> bool {
        self.options.least_squares
    }

    /// Noise model of what a free run leaves: white and Gaussian for least squares, else estimated.
    pub(crate) fn noise(&self, residual: &Series) -> Noise {
        if self.least_squares() {
            Noise::white(residual, self.outputs(), &self.mask)
        } else {
            self.estimated(residual, Colours::All)
        }
    }

    /// Noise model that is estimated, no finer than the values are recorded.
    pub(crate) fn estimated(&self, residual: &Series, colours: Colours) -> Noise {
        Noise::estimate_above(residual, &self.mask, colours, &self.rounding)
    }

    /// Values of a column that count, whitened as those of an output.
    pub(crate) fn whiten(
        &self,
        noise: &Noise,
        output: usize,
        column: &[f64],
        mask: &[bool],
    ) -> Vec<f64> {
        let mut series = vec![Vec::new(); self.outputs()];
        let mut masks = vec![Vec::new(); self.outputs()];
        series[output] = column.to_vec();
        masks[output] = mask.to_vec();
        noise.whiten_kept(&series, &masks)
    }

    /// Parameters and initial states of each recording.
    pub(crate) fn points(&self, numbers: &[f64]) -> Vec<Point> {
        let spec = self.spec();
        let states = spec.states();
        (0..self.recordings.len())
            .map(|r| {
                let mut point = self.nominal.clone();
                for (start, &v) in point.start.iter_mut().zip(&states) {
                    let variable = spec.variable(v);
                    if variable.fixed && variable.starts.len() == self.recordings.len() {
                        *start = Some(variable.starts[r]);
                    }
                }
                for (&i, &v) in self.free.iter().zip(numbers) {
                    point.parameters[i] = v;
                }
                let first = self.free.len() + r * self.starts.len();
                for (&i, &v) in self.starts.iter().zip(&numbers[first..]) {
                    point.start[i] = Some(v);
                }
                point
            })
            .collect()
    }

    /// Schwarz's criterion (BIC).
    pub(crate) fn criterion(&self, deviance: f64, of_noise: usize, of_gain: usize) -> f64 {
        let numbers = self.nominal().len() + of_noise + of_gain;
        let count = self.count();
        deviance + penalty(numbers, count as f64, count)
    }

    /// Gain of the observer in the numbers behind the initial states.
    pub(crate) fn gain(&self, numbers: &[f64]) -> DMatrix<f64> {
        let l = self.outputs();
        let free = &numbers[numbers.len() - self.gains()..];
        let mut gain = DMatrix::zeros(self.states(), l);
        for (row, &i) in free.chunks(l.max(1)).zip(&self.corrected) {
            row.iter().enumerate().for_each(|(j, g)| gain[(i, j)] = *g);
        }
        gain
    }

    /// Free elements of the gain of an observer.
    pub(crate) fn gains(&self) -> usize {
        self.corrected.len() * self.outputs()
    }

    /// Places of these elements, in the order of the numbers.
    pub(crate) fn places_of_gains(&self) -> impl Iterator<Item = (usize, usize)> {
        let l = self.outputs();
        let rows = self.corrected.iter();
        rows.flat_map(move |&i| (0..l).map(move |j| (i, j)))
    }

    /// Standard deviations of the initial states of each recording; 0 where they are certain.
    pub(crate) fn start_stds(&self, covariance: &DMatrix<f64>) -> Vec<Vec<f64>> {
        (0..self.recordings.len())
            .map(|r| {
                let mut stds = vec![0.0; self.states()];
                for (k, &i) in self.starts.iter().enumerate() {
                    let at = self.free.len() + r * self.starts.len() + k;
                    stds[i] = covariance[(at, at)].max(0.0).sqrt();
                }
                stds
            })
            .collect()
    }
}

impl Problem<'_> {
    /// Names of the free parameters.
    pub(crate) fn names(&self) -> Vec<String> {
        let spec = self.spec();
        let parameters: Vec<_> = spec.of_kind(VariableKind::Parameter).collect();
        self.free
            .iter()
            .map(|&i| spec.variable(parameters[i]).name.clone())
            .collect()
    }

    /// Magnitude of each free parameter: the width of its bounds, or its value.
    pub(crate) fn magnitudes(&self, point: &[f64]) -> Vec<f64> {
        let ranges = self.ranges();
        let nominal = self.nominal();
        (0..self.free.len())
            .map(|i| match ranges[i].max - ranges[i].min {
                width if width.is_finite() => width,
                _ => point[i].abs().max(nominal[i].abs()),
            })
            .collect()
    }

    /// The excitation and outputs of each recording, for `of`.
    pub(crate) fn each(&self, mut of: impl FnMut(&Excitation, &[&[f64]])) {
        for r in self.recordings {
            let columns = r.columns();
            of(&self.excitation(r, &columns), &columns.outputs);
        }
    }
}
