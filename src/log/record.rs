//! A whole recording in memory.

use std::path::Path;

use super::log_error::LogError;
use super::read::{Block, LogReader, check_same_channels, check_same_sampling};
use super::sample_time::is_sample_time;
use super::text::Channel;
use super::write::write_table;
use crate::limits;

/// A recording: a uniform time base, named inputs u and named outputs y; a column a channel, N samples each.
#[derive(Debug, Clone, PartialEq)]
pub struct Log {
    /// What messages call it: the file's name.
    pub name: String,
    /// Sample time in seconds.
    pub sample_time: f64,
    /// Time of the first sample in seconds.
    pub start_time: f64,
    /// Input channels, r of them.
    pub inputs: Vec<Channel>,
    /// Output channels, l of them.
    pub outputs: Vec<Channel>,
    /// `input_data[channel][sample]`, r columns of N.
    pub input_data: Vec<Vec<f64>>,
    /// `output_data[channel][sample]`, l columns of N.
    pub output_data: Vec<Vec<f64>>,
    /// SHA-256 (hexadecimal) of the file's raw bytes, when it came from a file.
    pub sha256: Option<String>,
}

/// Arrays of the size of a recording that a command holds at the peak: the recording, what is simulated or predicted from
/// it, and what is left.
const COPIES: usize = 3;

/// Refuses a recording that will not fit: from the first block on its length is known from the bytes that are left.
fn check_memory(reader: &LogReader) -> Result<(), LogError> {
    let channels = reader.inputs().len() + reader.outputs().len();
    let read = reader.samples();
    let samples = match (reader.bytes_total(), reader.bytes_read()) {
        (Some(total), bytes) if bytes > 0 => (read as f64 * (total as f64 / bytes as f64)) as usize,
        _ => read,
    };
    let samples = samples.max(read);
    limits::check(
        limits::of_numbers(&[COPIES, samples, channels]),
        None,
        || {
            format!(
                "{}: {samples} samples of {channels} channels",
                reader.name()
            )
        },
        || "take a part of the recording, or fewer columns with --inputs and --outputs".to_owned(),
    )?;
    Ok(())
}
/// Channels of this size and more, or that move by less than its inverse, are neither identified nor explained: a variance
/// of a gain between two such channels, the fourth power, is still a number (1e240).
pub(crate) const LARGEST_SIZE: f64 = 1e60;

impl Log {
    /// Every channel's samples, inputs then outputs.
    pub fn channel_data(&self) -> Vec<&[f64]> {
        let channels = self.input_data.iter().chain(&self.output_data);
        channels.map(Vec::as_slice).collect()
    }

    /// A plain file, from its reader.
    pub(super) fn of_plain(reader: LogReader) -> Result<Self, LogError> {
        Self::collect(reader)
    }

    /// Reads all blocks that are left in `reader`, which should be at its start.
    ///
    /// # Errors
    /// As [`LogReader::next_block`].
    pub fn collect(mut reader: LogReader) -> Result<Self, LogError> {
        let (inputs, outputs) = (reader.inputs().to_vec(), reader.outputs().to_vec());
        let mut input_data = vec![Vec::new(); inputs.len()];
        let mut output_data = vec![Vec::new(); outputs.len()];
        let mut block = Block::new();
        while reader.next_block(&mut block)? {
            for (column, more) in input_data
                .iter_mut()
                .chain(&mut output_data)
                .zip(&block.columns)
            {
                column.extend_from_slice(more);
            }
            check_memory(&reader)?;
        }
        let summary = reader.finish()?;
        Ok(Self {
            name: summary.name,
            sample_time: summary.sample_time,
            start_time: summary.start_time,
            inputs,
            outputs,
            input_data,
            output_data,
            sha256: Some(summary.sha256),
        })
    }

    /// A recording made of columns in memory; it starts at time 0. Either side may have no channels.
    ///
    /// # Errors
    /// Columns that differ in length, that are not as many as the channels, or that hold NaN or infinities; no sample
    /// at all; a sample time that is not positive.
    pub fn from_columns(
        name: &str,
        sample_time: f64,
        inputs: Vec<Channel>,
        outputs: Vec<Channel>,
        input_data: Vec<Vec<f64>>,
        output_data: Vec<Vec<f64>>,
    ) -> Result<Self, LogError> {
        let (channels, data) = ((inputs, outputs), (input_data, output_data));
        Self::of_columns(name, sample_time, channels, data, false)
    }

    /// As [`Log::from_columns`] where outputs may be NaN: not measured. Plants in equations are compared with the others.
    ///
    /// # Errors
    /// As [`Log::from_columns`], but for outputs that are NaN.
    pub fn with_missing_outputs(
        name: &str,
        sample_time: f64,
        channels: (Vec<Channel>, Vec<Channel>),
        data: (Vec<Vec<f64>>, Vec<Vec<f64>>),
    ) -> Result<Self, LogError> {
        Self::of_columns(name, sample_time, channels, data, true)
    }

