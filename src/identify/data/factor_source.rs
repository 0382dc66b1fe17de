//! What a method may ask of the recordings: data factors of any window, and the signals themselves.

use std::sync::Arc;

use super::delay::AlignedColumns;
use super::memory_need::Sizes;
use super::recording_moments::Data;
use super::records::Records;
use crate::identify::IdentifyError;
use crate::moments::{RFactor, Trend};

/// The recordings behind an identification. Factors come from moments that are already in memory, so asking for
/// one costs no reading (unless the moments are too ill-conditioned, see [`RFactor`]), and each is made once.
pub(crate) struct Source<'a> {
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
    pub(crate) fn new(data: &'a Data, records: &'a mut dyn Records) -> Self {
        Self {
            data,
            records,
            factors: Vec::new(),
        }
    }

    /// Names of the outputs.
    pub(crate) fn output_names(&self) -> Vec<String> {
        let outputs = self.records.outputs();
        outputs.iter().map(|channel| channel.name.clone()).collect()
    }

    /// What is known of the sizes of an identification: channels and lags.
    pub(crate) fn sizes(&self) -> Sizes {
        Sizes {
            inputs: self.records.inputs().len(),
            outputs: self.records.outputs().len(),
            past: None,
            lags: self.data.lags(),
            order: None,
        }
    }

    /// The triangular factor of all windows of `past + 1` samples. `past` is at most the number of lags that the
    /// method announced ([`Method::lags`](crate::identify::Method::lags)).
    ///
    /// # Errors
    /// [`IdentifyError::TooShort`] when no window fits into the recordings, or when reading again fails.
    pub(crate) fn factor(&mut self, past: usize) -> Result<Arc<RFactor>, IdentifyError> {
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
    pub(crate) fn factors_without_blocks(&self, past: usize) -> Vec<RFactor> {
        self.data.factors_without_blocks(past)
    }

    /// Samples of all experiments.
    pub(crate) fn samples(&self) -> usize {
        self.data.samples
    }

    /// Number of experiments.
    pub(crate) fn experiments(&self) -> usize {
        self.records.experiments()
    }

    /// Divisor of each channel in the factors, inputs then outputs.
    pub(crate) fn scale(&self) -> &[f64] {
        &self.data.scale
    }

    /// Sample time in seconds.
    pub(crate) fn sample_time(&self) -> f64 {
        self.records.sample_time()
    }

    /// The samples of one experiment as the factors see them: inputs aligned, trend removed, scaled; one column a
    /// channel, inputs then outputs. Holds the whole experiment in memory: only for methods that need every sample.
    ///
    /// # Errors
    /// When reading fails, or when only moments are left.
    pub(crate) fn signals(&mut self, experiment: usize) -> Result<Vec<Vec<f64>>, IdentifyError> {
        if self.records.reduced().is_some() {
            return Err(IdentifyError::MomentsOnly {
                reason: "this method looks at every sample",
            });
        }
        self.scaled(experiment, None)
    }

    /// The first of these samples, at most `limit` and at most what is still in memory.
    ///
    /// # Errors
    /// When reading fails.
    pub(crate) fn first_signals(
        &mut self,
        experiment: usize,
        limit: usize,
    ) -> Result<Vec<Vec<f64>>, IdentifyError> {
        let kept = self.records.kept_samples(experiment).max(1);
        self.scaled(experiment, Some(kept.min(limit)))
    }

    fn scaled(
        &mut self,
        experiment: usize,
        limit: Option<usize>,
    ) -> Result<Vec<Vec<f64>>, IdentifyError> {
        let trend = self.data.trend(experiment);
        let delays = self.data.delays();
        let mut columns = deviations(self.records, experiment, delays, trend, limit)?;
        for (column, scale) in columns.iter_mut().zip(&self.data.scale) {
            for value in column {
                *value /= scale;
            }
        }
        Ok(columns)
    }
}

/// The first samples of an experiment (all without a limit) as deviations from a trend, inputs aligned; one column a
/// channel, inputs then outputs.
///
/// # Errors
/// When reading fails.
pub(crate) fn deviations(
    records: &mut dyn Records,
    experiment: usize,
    delays: &[usize],
    trend: &Trend,
    limit: Option<usize>,
) -> Result<Vec<Vec<f64>>, IdentifyError> {
    let mut aligned = AlignedColumns::new(delays, records.outputs().len());
    records.read(experiment, limit, &mut |block| aligned.push(block))?;
    let mut columns = aligned.columns;
    trend.remove_from(&mut columns);
    Ok(columns)
}
