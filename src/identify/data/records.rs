//! Where the samples come from: memory, or files that are streamed.

use super::reduced_records::ReducedRecords;
#[cfg(feature = "cli")]
use crate::identify::IdentifyError;
use crate::log::{
    Block, Channel, Log, LogError, LogReader, LogSummary, Reading, RoleNeed, Roles, Source,
    check_same_channels, check_same_sampling,
};

/// Values kept in memory from the beginning of a recording that is streamed (32 MiB): the residual tests
/// and, if need be, the panel factorisation read them again. Whatever is beyond is read from the file
/// again.
const KEPT_VALUES: usize = 4 << 20;

/// Name, hash and size of one recording.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
pub struct Recording {
    /// File name.
    pub name: String,
    /// SHA-256 of the file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sha256: Option<String>,
    /// Number of samples.
    pub samples: usize,
    /// Time of the first sample in seconds.
    pub start_time: f64,
    /// Date and time at second zero, when the time column has dates.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub origin: Option<String>,
    /// What was recognised and repaired when the file was read; nothing for a plain file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reading: Option<String>,
}

impl Recording {
    /// A log as it is, and what is known of how it was read.
    pub fn of_log(log: &Log, of: Option<&Reading>) -> Self {
        Self {
            name: log.name.clone(),
            sha256: log.sha256.clone(),
            samples: log.samples(),
            start_time: log.start_time,
            origin: of.and_then(|reading| Some(reading.origin?.to_string())),
            reading: of.and_then(|reading| reading.said.clone()),
        }
    }
}

/// Recordings of one plant that can be read more than once.
///
/// Sample time and recordings are known after [`Records::read`] went through every experiment.
pub trait Records {
    /// Number of experiments.
    fn experiments(&self) -> usize;
    /// Input channels.
    fn inputs(&self) -> &[Channel];
    /// Output channels.
    fn outputs(&self) -> &[Channel];
    /// Sample time in seconds.
    fn sample_time(&self) -> f64;
    /// What was read.
    fn recordings(&self) -> Vec<Recording>;
    /// Samples of the experiment that a second reading gets without reading a file again.
    fn kept_samples(&self, experiment: usize) -> usize;
    /// The recordings as moments, where nothing else is left of them: [`Records::read`] then gives only what
    /// [`Records::kept_samples`] says.
    fn reduced(&self) -> Option<&ReducedRecords> {
        None
    }
    /// Streams one experiment: blocks of columns, inputs then outputs. A `limit` ends a second reading
    /// after so many samples; the first reading is always whole.
    ///
    /// # Errors
    /// [`LogError`] naming file, line and column.
    fn read(
        &mut self,
        experiment: usize,
        limit: Option<usize>,
        sink: &mut dyn FnMut(&[&[f64]]),
    ) -> Result<(), LogError>;
}

/// Recordings in memory.
#[derive(Debug)]
pub struct MemoryRecords<'a> {
    logs: &'a [Log],
    recordings: Vec<Recording>,
}

impl<'a> MemoryRecords<'a> {
    /// Several experiments of one plant.
    ///
    /// # Errors
    /// [`LogError`] when there is no experiment, one is no recording ([`Log::check`]), or they differ in channels or
    /// sampling.
    pub fn new(logs: &'a [Log]) -> Result<Self, LogError> {
        let Some(first) = logs.first() else {
            return Err(LogError::too_short("the recording", 0, 1, "identification"));
        };
        logs.iter().try_for_each(Log::check)?;
        for other in &logs[1..] {
            first.check_same_kind(other)?;
        }
        let recordings = logs
            .iter()
            .map(|log| Recording::of_log(log, None))
            .collect();
        Ok(Self { logs, recordings })
    }

    #[cfg(feature = "cli")]
    /// With what is known of the recordings beside their samples, one a log.
    fn with_recordings(self, recordings: Vec<Recording>) -> Self {
        Self { recordings, ..self }
    }
}

