//! Free runs over the recordings, and the figures and pictures of them.

use super::Answer;
use crate::explain::document::plots::{extremes, spectrum, spectrum_picture};
use crate::explain::engine::holdout::HeldOut;
use crate::explain::engine::select::CHANCE;
use crate::explain::explanation::{FitFigure, FitSteps, NoiseFound, OutputFit, SignalTraces};
use crate::noise::Series;
use crate::physics::estimate::{Fit, Study};

/// Points of a picture.
const TRACE_POINTS: usize = 1500;

/// The mean of the values that are there, at every sample.
fn level(recorded: &[f64]) -> Vec<f64> {
    let known = recorded.iter().filter(|y| y.is_finite());
    let (sum, count) = known.fold((0.0, 0), |(sum, count), y| (sum + y, count + 1));
    vec![sum / f64::from(count.max(1)); recorded.len()]
}

pub(super) fn figure(recorded: &[f64], simulated: &[f64]) -> FitFigure {
    let pairs: Vec<(f64, f64)> = recorded
        .iter()
        .copied()
        .zip(simulated.iter().copied())
        .filter(|(y, s)| y.is_finite() && s.is_finite())
        .collect();
    let n = pairs.len().max(1) as f64;
    let mean = pairs.iter().map(|p| p.0).sum::<f64>() / n;
    let error = pairs.iter().map(|(y, s)| (y - s).powi(2)).sum::<f64>();
    let spread = pairs.iter().map(|(y, _)| (y - mean).powi(2)).sum::<f64>();
    FitFigure {
        rmse: (error / n).sqrt(),
        fit_percent: 100.0 * (1.0 - (error / spread.max(f64::MIN_POSITIVE)).sqrt()),
    }
}

/// Recordings and free runs over them, each output of each recording.
pub(super) struct FreeRuns {
    pub(super) recorded: Series,
    /// With the values of the text; the mean of the recording where these cannot be simulated.
    pub(super) given: Series,
    /// Whether they can.
    pub(super) given_runs: bool,
    /// With estimated parameters.
    pub(super) only: Series,
    /// With what was found.
    pub(super) with: Series,
}

