//! Recordings of a plant: their columns, which values are there, and how finely they are rounded.

use crate::log::Log;
use crate::noise::{Mask, Series};
use crate::physics::simulation::{Excitation, Hold, Plant, Point, SimulationError, Trajectory};

/// A recording of a plant.
#[derive(Debug, Clone)]
pub struct PlantRecording {
    /// A column for each input, in the order of declaration.
    pub inputs: Vec<Vec<f64>>,
    /// A column for each output, in the order of declaration; `NaN` is missing.
    pub outputs: Vec<Vec<f64>>,
    /// Seconds from sample to sample.
    pub sample_time: f64,
    /// Time of the first sample.
    pub start_time: f64,
}

impl From<&Log> for PlantRecording {
    fn from(log: &Log) -> Self {
        Self {
            inputs: log.input_data.clone(),
            outputs: log.output_data.clone(),
            sample_time: log.sample_time,
            start_time: log.start_time,
        }
    }
}

/// Columns of a recording, borrowed.
pub(super) struct Columns<'a> {
    pub(super) inputs: Vec<&'a [f64]>,
    pub(super) outputs: Vec<&'a [f64]>,
}

fn run(
    plant: &Plant,
    point: &Point,
    inputs: &[Vec<f64>],
    (length, sample_time, start_time): (usize, f64, f64),
    hold: Hold,
) -> Result<Trajectory, SimulationError> {
    let inputs: Vec<&[f64]> = inputs.iter().map(Vec::as_slice).collect();
    let excitation = Excitation {
        inputs: &inputs,
        length,
        sample_time,
        start_time,
        hold,
    };
    plant.simulate(point, &excitation, None)
}

impl Plant {
    /// Runs freely over a log.
    pub(crate) fn run(
        &self,
        log: &Log,
        point: &Point,
        hold: Hold,
    ) -> Result<Trajectory, SimulationError> {
        let times = (log.samples(), log.sample_time, log.start_time);
        run(self, point, &log.input_data, times, hold)
    }
}

impl PlantRecording {
    pub(super) fn columns(&self) -> Columns<'_> {
        Columns {
            inputs: self.inputs.iter().map(Vec::as_slice).collect(),
            outputs: self.outputs.iter().map(Vec::as_slice).collect(),
        }
    }

    pub(crate) fn samples(&self) -> usize {
        self.outputs.first().map_or(0, Vec::len)
    }

    /// Samples at which an output was measured.
    pub(crate) fn measured(&self) -> Vec<usize> {
        let known = |k: &usize| self.outputs.iter().any(|y| y[*k].is_finite());
        (0..self.samples()).filter(known).collect()
    }

    /// The samples before the measured one with this number; all where there are not so many.
    pub(crate) fn before_measured(&self, number: usize) -> usize {
        match number {
            0 => 0,
            _ => (self.measured().get(number).copied()).unwrap_or(self.samples()),
        }
    }

    /// Where the first of recordings begins and the last one ends, in seconds.
    pub(crate) fn span(recordings: &[Self]) -> (f64, f64) {
        let end = |r: &Self| r.start_time + r.samples() as f64 * r.sample_time;
        let begins = recordings.iter().map(|r| r.start_time);
        let begin = begins.reduce(f64::min).unwrap_or(0.0);
        (begin, recordings.iter().map(end).fold(begin, f64::max))
    }

    /// The samples of this part of what was measured.
    pub(crate) fn first_part(&self, part: f64) -> usize {
        let values = self.measured().len() as f64;
        self.before_measured((part * values) as usize)
    }

    /// Outputs of a plant that runs freely over the recording.
    pub(crate) fn run(
        &self,
        plant: &Plant,
        point: &Point,
        hold: Hold,
    ) -> Result<Series, SimulationError> {
        let times = (self.samples(), self.sample_time, self.start_time);
        Ok(run(plant, point, &self.inputs, times, hold)?.outputs)
    }
}

/// Which values are there.
pub(super) fn mask(recordings: &[PlantRecording]) -> Mask {
    let outputs = recordings.iter().flat_map(|r| &r.outputs);
    outputs
        .map(|y| y.iter().map(|v| v.is_finite()).collect())
        .collect()
}

/// Samples that tell how finely a sensor shows.
const LOOKED_AT: usize = 4000;

/// What rounding to the smallest difference of two recorded values takes off, as a standard deviation, an output.
pub(super) fn rounding(recordings: &[PlantRecording]) -> Vec<f64> {
    let outputs = recordings.first().map_or(0, |r| r.outputs.len());
    let of = |output: usize| {
        let columns = recordings.iter().map(|r| &r.outputs[output]);
        let every = columns.clone().map(Vec::len).sum::<usize>() / LOOKED_AT + 1;
        let mut values: Vec<f64> = columns
            .flat_map(|y| y.iter().step_by(every))
            .copied()
            .filter(|v| v.is_finite())
            .collect();
        values.sort_unstable_by(f64::total_cmp);
        let steps = values.windows(2).map(|w| w[1] - w[0]);
        let least = steps.filter(|d| *d > 0.0).min_by(f64::total_cmp);
        least.unwrap_or(0.0) / 12f64.sqrt()
    };
    (0..outputs).map(of).collect()
}