#[cfg(feature = "cli")]
/// Runs `work` on recordings that are streamed from files; where a file is not plain, again on what [`Reading`] makes of
/// them in memory. With the result come the recordings that were not plain, as they were read.
///
/// # Errors
/// What is wrong with a file, or what `work` says.
pub(crate) fn on_files<T>(
    sources: &[Source],
    roles: &Roles,
    progress: Option<ReadProgress<'_>>,
    work: &mut dyn FnMut(&mut dyn Records) -> Result<T, IdentifyError>,
) -> Result<(T, Vec<(String, String)>), IdentifyError> {
    if roles.resample.is_none() {
        let opened = FileRecords::open(sources.to_vec(), roles.clone());
        let done = opened.map_err(IdentifyError::from).and_then(|mut records| {
            if let Some(progress) = progress {
                records = records.with_progress(progress);
            }
            work(&mut records)
        });
        match done {
            Err(IdentifyError::Log(error))
                if error.is_of_content() && sources.iter().all(Source::can_be_reopened) => {}
            done => return Ok((done?, Vec::new())),
        }
    }
    let (mut logs, mut recordings, mut said) = (Vec::new(), Vec::new(), Vec::new());
    for source in sources {
        let reading = Reading::read(source, roles, RoleNeed::Identify)?;
        if let Some(text) = &reading.said {
            said.push((source.to_string(), text.clone()));
        }
        recordings.extend(
            reading
                .logs
                .iter()
                .map(|log| Recording::of_log(log, Some(&reading))),
        );
        logs.extend(reading.logs);
    }
    let mut records = MemoryRecords::new(&logs)?.with_recordings(recordings);
    Ok((work(&mut records)?, said))
}

impl Records for MemoryRecords<'_> {
    fn experiments(&self) -> usize {
        self.logs.len()
    }

    fn inputs(&self) -> &[Channel] {
        &self.logs[0].inputs
    }

    fn outputs(&self) -> &[Channel] {
        &self.logs[0].outputs
    }

    fn sample_time(&self) -> f64 {
        self.logs[0].sample_time
    }

    fn recordings(&self) -> Vec<Recording> {
        self.recordings.clone()
    }

    fn kept_samples(&self, experiment: usize) -> usize {
        self.logs[experiment].samples()
    }

    fn read(
        &mut self,
        experiment: usize,
        limit: Option<usize>,
        sink: &mut dyn FnMut(&[&[f64]]),
    ) -> Result<(), LogError> {
        let log = &self.logs[experiment];
        let samples = limit.unwrap_or(usize::MAX).min(log.samples());
        let columns: Vec<&[f64]> = log
            .input_data
            .iter()
            .chain(&log.output_data)
            .map(|column| &column[..samples])
            .collect();
        sink(&columns);
        Ok(())
    }
}

/// Called while a file is read: bytes read so far in all files, total if known.
pub type ReadProgress<'a> = Box<dyn FnMut(u64, Option<u64>) + 'a>;

/// Recordings that are streamed from files in constant memory.
pub struct FileRecords<'a> {
    sources: Vec<Source>,
    roles: Roles,
    first: Option<LogReader>,
    inputs: Vec<Channel>,
    outputs: Vec<Channel>,
    summaries: Vec<Option<LogSummary>>,
    kept: Vec<Vec<Vec<f64>>>,
    kept_values: usize,
    progress: Option<ReadProgress<'a>>,
}

impl std::fmt::Debug for FileRecords<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FileRecords")
            .field("sources", &self.sources)
            .finish_non_exhaustive()
    }
}

impl<'a> FileRecords<'a> {
    /// Opens the first recording, so that its channels are known and a wrong role is found at once.
    ///
    /// # Errors
    /// [`LogError`] when there is no source, it cannot be opened, or the roles do not fit.
    pub fn open(sources: Vec<Source>, roles: Roles) -> Result<Self, LogError> {
        let Some(source) = sources.first() else {
            return Err(LogError::too_short("the recording", 0, 1, "identification"));
        };
        let first = LogReader::open(source, &roles, RoleNeed::Identify)?;
        Ok(Self {
            inputs: first.inputs().to_vec(),
            outputs: first.outputs().to_vec(),
            summaries: vec![None; sources.len()],
            kept: vec![Vec::new(); sources.len()],
            kept_values: KEPT_VALUES,
            first: Some(first),
            sources,
            roles,
            progress: None,
        })
    }

    /// Reports progress while reading.
    #[must_use]
    pub fn with_progress(mut self, progress: ReadProgress<'a>) -> Self {
        self.progress = Some(progress);
        self
    }

    fn reader(&mut self, experiment: usize) -> Result<LogReader, LogError> {
        if experiment == 0
            && let Some(first) = self.first.take()
        {
            return Ok(first);
        }
        let reader = LogReader::open(&self.sources[experiment], &self.roles, RoleNeed::Identify)?;
        let first = self.sources[0].to_string();
        check_same_channels(
            &first,
            &self.inputs,
            reader.name(),
            reader.inputs(),
            "inputs",
        )?;
        check_same_channels(
            &first,
            &self.outputs,
            reader.name(),
            reader.outputs(),
            "outputs",
        )?;
        Ok(reader)
    }
}