    fn of_columns(
        name: &str,
        sample_time: f64,
        (inputs, outputs): (Vec<Channel>, Vec<Channel>),
        (input_data, output_data): (Vec<Vec<f64>>, Vec<Vec<f64>>),
        outputs_may_be_missing: bool,
    ) -> Result<Self, LogError> {
        let log = Self {
            name: name.to_owned(),
            sample_time,
            start_time: 0.0,
            inputs,
            outputs,
            input_data,
            output_data,
            sha256: None,
        };
        log.check_values(outputs_may_be_missing)?;
        Ok(log)
    }

    /// Whether this is a recording: its fields are open to be changed.
    ///
    /// # Errors
    /// As [`Log::from_columns`].
    pub fn check(&self) -> Result<(), LogError> {
        self.check_values(false)
    }

    /// The same of a recording whose outputs may be NaN where they were not measured.
    pub(super) fn check_but_missing_outputs(&self) -> Result<(), LogError> {
        self.check_values(true)
    }

    fn check_values(&self, outputs_may_be_missing: bool) -> Result<(), LogError> {
        let sample_time = self.sample_time;
        if !is_sample_time(sample_time) {
            return Err(LogError::InvalidSampleTime { sample_time });
        }
        for (role, channels, data) in [
            ("input", &self.inputs, &self.input_data),
            ("output", &self.outputs, &self.output_data),
        ] {
            let (expected, found) = (channels.len(), data.len());
            if expected != found {
                return Err(LogError::ColumnCount {
                    name: self.name.clone(),
                    role,
                    expected,
                    found,
                });
            }
        }
        let expected = self.samples();
        if expected == 0 {
            return Err(LogError::too_short(&self.name, 0, 1, "a recording"));
        }
        for (index, (channel, data)) in self
            .inputs
            .iter()
            .chain(&self.outputs)
            .zip(self.channel_data())
            .enumerate()
        {
            let (name, column) = (self.name.clone(), channel.to_string());
            if data.len() != expected {
                return Err(LogError::ColumnLength {
                    name,
                    column,
                    expected,
                    found: data.len(),
                });
            }
            let may_be_missing = outputs_may_be_missing && index >= self.inputs.len();
            let is_value = |v: f64| v.is_finite() || v.is_nan() && may_be_missing;
            let stray = data.iter().enumerate().find(|(_, v)| !is_value(**v));
            if let Some((sample, value)) = stray {
                return Err(LogError::ColumnNotFinite {
                    name,
                    column,
                    sample,
                    value: *value,
                });
            }
        }
        Ok(())
    }

    /// Number of samples N.
    pub fn samples(&self) -> usize {
        self.input_data
            .first()
            .or(self.output_data.first())
            .map_or(0, Vec::len)
    }

    /// The samples before `at` (from 0) and those from `at` on, such as one part to identify and one to validate with.
    /// Both keep the file's hash; their names say which samples they are.
    ///
    /// # Errors
    /// One part would be empty.
    pub fn split_at(&self, at: usize) -> Result<(Self, Self), LogError> {
        let samples = self.samples();
        if at == 0 || at >= samples {
            return Err(LogError::InvalidSplit {
                name: self.name.clone(),
                samples,
                at,
            });
        }
        let part = |from: usize, to: usize| {
            let cut = |data: &[Vec<f64>]| {
                data.iter()
                    .map(|c| c.get(from..to).unwrap_or_default().to_vec())
                    .collect()
            };
            Self {
                name: format!("{} [samples {from} to {}]", self.name, to - 1),
                start_time: self.start_time + from as f64 * self.sample_time,
                sample_time: self.sample_time,
                inputs: self.inputs.clone(),
                outputs: self.outputs.clone(),
                input_data: cut(&self.input_data),
                output_data: cut(&self.output_data),
                sha256: self.sha256.clone(),
            }
        };
        Ok((part(0, at), part(at, samples)))
    }

    /// Whether `other` can be identified together with this recording: the same channels and units in the same order
    /// and the same sample time to 0.1 %.
    ///
    /// # Errors
    /// Says what differs, `other` being the one at fault.
    pub(crate) fn check_same_kind(&self, other: &Self) -> Result<(), LogError> {
        self.check_same_channels(other)?;
        check_same_sampling(&self.name, self.sample_time, &other.name, other.sample_time)
    }

    /// Whether `other` has the same channels and units in the same order.
    ///
    /// # Errors
    /// Says what differs, `other` being the one at fault.
    pub(crate) fn check_same_channels(&self, other: &Self) -> Result<(), LogError> {
        check_same_channels(
            &self.name,
            &self.inputs,
            &other.name,
            &other.inputs,
            "inputs",
        )?;
        check_same_channels(
            &self.name,
            &self.outputs,
            &other.name,
            &other.outputs,
            "outputs",
        )
    }

    /// Writes time, inputs and outputs as CSV to `path` (`-` is standard output, `.gz` compresses); the numbers are
    /// read back exactly.
    ///
    /// # Errors
    /// The file cannot be written; one that was there before stays as it was.
    pub fn write_csv(&self, path: &Path) -> Result<(), LogError> {
        let inputs = self
            .inputs
            .iter()
            .zip(self.input_data.iter().map(Vec::as_slice));
        let outputs = self
            .outputs
            .iter()
            .zip(self.output_data.iter().map(Vec::as_slice));
        write_table(
            path,
            self.sample_time,
            self.start_time,
            &inputs.chain(outputs).collect::<Vec<_>>(),
        )
    }
}
