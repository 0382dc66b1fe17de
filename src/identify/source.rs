//! What a method may ask of the recordings: data factors of any window, and the signals themselves.

use std::sync::Arc;

use super::data::Data;
use super::delay::Aligner;
use super::error::IdentifyError;
use super::records::Records;
use crate::moments::RFactor;

/// The recordings behind an identification. Factors come from moments that are already in memory, so asking for
/// one costs no reading (unless the moments are too ill-conditioned, see [`RFactor`]), and each is made once.
pub struct Source<'a> {
    data: &'a Data,
    records: &'a mut dyn Records,
    factors: Vec<Arc<RFactor>>,
}

impl std::fmt::Debug for Source<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Source")
            .field("factors", &self.factors.len())
            .finish_non_exhaustive()
    }
}

impl<'a> Source<'a> {
    /// The moments of the recordings, with the recordings.
    pub(super) fn new(data: &'a Data, records: &'a mut dyn Records) -> Self {
        Self {
            data,
            records,
            factors: Vec::new(),
        }
    }

    /// The moments and the recordings.
    pub(super) fn parts(&mut self) -> (&'a Data, &mut dyn Records) {
        (self.data, self.records)
    }

    /// The triangular factor of all windows of `past + 1` samples. `past` is at most the number of lags that the
    /// method announced ([`Method::lags`](super::Method::lags)).
    ///
    /// # Errors
    /// [`IdentifyError::TooShort`] when no window fits into the recordings, or when reading again fails.
    pub fn factor(&mut self, past: usize) -> Result<Arc<RFactor>, IdentifyError> {
        if let Some(known) = self.factors.iter().find(|f| f.past == past) {
            return Ok(Arc::clone(known));
        }
        let samples = self.data.samples;
        if samples <= past || past > self.data.lags() {
            let (q, inputs) = (self.data.channels(), self.records.inputs().len());
            return Err(IdentifyError::TooShort {
                samples,
                past,
                needed: past * (q + 1) + q - inputs + 1,
            });
        }
        let made = Arc::new(self.data.factor(self.records, past)?);
        self.factors.push(Arc::clone(&made));
        Ok(made)
    }

    /// The factors of all data but one block, for each block of the jackknife.
    pub fn factors_without_blocks(&self, past: usize) -> Vec<RFactor> {
        self.data.factors_without_blocks(past)
    }

    /// Number of experiments.
    pub fn experiments(&self) -> usize {
        self.records.experiments()
    }

    /// Divisor of each channel in the factors, inputs then outputs.
    pub fn scale(&self) -> &[f64] {
        &self.data.scale
    }

    /// Sample time in seconds.
    pub fn sample_time(&self) -> f64 {
        self.records.sample_time()
    }

    /// The samples of one experiment as the factors see them: inputs aligned, trend removed, scaled; one column a
    /// channel, inputs then outputs. Holds the whole experiment in memory: only for methods that need every sample.
    ///
    /// # Errors
    /// When reading fails, or when only moments are left.
    pub fn signals(&mut self, experiment: usize) -> Result<Vec<Vec<f64>>, IdentifyError> {
        if self.records.reduced().is_some() {
            return Err(IdentifyError::MomentsOnly {
                reason: "this method looks at every sample",
            });
        }
        let channels = self.data.channels();
        let outputs = channels - self.records.inputs().len();
        let mut columns = vec![Vec::new(); channels];
        let mut aligner = Aligner::new(self.data.delays(), outputs);
        self.records.read(experiment, None, &mut |block| {
            aligner.push(block, &mut |block| {
                for (column, part) in columns.iter_mut().zip(block) {
                    column.extend_from_slice(part);
                }
            });
        })?;
        let trend = self.data.trend(experiment);
        for (c, column) in columns.iter_mut().enumerate() {
            for (k, value) in column.iter_mut().enumerate() {
                *value = (*value - trend.at(c, k)) / self.data.scale[c];
            }
        }
        Ok(columns)
    }
}
