//! A recording as a stream of column-major blocks.

use std::io::Read;

use crate::log::LogError;
use crate::log::roles::{RoleNeed, Roles, assign};
use crate::log::text::{Channel, Header, Lines, RowParser, Source, Stream};
use crate::log::time::{Sampling, first_look, time_base};

/// Rows in a block; only the last of a recording has fewer.
pub(crate) const BLOCK_ROWS: usize = 16_384;

/// How far the sample times of experiments identified together may differ, relative to the first's.
const SAME_SAMPLING: f64 = 1e-3;

/// Some rows of a recording, a column a channel: the inputs first, then the outputs, each in the order asked for.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Block {
    /// `columns[channel][sample]`, all of one length.
    pub columns: Vec<Vec<f64>>,
}

impl Block {
    /// An empty block; [`LogReader::next_block`] gives it its columns.
    pub fn new() -> Self {
        Self::default()
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.columns.first().map_or(0, Vec::len)
    }

    /// Whether there are no samples.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// What is known of a recording once it has been read to its end.
#[derive(Debug, Clone, PartialEq)]
pub struct LogSummary {
    /// Display name of the source.
    pub name: String,
    /// SHA-256 of the raw bytes (before decompression), hexadecimal.
    pub sha256: String,
    /// Number of raw bytes.
    pub bytes: u64,
    /// Number of samples N.
    pub samples: usize,
    /// Sample time in seconds: as asked for, or (last - first) / (N - 1) of the time column.
    pub sample_time: f64,
    /// First time stamp in seconds; 0 when the time column is not read.
    pub start_time: f64,
}

/// Reads a recording block by block, in memory that does not grow with it.
#[derive(Debug)]
pub struct LogReader {
    lines: Lines,
    parser: RowParser,
    inputs: Vec<Channel>,
    outputs: Vec<Channel>,
    /// `None` when the sample time is given.
    sampling: Option<Sampling>,
    sample_time: Option<f64>,
    times: Vec<f64>,
    samples: usize,
    done: bool,
}

impl LogReader {
    /// Opens `source`, reads its header and finds the columns.
    ///
    /// # Errors
    /// The source cannot be opened, is empty or is not text, or the columns that `need` calls for are not there.
    pub fn open(source: &Source, roles: &Roles, need: RoleNeed) -> Result<Self, LogError> {
        Self::start(Lines::new(source.to_string(), source.open()?), roles, need)
    }

    /// As [`LogReader::open`], of bytes from anywhere; `name` stands for the file in messages. Gzip data are noticed.
    ///
    /// # Errors
    /// As [`LogReader::open`].
    pub fn from_reader(
        name: &str,
        reader: impl Read + Send + 'static,
        roles: &Roles,
        need: RoleNeed,
    ) -> Result<Self, LogError> {
        let stream =
            Stream::new(Box::new(reader), false, None).map_err(|source| LogError::Open {
                name: name.to_owned(),
                source,
            })?;
        Self::start(Lines::new(name.to_owned(), stream), roles, need)
    }

    fn start(mut lines: Lines, roles: &Roles, need: RoleNeed) -> Result<Self, LogError> {
        // As in next_block: what is no text may be what damage left of it.
        let header = Header::read(&mut lines).map_err(|error| lines.damage().unwrap_or(error));
        let header = header?;
        let assigned = assign(roles, need, &header)?;
        if let Some(index) = assigned.time {
            first_look(&header, index, lines.chunk()?.0, roles)?;
        }
        let mut slots = vec![None; header.channels.len()];
        let channels = assigned.inputs.iter().chain(&assigned.outputs);
        for (slot, column) in channels
            .chain(assigned.time.iter().filter(|_| roles.sample_time.is_none()))
            .enumerate()
        {
            if let Some(place) = slots.get_mut(*column) {
                *place = Some(slot);
            }
        }
        let named = |columns: &[usize]| {
            columns
                .iter()
                .filter_map(|c| header.channels.get(*c).cloned())
                .collect()
        };
        let (inputs, outputs) = (named(&assigned.inputs), named(&assigned.outputs));
        let stamped = assigned.time.filter(|_| roles.sample_time.is_none());
        let sampling = stamped
            .map(|index| time_base(&header, index, lines.next_line(), roles.time_unit))
            .transpose()?;
        Ok(Self {
            lines,
            parser: RowParser::new(header, slots, stamped),
            inputs,
            outputs,
            sampling,
            sample_time: roles.sample_time,
            times: Vec::new(),
            samples: 0,
            done: false,
        })
    }

    /// Display name of the source.
    pub fn name(&self) -> &str {
        self.lines.name()
    }

    /// Input channels, in the order of the first columns of a block.
    pub fn inputs(&self) -> &[Channel] {
        &self.inputs
    }

    /// Output channels, in the order of the last columns of a block.
    pub fn outputs(&self) -> &[Channel] {
        &self.outputs
    }

    /// Samples read so far.
    pub fn samples(&self) -> usize {
        self.samples
    }

    /// Raw bytes read so far, for a progress bar.
    pub(crate) fn bytes_read(&self) -> u64 {
        self.lines.stream().bytes_read()
    }

    /// Raw bytes in all, when the source is a file.
    pub(crate) fn bytes_total(&self) -> Option<u64> {
        self.lines.stream().bytes_total()
    }

