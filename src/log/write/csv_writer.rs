//! Columns to CSV.

use std::io::{self, BufWriter, Write};
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;

use super::atomic::AtomicFile;
use crate::log::LogError;
use crate::log::sample_time::is_sample_time;
use crate::log::text::Channel;

enum Encoder {
    Plain(AtomicFile),
    Gzip(Box<GzEncoder<AtomicFile>>),
}

impl Encoder {
    fn file(&self) -> &AtomicFile {
        match self {
            Self::Plain(file) => file,
            Self::Gzip(encoder) => encoder.get_ref(),
        }
    }
}

impl Write for Encoder {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::Plain(file) => file.write(bytes),
            Self::Gzip(encoder) => encoder.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::Plain(file) => file.flush(),
            Self::Gzip(encoder) => encoder.flush(),
        }
    }
}

/// Writes a table block by block: time `t [s]` first, then a column a channel; numbers in the shortest form that is
/// read back exactly. The file takes its name in [`CsvWriter::finish`]; dropped before, it leaves nothing behind.
pub struct CsvWriter {
    output: BufWriter<Encoder>,
    sample_time: f64,
    start_time: f64,
    /// 1 / sample time, when that is a whole number and the division exact: k / 10 is 0.3 where 3 * 0.1 is not.
    rate: Option<f64>,
    /// Times of the rows, where they are not those of a grid.
    times: Option<Vec<f64>>,
    channels: Vec<String>,
    samples: usize,
}

impl CsvWriter {
    /// Starts a table at `path` (`-` is standard output, `.gz` compresses) and writes its header.
    ///
    /// # Errors
    /// A sample time (seconds) that is not positive; a place that cannot be written.
    pub fn create<'a>(
        path: &Path,
        sample_time: f64,
        start_time: f64,
        channels: impl IntoIterator<Item = &'a Channel>,
    ) -> Result<Self, LogError> {
        if !is_sample_time(sample_time) {
            return Err(LogError::InvalidSampleTime { sample_time });
        }
        let file = AtomicFile::create(path)?;
        let gzip = path
            .extension()
            .is_some_and(|extension| extension.eq_ignore_ascii_case("gz"));
        let encoder = if gzip {
            Encoder::Gzip(Box::new(GzEncoder::new(file, Compression::default())))
        } else {
            Encoder::Plain(file)
        };
        let rate = (1.0 / sample_time).round();
        let rate = (1.0 / rate == sample_time).then_some(rate);
        let channels = channels
            .into_iter()
            .map(|channel| quoted(&channel.to_string()))
            .collect();
        let output = BufWriter::with_capacity(256 * 1024, encoder);
        let mut writer = Self {
            output,
            sample_time,
            start_time,
            rate,
            times: None,
            channels,
            samples: 0,
        };
        writer
            .write_header()
            .map_err(|source| writer.failed(source))?;
        Ok(writer)
    }

    /// Appends samples: `columns[channel][sample]`, in the order of the channels.
    ///
    /// # Errors
    /// As many columns as channels are needed, all of one length; or the place cannot be written.
    pub fn write_block<C: AsRef<[f64]>>(&mut self, columns: &[C]) -> Result<(), LogError> {
        let name = || self.output.get_ref().file().path().display().to_string();
        let (expected, found) = (self.channels.len(), columns.len());
        if expected != found {
            return Err(LogError::ColumnCount {
                name: name(),
                role: "data",
                expected,
                found,
            });
        }
        let expected = columns.first().map_or(0, |column| column.as_ref().len());
        for (channel, column) in self.channels.iter().zip(columns) {
            let (column, found) = (channel.clone(), column.as_ref().len());
            if found != expected {
                return Err(LogError::ColumnLength {
                    name: name(),
                    column,
                    expected,
                    found,
                });
            }
        }
        self.write_rows(columns, expected)
            .map_err(|source| self.failed(source))
    }

    /// Completes the table and gives the file its name.
    ///
    /// # Errors
    /// The place cannot be written.
    pub fn finish(self) -> Result<(), LogError> {
        let path = self.output.get_ref().file().path().to_owned();
        let failed = |source| LogError::Write {
            path: path.clone(),
            source,
        };
        let file = match self
            .output
            .into_inner()
            .map_err(|error| failed(error.into_error()))?
        {
            Encoder::Plain(file) => file,
            Encoder::Gzip(encoder) => encoder.finish().map_err(failed)?,
        };
        file.commit()
    }

    fn write_header(&mut self) -> io::Result<()> {
        self.output.write_all(b"t [s]")?;
        for channel in &self.channels {
            write!(self.output, ",{channel}")?;
        }
        self.output.write_all(b"\n")
    }

    fn write_rows<C: AsRef<[f64]>>(&mut self, columns: &[C], rows: usize) -> io::Result<()> {
        for row in 0..rows {
            let sample = self.samples as f64;
            let since = self
                .rate
                .map_or(sample * self.sample_time, |rate| sample / rate);
            let given = (self.times.as_ref()).and_then(|times| times.get(self.samples));
            let time = given.copied().unwrap_or(self.start_time + since);
            write_number(&mut self.output, time)?;
            for column in columns {
                self.output.write_all(b",")?;
                write_number(
                    &mut self.output,
                    column.as_ref().get(row).copied().unwrap_or(f64::NAN),
                )?;
            }
            self.output.write_all(b"\n")?;
            self.samples += 1;
        }
        Ok(())
    }

    fn failed(&self, source: io::Error) -> LogError {
        LogError::Write {
            path: self.output.get_ref().file().path().to_owned(),
            source,
        }
    }
}

