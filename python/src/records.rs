//! Recordings that stay in their numpy arrays: read block by block, never copied as a whole.

use innovant::identify::{Recording, Records};
use innovant::log::{Channel, LogError};
use numpy::ndarray::{ArrayView2, Axis, Slice};

use crate::arrays::{Samples, channels, recording_name};

/// Rows passed on at a time: a block of a few channels and its transpose stay in the second-level cache.
const ROWS: usize = 4096;

/// Experiments of one plant.
pub struct ArrayRecords<'a> {
    experiments: Vec<Experiment<'a>>,
    inputs: Vec<Channel>,
    outputs: Vec<Channel>,
    sample_time: f64,
    block: Vec<Vec<f64>>,
}

struct Experiment<'a> {
    name: String,
    u: ArrayView2<'a, f64>,
    y: ArrayView2<'a, f64>,
}

impl Experiment<'_> {
    fn samples(&self) -> usize {
        self.u.nrows()
    }
}

impl<'a> ArrayRecords<'a> {
    /// One pair of arrays (samples x channels) an experiment; `inputs` and `outputs` are headers.
    ///
    /// # Errors
    /// Those of [`innovant::log::Log::from_columns`], but for numbers that are not finite, which reading finds.
    pub fn new(
        u: &'a [Samples<'_>],
        y: &'a [Samples<'_>],
        sample_time: f64,
        inputs: &[String],
        outputs: &[String],
    ) -> Result<Self, LogError> {
        if !innovant::internal::log::is_sample_time(sample_time) {
            return Err(LogError::InvalidSampleTime { sample_time });
        }
        let count = u.len();
        let experiments: Vec<Experiment<'a>> = u
            .iter()
            .zip(y)
            .enumerate()
            .map(|(index, (u, y))| Experiment {
                name: recording_name(index, count),
                u: u.as_array(),
                y: y.as_array(),
            })
            .collect();
        for Experiment { name, u, y } in &experiments {
            for (role, array, names) in [("input", u, inputs), ("output", y, outputs)] {
                if array.ncols() != names.len() {
                    return Err(LogError::ColumnCount {
                        name: name.clone(),
                        role,
                        expected: names.len(),
                        found: array.ncols(),
                    });
                }
            }
            if u.nrows() == 0 {
                return Err(LogError::too_short(name, 0, 1, "a recording"));
            }
            if u.nrows() != y.nrows() {
                return Err(LogError::ColumnLength {
                    name: name.clone(),
                    column: outputs.first().cloned().unwrap_or_default(),
                    expected: u.nrows(),
                    found: y.nrows(),
                });
            }
        }
        if experiments.is_empty() {
            return Err(LogError::too_short("the recording", 0, 1, "identification"));
        }
        Ok(Self {
            experiments,
            inputs: channels(inputs),
            outputs: channels(outputs),
            sample_time,
            block: vec![vec![0.0; ROWS]; inputs.len() + outputs.len()],
        })
    }
}

impl Records for ArrayRecords<'_> {
    fn experiments(&self) -> usize {
        self.experiments.len()
    }

    fn inputs(&self) -> &[Channel] {
        &self.inputs
    }

    fn outputs(&self) -> &[Channel] {
        &self.outputs
    }

    fn sample_time(&self) -> f64 {
        self.sample_time
    }

    fn recordings(&self) -> Vec<Recording> {
        self.experiments
            .iter()
            .map(|experiment| Recording {
                name: experiment.name.clone(),
                sha256: None,
                samples: experiment.samples(),
                start_time: 0.0,
                origin: None,
                reading: None,
            })
            .collect()
    }

    fn kept_samples(&self, experiment: usize) -> usize {
        self.experiments[experiment].samples()
    }

    fn read(
        &mut self,
        experiment: usize,
        limit: Option<usize>,
        sink: &mut dyn FnMut(&[&[f64]]),
    ) -> Result<(), LogError> {
        let Experiment { name, u, y } = &self.experiments[experiment];
        let samples = limit.unwrap_or(usize::MAX).min(u.nrows());
        let headers = || self.inputs.iter().chain(&self.outputs);
        for from in (0..samples).step_by(ROWS) {
            let rows = ROWS.min(samples - from);
            let columns = u.columns().into_iter().chain(y.columns());
            for ((block, column), channel) in self.block.iter_mut().zip(columns).zip(headers()) {
                let mut finite = true;
                let part = column.slice_axis(Axis(0), Slice::from(from..from + rows));
                for (to, value) in block.iter_mut().zip(&part) {
                    *to = *value;
                    finite &= value.is_finite();
                }
                if !finite {
                    let found = block[..rows].iter().position(|value| !value.is_finite());
                    let at = found.unwrap_or(0);
                    return Err(LogError::ColumnNotFinite {
                        name: name.clone(),
                        column: channel.to_string(),
                        sample: from + at,
                        value: block[at],
                    });
                }
            }
            let slices: Vec<&[f64]> = self.block.iter().map(|column| &column[..rows]).collect();
            sink(&slices);
        }
        Ok(())
    }
}