    /// Clears `block` and fills it with the next `BLOCK_ROWS` samples, or those that are left; `false` when none is.
    ///
    /// # Errors
    /// A row that is not as it should be, or a time base that is not uniform; after an error, the reader is at its end.
    pub fn next_block(&mut self, block: &mut Block) -> Result<bool, LogError> {
        let result = self.fill(block);
        result.map_err(|error| {
            self.done = true;
            block.columns.iter_mut().for_each(Vec::clear);
            // Damaged gzip data show as damaged rows before their checksum comes: tell the cause, not the symptom.
            self.lines.damage().unwrap_or(error)
        })
    }

    fn fill(&mut self, block: &mut Block) -> Result<bool, LogError> {
        block
            .columns
            .resize_with(self.inputs.len() + self.outputs.len(), Vec::new);
        if self.done {
            block.columns.iter_mut().for_each(Vec::clear);
            return Ok(false);
        }
        // The time stamps are the last slot for the length of this call.
        block.columns.push(std::mem::take(&mut self.times));
        let (rows, parsed) = self.parse_rows(&mut block.columns);
        block
            .columns
            .iter_mut()
            .for_each(|column| column.truncate(rows));
        self.times = block.columns.pop().unwrap_or_default();
        // Time stamps before a faulty row come first in the file, so what is wrong with them is said first.
        if let Some(sampling) = &mut self.sampling {
            sampling.push(self.parser.header(), &self.times)?;
        }
        parsed?;
        self.samples += rows;
        if rows < BLOCK_ROWS {
            self.done = true;
            self.check_end()?;
        }
        Ok(rows > 0)
    }

    /// Parses until the columns are full or the file ends: the number of rows, and the error that stopped it.
    fn parse_rows(&mut self, columns: &mut [Vec<f64>]) -> (usize, Result<(), LogError>) {
        let mut rows = 0;
        while rows < BLOCK_ROWS {
            let line = self.lines.next_line();
            let (text, cut_off) = match self.lines.chunk() {
                Ok(([], _)) => break,
                Ok(chunk) => chunk,
                Err(error) => return (rows, Err(error)),
            };
            // Room for what the text can hold, so that a file of many columns and few rows takes little memory.
            let room = BLOCK_ROWS.min(rows + text.len() / self.parser.shortest_row() + 1);
            for column in columns.iter_mut().filter(|column| column.len() < room) {
                column.resize(room, 0.0);
            }
            let (done, result) = self.parser.parse(text, line, cut_off, columns, rows..room);
            rows += done.rows;
            self.lines.consume(done.bytes, done.lines);
            if result.is_err() {
                return (rows, result);
            }
        }
        (rows, Ok(()))
    }

    fn check_end(&self) -> Result<(), LogError> {
        let header = self.parser.header();
        if self.samples == 0 {
            return Err(LogError::NoData {
                name: header.name.clone(),
                line: header.line,
            });
        }
        self.sampling
            .as_ref()
            .map_or(Ok(()), |sampling| sampling.finish(header).map(|_| ()))
    }

    /// Reads what is left, checking it, and says what the recording was.
    ///
    /// # Errors
    /// As [`LogReader::next_block`]. After one of its errors, the summary is of what came before.
    pub fn finish(mut self) -> Result<LogSummary, LogError> {
        let mut block = Block::new();
        while self.next_block(&mut block)? {}
        if let Some(expected) = self.bytes_total()
            && self.bytes_read() < expected
        {
            return Err(LogError::Shrunk {
                name: self.name().to_owned(),
                expected,
                found: self.bytes_read(),
            });
        }
        let (sample_time, start_time) = match (&self.sampling, self.sample_time) {
            (Some(sampling), _) => sampling.finish(self.parser.header())?,
            (None, given) => (given.unwrap_or(f64::NAN), 0.0),
        };
        let name = self.name().to_owned();
        let (sha256, bytes) = self.lines.into_stream().into_digest();
        Ok(LogSummary {
            name,
            sha256,
            bytes,
            samples: self.samples,
            sample_time,
            start_time,
        })
    }
}

/// Whether an experiment called `name` has the channels `found` where the one called `first` has `expected`, in the
/// same order; `role` is `"inputs"` or `"outputs"`. A unit that is missing agrees with any.
///
/// # Errors
/// The names or the units differ.
pub(crate) fn check_same_channels(
    first: &str,
    expected: &[Channel],
    name: &str,
    found: &[Channel],
    role: &'static str,
) -> Result<(), LogError> {
    let names = |channels: &[Channel]| {
        channels
            .iter()
            .map(|c| format!("`{}`", c.name))
            .collect::<Vec<_>>()
            .join(", ")
    };
    if expected.len() != found.len() || expected.iter().zip(found).any(|(a, b)| a.name != b.name) {
        return Err(LogError::DifferentChannels {
            name: name.to_owned(),
            role,
            found: names(found),
            first: first.into(),
            expected: names(expected).into(),
        });
    }
    match expected.iter().zip(found).find(|(a, b)| !a.unit_agrees(b)) {
        None => Ok(()),
        Some((a, b)) => Err(LogError::DifferentUnits {
            name: name.to_owned(),
            column: b.name.clone(),
            found: b.unit.clone().unwrap_or_default().into(),
            first: first.into(),
            expected: a.unit.clone().unwrap_or_default().into(),
        }),
    }
}

/// Whether an experiment called `name` has the sample time of the one called `first`, to 0.1 %.
///
/// # Errors
/// The sample times (seconds) differ by more.
pub(crate) fn check_same_sampling(
    first: &str,
    expected: f64,
    name: &str,
    found: f64,
) -> Result<(), LogError> {
    if (found - expected).abs() <= SAME_SAMPLING * expected {
        return Ok(());
    }
    Err(LogError::DifferentSampling {
        name: name.to_owned(),
        found,
        first: first.to_owned(),
        expected,
    })
}