/// Writes a number in the shortest form that is read back exactly: 3 rather than 3.0, 1e-7 rather than 0.0000001.
fn write_number(output: &mut impl Write, value: f64) -> io::Result<()> {
    let size = value.abs();
    if size == 0.0 || (1e-5..1e16).contains(&size) {
        write!(output, "{value}")
    } else {
        write!(output, "{value:e}")
    }
}

/// A header in quotes where it would otherwise not be one field, or not the same one.
fn quoted(header: &str) -> String {
    let plain = !header.contains(['"', ',', ';', '\t', '\n', '\r', '#']) && header.trim() == header;
    if plain {
        header.to_owned()
    } else {
        format!(
            "\"{}\"",
            header.replace('"', "\"\"").replace(['\n', '\r'], " ")
        )
    }
}

/// Writes a table at once: see [`CsvWriter`].
///
/// # Errors
/// Columns that differ in length, a sample time (seconds) that is not positive, a place that cannot be written.
pub fn write_table(
    path: &Path,
    sample_time: f64,
    start_time: f64,
    columns: &[(&Channel, &[f64])],
) -> Result<(), LogError> {
    let mut writer = CsvWriter::create(
        path,
        sample_time,
        start_time,
        columns.iter().map(|(channel, _)| *channel),
    )?;
    writer.write_block(
        &columns
            .iter()
            .map(|(_, column)| *column)
            .collect::<Vec<_>>(),
    )?;
    writer.finish()
}

/// Writes a simulation on a grid (sample time and time of the first sample, in seconds); where that is another than the rows of its
/// input ([`Reading::rows`](super::super::Reading::rows), seconds), with a row for each of those, at its time: on a line between samples.
///
/// # Errors
/// As those of [`write_table`].
pub fn write_simulation(
    path: &Path,
    (sample_time, start_time): (f64, f64),
    rows: Option<&[f64]>,
    columns: &[(&Channel, &[f64])],
) -> Result<(), LogError> {
    let Some(times) = rows else {
        return write_table(path, sample_time, start_time, columns);
    };
    let channels = columns.iter().map(|(channel, _)| *channel);
    let mut writer = CsvWriter::create(path, sample_time, start_time, channels)?;
    writer.times = Some(times.to_vec());
    let of_rows =
        |(_, column): &(&Channel, &[f64])| at_times(column, start_time, sample_time, times);
    writer.write_block(&columns.iter().map(of_rows).collect::<Vec<_>>())?;
    writer.finish()
}

/// A column at other times than those of its grid: on a line between two samples, and as at the ends beyond them.
fn at_times(column: &[f64], start_time: f64, sample_time: f64, times: &[f64]) -> Vec<f64> {
    let last = column.len().saturating_sub(1);
    let value = |&time: &f64| {
        let place = ((time - start_time) / sample_time).clamp(0.0, last as f64);
        let before = place.floor() as usize;
        let [a, b] = [before, (before + 1).min(last)].map(|k| column.get(k).copied());
        let (a, b) = (a.unwrap_or(f64::NAN), b.unwrap_or(f64::NAN));
        a + (place - before as f64) * (b - a)
    };
    times.iter().map(value).collect()
}