impl Answer<'_> {
    fn given(&self) -> Option<Series> {
        let mut all = Series::new();
        for r in self.recordings {
            all.extend(r.run(self.plant, &self.plant.nominal(), self.hold).ok()?);
        }
        Some(all)
    }

    pub(super) fn free_runs(&self) -> FreeRuns {
        let outputs = self.recordings.iter().map(|r| r.outputs.clone());
        let recorded: Series = outputs.flatten().collect();
        // What cannot be simulated follows the recording no better than its mean.
        let missing = || recorded.iter().map(|y| level(y)).collect::<Series>();
        let given = self.given();
        let only = self.base.free_run(&self.found.baseline);
        let with = self.whole.free_run(&self.found.fit);
        FreeRuns {
            given_runs: given.is_some(),
            given: given.unwrap_or_else(missing),
            only: only.unwrap_or_else(missing),
            with: with.unwrap_or_else(missing),
            recorded,
        }
    }

    /// An output of all recordings, one after the other.
    pub(super) fn column(&self, series: &Series, output: usize) -> Vec<f64> {
        let of_output = series.iter().skip(output).step_by(self.base.outputs());
        of_output.flatten().copied().collect()
    }

    /// The figures of an output over all recordings.
    pub(super) fn steps(&self, runs: &FreeRuns, output: usize, p_value: f64) -> FitSteps {
        let column = |s: &Series| self.column(s, output);
        let (y, with) = (column(&runs.recorded), column(&runs.with));
        FitSteps {
            simulation: figure(&y, &column(&runs.given)),
            parameters_only: figure(&y, &column(&runs.only)),
            augmented: figure(&y, &with),
            noise_floor: self.noise_floor(output, p_value, &y, &with),
            improvement_95: None,
        }
    }

    /// Free runs of an output in blocks that their fits had not seen.
    pub(super) fn held_out(&self, output: usize, train: &FitSteps) -> Option<FitSteps> {
        let [without, with] = self.found.held_out.as_ref()?;
        let figure = |of: &HeldOut| {
            let (rmse, fit_percent) = of.figure(output);
            FitFigure { rmse, fit_percent }
        };
        Some(FitSteps {
            parameters_only: figure(without),
            augmented: figure(with),
            ..train.clone()
        })
    }

    /// What is left, where that is noise; else only its unforeseeable part.
    pub(super) fn noise_floor(
        &self,
        output: usize,
        p_value: f64,
        recorded: &[f64],
        simulated: &[f64],
    ) -> FitFigure {
        let whole = figure(recorded, simulated);
        if p_value >= CHANCE {
            return whole;
        }
        let rmse = self.found.fit.noise.scale[output].min(whole.rmse);
        let spread = figure(recorded, &level(recorded)).rmse;
        FitFigure {
            rmse,
            fit_percent: 100.0 * (1.0 - rmse / spread.max(f64::MIN_POSITIVE)),
        }
    }

    /// The error of the free run over the standard deviation of the innovations: the largest of all outputs.
    pub(super) fn strays(&self, outputs: &[OutputFit]) -> f64 {
        let noise = self.noise();
        let ratios = outputs.iter().filter_map(|fit| {
            let of = noise.iter().find(|n| n.output == fit.output)?;
            let std = of.innovation_std
                * match of.degrees_of_freedom {
                    None => 1.0,
                    Some(degrees) => (degrees / (degrees - 2.0).max(0.0)).sqrt(),
                };
            Some(fit.train.augmented.rmse / std)
        });
        ratios.filter(|r| r.is_finite()).fold(0.0, f64::max)
    }

    pub(super) fn noise(&self) -> Vec<NoiseFound> {
        let noise = &self.found.fit.noise;
        let each = self
            .outputs()
            .into_iter()
            .zip(&noise.colours)
            .zip(&noise.scale);
        each.map(|(((output, _), colour), &scale)| NoiseFound {
            output,
            autoregression: colour.ar.clone(),
            moving_average: colour.ma.clone(),
            innovation_std: scale,
            degrees_of_freedom: noise.degrees.is_finite().then_some(noise.degrees),
        })
        .collect()
    }

    pub(super) fn signals(&self, runs: &FreeRuns) -> Vec<SignalTraces> {
        let FreeRuns {
            recorded,
            given,
            only,
            with,
            ..
        } = runs;
        let l = self.base.outputs();
        let outputs = self.outputs();
        let residual = |fit: &Fit, study: &Study| study.residual(fit).unwrap_or_default();
        let before = residual(&self.found.baseline, &self.base);
        let after = residual(&self.found.fit, &self.whole);
        let mut traces = Vec::new();
        for (r, recording) in self.recordings.iter().enumerate() {
            for (o, (output, unit)) in outputs.iter().enumerate() {
                let s = r * l + o;
                let error: Vec<f64> = recorded[s]
                    .iter()
                    .zip(&given[s])
                    .map(|(y, g)| y - g)
                    .collect();
                let shown = extremes(&error, TRACE_POINTS);
                let thin = |v: &[f64]| -> Vec<f64> { shown.iter().map(|&k| v[k]).collect() };
                let h = recording.sample_time;
                traces.push(SignalTraces {
                    output: output.clone(),
                    unit: unit.clone(),
                    recording: r,
                    time: shown
                        .iter()
                        .map(|&k| recording.start_time + k as f64 * h)
                        .collect(),
                    recorded: thin(&recorded[s]),
                    simulated: thin(&given[s]),
                    parameters_only: thin(&only[s]),
                    augmented: thin(&with[s]),
                    spectrum: spectrum_picture(
                        &spectrum(&before, l, o, h),
                        &spectrum(&after, l, o, h),
                    ),
                });
            }
        }
        traces
    }
}
