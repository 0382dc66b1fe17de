//! Level and slope of the channels, removed from the moments instead of from the data.

use serde::{Deserialize, Serialize};

/// What is removed from every channel before a model is fitted.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum Detrend {
    /// The mean of each channel over the experiment. The levels are kept in the model, so that it
    /// simulates in the units of the recording.
    #[default]
    Mean,
    /// The least-squares straight line of each channel over the experiment.
    Linear,
    /// Nothing: the physical zero of every channel is the operating point.
    None,
}

/// `level + slope k` for sample `k` of an experiment, one entry a channel.
#[derive(Debug, Clone, PartialEq)]
pub struct Trend {
    /// Value at the first sample.
    pub level: Vec<f64>,
    /// Change from one sample to the next.
    pub slope: Vec<f64>,
}

impl Trend {
    /// No trend at all.
    pub fn zero(channels: usize) -> Self {
        Self {
            level: vec![0.0; channels],
            slope: vec![0.0; channels],
        }
    }

    /// Value of channel `channel` at sample `k`.
    pub fn at(&self, channel: usize, k: usize) -> f64 {
        self.level[channel] + self.slope[channel] * k as f64
    }

    /// Takes the trend out of an experiment, one column a channel, from its first sample on.
    pub fn remove_from(&self, columns: &mut [Vec<f64>]) {
        for (channel, column) in columns.iter_mut().enumerate() {
            for (k, value) in column.iter_mut().enumerate() {
                *value -= self.at(channel, k);
            }
        }
    }

    /// Value of each channel in the middle of an experiment of `samples` samples.
    pub fn middle(&self, samples: usize) -> Vec<f64> {
        let middle = (samples.max(1) - 1) as f64 / 2.0;
        self.level
            .iter()
            .zip(&self.slope)
            .map(|(level, slope)| level + slope * middle)
            .collect()
    }
}