impl Records for FileRecords<'_> {
    fn experiments(&self) -> usize {
        self.sources.len()
    }

    fn inputs(&self) -> &[Channel] {
        &self.inputs
    }

    fn outputs(&self) -> &[Channel] {
        &self.outputs
    }

    fn sample_time(&self) -> f64 {
        self.summaries
            .iter()
            .flatten()
            .next()
            .map_or(f64::NAN, |s| s.sample_time)
    }

    fn recordings(&self) -> Vec<Recording> {
        self.summaries
            .iter()
            .flatten()
            .map(|s| Recording {
                name: s.name.clone(),
                sha256: Some(s.sha256.clone()),
                samples: s.samples,
                start_time: s.start_time,
                origin: None,
                reading: None,
            })
            .collect()
    }

    fn kept_samples(&self, experiment: usize) -> usize {
        self.kept[experiment].first().map_or(0, Vec::len)
    }

    fn read(
        &mut self,
        experiment: usize,
        limit: Option<usize>,
        sink: &mut dyn FnMut(&[&[f64]]),
    ) -> Result<(), LogError> {
        let known = self.summaries[experiment].as_ref().map(|s| s.samples);
        if let Some(samples) = known {
            let mut wanted = limit.unwrap_or(usize::MAX).min(samples);
            if !self.sources[experiment].can_be_read_again() {
                let name = || self.sources[experiment].to_string();
                match limit {
                    // As much as there is left.
                    Some(_) => wanted = wanted.min(self.kept_samples(experiment)),
                    None if self.kept_samples(experiment) < wanted => {
                        return Err(LogError::ReadOnce { name: name() });
                    }
                    None => {}
                }
            }
            if self.kept_samples(experiment) >= wanted {
                let columns: Vec<&[f64]> = self.kept[experiment]
                    .iter()
                    .map(|column| &column[..wanted])
                    .collect();
                sink(&columns);
                return Ok(());
            }
        }
        let mut reader = self.reader(experiment)?;
        let first_time = known.is_none();
        let channels = self.inputs.len() + self.outputs.len();
        if first_time {
            self.kept[experiment] = vec![Vec::new(); channels];
        }
        // A file that has grown since is read as far as the first time.
        let wanted = known.map_or(usize::MAX, |samples| limit.unwrap_or(samples).min(samples));
        let mut left = wanted;
        let mut block = Block::new();
        while left > 0 && reader.next_block(&mut block)? {
            let take = block.len().min(left);
            left -= take;
            let columns: Vec<&[f64]> = block.columns.iter().map(|c| &c[..take]).collect();
            if first_time {
                let keep = (self.kept_values / channels.max(1)).min(take);
                for (kept, column) in self.kept[experiment].iter_mut().zip(&columns) {
                    kept.extend_from_slice(&column[..keep]);
                }
                self.kept_values -= keep * channels;
                if let Some(progress) = &mut self.progress {
                    progress(reader.bytes_read(), reader.bytes_total());
                }
            }
            sink(&columns);
        }
        if first_time {
            let summary = reader.finish()?;
            if let Some(other) = self.summaries.iter().flatten().next() {
                check_same_sampling(
                    &other.name,
                    other.sample_time,
                    &summary.name,
                    summary.sample_time,
                )?;
            }
            self.summaries[experiment] = Some(summary);
        } else if left > 0 {
            return Err(LogError::Changed {
                name: reader.name().to_owned(),
                expected: wanted,
                found: wanted - left,
            });
        }
        Ok(())
    }
}

impl Records for ReducedRecords {
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
            .map(|e| Recording {
                name: e.name.clone(),
                sha256: None,
                samples: e.samples,
                start_time: e.start_time,
                origin: None,
                reading: None,
            })
            .collect()
    }

    fn kept_samples(&self, experiment: usize) -> usize {
        self.experiments[experiment].beginning[0].len()
    }

    fn reduced(&self) -> Option<&ReducedRecords> {
        Some(self)
    }

    /// Only the beginning is left to be read.
    fn read(
        &mut self,
        experiment: usize,
        limit: Option<usize>,
        sink: &mut dyn FnMut(&[&[f64]]),
    ) -> Result<(), LogError> {
        let samples = limit
            .unwrap_or(usize::MAX)
            .min(self.kept_samples(experiment));
        let columns: Vec<&[f64]> = self.experiments[experiment]
            .beginning
            .iter()
            .map(|column| &column[..samples])
            .collect();
        sink(&columns);
        Ok(())
    }
}
