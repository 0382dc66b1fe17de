//! A recording however it is written: the plain reader first, and where that does not understand a file, the one that looks
//! at all of it.

use std::io::{Cursor, Read};

use super::log_error::LogError;
use super::read::{LogReader, Whole, whole};
use super::record::Log;
use super::roles::{Missing, RoleNeed, Roles};
use super::text::{Source, Stream};
use super::time::{
    FEW_ROWS, Filled, NEAR, Origin, Piece, Resampling, Rows, SHORTEST, Tally, check_sample_time,
    common_step, counted, fill, readable, time_grid,
};
use crate::limits;

/// What of a file is held in memory at once, in its size: bytes, text, rows and columns.
const COPIES: usize = 5;
/// Share of a channel from which on it is said that it may be logged at another rate.
const SLOWER: f64 = 0.2;

/// What a file holds.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// Recordings without gaps, one unless samples are missing; all of one sample time.
    pub logs: Vec<Log>,
    /// Date and time at second zero, when the time column has dates.
    pub origin: Option<Origin>,
    /// What was recognised and repaired, on one line; nothing of a plain file.
    pub said: Option<String>,
    /// Times of the rows of the file in seconds, where the one recording lies on another grid that was not asked for.
    pub rows: Option<Vec<f64>>,
}

impl Log {
    /// Reads a recording with at least one input and one output; [`Reading`] has what was recognised and repaired.
    ///
    /// # Errors
    /// Whatever is wrong with the file: see [`LogError`]; also that it is in several parts.
    pub fn read(source: &Source, roles: &Roles) -> Result<Self, LogError> {
        Self::read_with(source, roles, RoleNeed::Identify)
    }

    /// As [`Log::read`], with other roles needed.
    ///
    /// # Errors
    /// As [`Log::read`].
    pub fn read_with(source: &Source, roles: &Roles, need: RoleNeed) -> Result<Self, LogError> {
        Reading::read(source, roles, need)?.whole()
    }

    /// As [`Log::read`], of bytes in memory; `name` stands for the file in messages.
    ///
    /// # Errors
    /// As [`Log::read`].
    pub fn from_reader(
        name: &str,
        reader: impl Read + Send + 'static,
        roles: &Roles,
    ) -> Result<Self, LogError> {
        Reading::from_reader(name, reader, roles, RoleNeed::Identify)?.whole()
    }
}

impl Reading {
    /// Reads a file, or standard input.
    ///
    /// # Errors
    /// Whatever is wrong with the file: see [`LogError`].
    pub fn read(source: &Source, roles: &Roles, need: RoleNeed) -> Result<Self, LogError> {
        let name = source.to_string();
        let plain = if roles.resample.is_some() {
            None
        } else {
            match LogReader::open(source, roles, need).and_then(Log::of_plain) {
                Ok(log) => return Ok(Self::of_plain(log)),
                Err(error) if !error.is_of_content() => return Err(error),
                Err(error) if !source.can_be_reopened() => {
                    // Its dates or repairs cannot be looked at again.
                    return Err(if matches!(error, LogError::Dated { .. }) {
                        LogError::ReadOnce { name }
                    } else {
                        error
                    });
                }
                Err(error) => Some(error),
            }
        };
        Self::of_stream(&name, source.open()?, roles, need, plain)
    }

    /// As [`Reading::read`], of bytes from anywhere; `name` stands for the file in messages.
    ///
    /// # Errors
    /// As [`Reading::read`].
    pub fn from_reader(
        name: &str,
        mut reader: impl Read,
        roles: &Roles,
        need: RoleNeed,
    ) -> Result<Self, LogError> {
        let open = |source| LogError::Open {
            name: name.to_owned(),
            source,
        };
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).map_err(open)?;
        let plain = if roles.resample.is_some() {
            None
        } else {
            let again = Cursor::new(bytes.clone());
            match LogReader::from_reader(name, again, roles, need).and_then(Log::of_plain) {
                Ok(log) => return Ok(Self::of_plain(log)),
                Err(error) if !error.is_of_content() => return Err(error),
                Err(error) => Some(error),
            }
        };
        let stream = Stream::new(Box::new(Cursor::new(bytes)), false, None).map_err(open)?;
        Self::of_stream(name, stream, roles, need, plain)
    }

    /// The one recording that there is.
    ///
    /// # Errors
    /// There are several, because samples are missing between them.
    pub fn whole(self) -> Result<Log, LogError> {
        let mut logs = self.logs;
        match (logs.pop(), logs.is_empty()) {
            (Some(log), true) => Ok(log),
            (log, _) => Err(LogError::InParts {
                name: log.map_or_else(String::new, |log| log.name),
                said: self.said.unwrap_or_default(),
            }),
        }
    }

    fn of_plain(log: Log) -> Self {
        Self {
            logs: vec![log],
            origin: None,
            said: None,
            rows: None,
        }
    }

    /// `plain` is what the plain reader said of these bytes.
    fn of_stream(
        name: &str,
        mut stream: Stream,
        roles: &Roles,
        need: RoleNeed,
        plain: Option<LogError>,
    ) -> Result<Self, LogError> {
        if let Some(sample_time) = roles
            .resample
            .filter(|step| !super::sample_time::is_sample_time(*step))
        {
            return Err(LogError::InvalidSampleTime { sample_time });
        }
        let mut bytes = Vec::new();
        if let Some(size) = stream.bytes_total() {
            check_memory(name, size as usize)?;
        }
        stream
            .read_to_end(&mut bytes)
            .map_err(|source| LogError::Read {
                name: name.to_owned(),
                line: 0,
                source,
            })?;
        check_memory(name, bytes.len())?;
        let (sha256, _) = stream.into_digest();
        let unread = |plain: Option<LogError>| {
            plain.unwrap_or_else(|| LogError::Empty {
                name: name.to_owned(),
            })
        };
        let (text, encoding) = whole::text(name, &bytes)?;
        let Some(table) = Whole::read(name, &text, roles, need)? else {
            return Err(unread(plain));
        };
        let mut said: Vec<String> = encoding
            .iter()
            .map(|encoding| format!("read as {encoding}"))
            .collect();
        said.extend(table.layout.said.iter().cloned());
        said.extend(table.said.iter().cloned());
        let assembled = Assembly {
            name,
            table: &table,
            roles,
            sha256: &sha256,
        }
        .logs(&mut said)?;
        let times = table.stamps.as_ref().map(|stamps| &stamps.seconds);
        let rows = match (&assembled[..], times) {
            ([log], Some(times)) if roles.resample.is_none() && roles.sample_time.is_none() => {
                (times.len() != log.samples()).then(|| times.clone())
            }
            _ => None,
        };
        Ok(Self {
            rows,
            logs: assembled,
            origin: table.stamps.as_ref().and_then(|stamps| stamps.origin),
            said: (!said.is_empty()).then(|| said.join("; ")),
        })
    }
}

fn check_memory(name: &str, bytes: usize) -> Result<(), LogError> {
    limits::check(
        (bytes as u64).saturating_mul(COPIES as u64),
        None,
        || format!("{name}: {bytes} bytes that are not plain CSV"),
        || {
            "take a part of the recording, or convert it to commas, points and seconds, which are streamed".to_owned()
        },
    )?;
    Ok(())
}

/// A table on its way to recordings.
struct Assembly<'a> {
    name: &'a str,
    table: &'a Whole<'a>,
    roles: &'a Roles,
    sha256: &'a str,
}

impl Assembly<'_> {
    fn logs(&self, said: &mut Vec<String>) -> Result<Vec<Log>, LogError> {
        let table = self.table;
        let header = &table.layout.header;
        if let Some(stamps) = &table.stamps {
            said.extend(stamps.said.iter().cloned());
        }
        self.refuse_missing()?;
        let time = table.assigned.time.zip(table.stamps.as_ref());
        if let (Some(asked), Some((index, stamps))) = (self.roles.sample_time, &time) {
            check_sample_time(header, *index, stamps.seconds.iter().copied(), asked)?;
        }
        let mut wanted = self.roles.resample;
        let (pieces, step) = match (self.roles.sample_time, time) {
            (None, Some((index, stamps))) => {
                let column = header.column(index);
                let same = |row: usize| {
                    row.checked_sub(1).and_then(|before| table.rows.get(before))
                        == table.rows.get(row)
                };
                let rows = Rows {
                    name: self.name,
                    column: &column,
                    stamps: &stamps.seconds,
                    lines: &table.lines,
                    rounding: stamps.rounding,
                    same: &same,
                };
                let mut grid = time_grid::lay(&rows, self.at_gaps(), wanted);
                let irregular = match &grid {
                    Err(error) => error.is_irregular(),
                    Ok(grid) => grid.jitter > NEAR && rows.stamps.len() <= FEW_ROWS,
                };
                if self.keeps() && wanted.is_none() && irregular {
                    let step = common_step(rows.stamps);
                    if step.is_some() {
                        wanted = step;
                        said.push("irregular times".to_owned());
                        grid = time_grid::lay(&rows, Missing::Interpolate, wanted);
                    }
                }
                let grid = grid?;
                said.extend(grid.said);
                (grid.pieces, grid.step)
            }
            (given, _) => {
                let step = given.unwrap_or(f64::NAN);
                let all = 0..table.rows.len();
                let times = all.clone().map(|k| k as f64 * step).collect();
                (
                    vec![Piece {
                        rows: all.clone().collect(),
                        samples: all.collect(),
                        times,
                    }],
                    step,
                )
            }
        };
        let parts = match wanted {
            Some(wanted) => self.resampled(&pieces, step, wanted, said),
            None => self.gridded(&pieces, step, said),
        };
        if parts.is_empty() {
            let missing = said.last().cloned().unwrap_or_default();
            return Err(LogError::NothingLeft {
                name: self.name.to_owned(),
                missing,
            });
        }
        if parts.len() > 1 {
            let each = parts.iter().map(|(start, part)| {
                format!(
                    "{} samples from {} s",
                    part.columns.first().map_or(0, Vec::len),
                    readable(*start)
                )
            });
            const SHOWN: usize = 4;
            let mut list = each.clone().take(SHOWN).collect::<Vec<_>>().join(", ");
            if parts.len() > SHOWN {
                list.push_str(", ...");
            }
            said.push(format!(
                "split where samples are missing into {} recordings: {list}",
                parts.len()
            ));
        }
        let step = wanted.unwrap_or(step);
        let logs: Vec<Log> = parts
            .iter()
            .enumerate()
            .map(|(index, (start, part))| self.log(index, parts.len(), step, *start, part))
            .collect();
        let check = match self.keeps() {
            true => Log::check_but_missing_outputs,
            false => Log::check,
        };
        logs.iter().try_for_each(check)?;
        Ok(logs)
    }

    /// Whether outputs that are missing stay so.
    fn keeps(&self) -> bool {
        self.roles.missing == Missing::Keep
    }

    /// What is done where rows are missing: nothing cuts a recording of which only outputs are read, and these may be missing.
    fn at_gaps(&self) -> Missing {
        match self.keeps() && self.table.assigned.inputs.is_empty() {
            true => Missing::Interpolate,
            false => self.roles.missing,
        }
    }

    fn log(
        &self,
        index: usize,
        count: usize,
        sample_time: f64,
        start_time: f64,
        part: &Filled,
    ) -> Log {
        let header = &self.table.layout.header;
        let named = |columns: &[usize]| {
            columns
                .iter()
                .filter_map(|c| header.channels.get(*c).cloned())
                .collect::<Vec<_>>()
        };
        let (inputs, outputs) = (
            named(&self.table.assigned.inputs),
            named(&self.table.assigned.outputs),
        );
        let mut input_data = part.columns.clone();
        let output_data = input_data.split_off(inputs.len().min(input_data.len()));
        Log {
            name: if count > 1 {
                format!("{} [part {} of {count}]", self.name, index + 1)
            } else {
                self.name.to_owned()
            },
            sample_time,
            start_time,
            inputs,
            outputs,
            input_data,
            output_data,
            sha256: Some(self.sha256.to_owned()),
        }
    }

    /// With `--missing error`, the first cell without a value.
    fn refuse_missing(&self) -> Result<(), LogError> {
        if self.roles.missing != Missing::Error {
            return Ok(());
        }
        let channels = self
            .table
            .assigned
            .inputs
            .iter()
            .chain(&self.table.assigned.outputs);
        let gone = self
            .table
            .columns
            .iter()
            .zip(channels)
            .filter_map(|(column, index)| {
                column
                    .iter()
                    .position(|v| v.is_nan())
                    .map(|row| (row, *index))
            });
        match gone.min() {
            Some((row, index)) => Err(LogError::EmptyCell {
                name: self.name.to_owned(),
                line: self.table.lines.get(row).copied().unwrap_or(0),
                column: self.table.layout.header.column(index),
            }),
            None => Ok(()),
        }
    }

    /// Parts with the time of their first sample.
    fn gridded(&self, pieces: &[Piece], step: f64, said: &mut Vec<String>) -> Vec<(f64, Filled)> {
        let mut tally = Tally::default();
        let inputs = self.table.assigned.inputs.len();
        let mut parts = Vec::new();
        for piece in pieces {
            let start = phase(piece, step);
            for part in fill(
                piece,
                &self.table.columns,
                inputs,
                self.roles.missing,
                &mut tally,
            ) {
                parts.push((start + part.from as f64 * step, part));
            }
        }
        let length = |part: &Filled| part.columns.first().map_or(0, Vec::len);
        if parts.iter().any(|(_, part)| length(part) >= SHORTEST) {
            let short = |part: &(f64, Filled)| length(&part.1) < SHORTEST;
            tally.left_out += parts
                .iter()
                .filter(|p| short(p))
                .map(|p| length(&p.1))
                .sum::<usize>();
            parts.retain(|part| !short(part));
        }
        let samples: usize = parts
            .iter()
            .map(|(_, p)| p.columns.first().map_or(0, Vec::len))
            .sum();
        for (count, name) in tally
            .interpolated
            .iter()
            .zip(self.names())
            .filter(|(count, _)| **count > 0)
        {
            let mut text = format!(
                "{} of `{name}` interpolated",
                counted(*count, "missing value")
            );
            if *count as f64 > SLOWER * samples as f64 {
                text.push_str(" (a column logged at a lower rate? `--resample S` at its step invents nothing)");
            }
            said.push(text);
        }
        for (count, name) in (tally.kept.iter().zip(self.names())).filter(|(count, _)| **count > 0)
        {
            said.push(format!(
                "{} of `{name}`: compared where it has values",
                counted(*count, "missing value")
            ));
        }
        if tally.longest > 1 {
            said.push(format!("at most {} missing in a row", tally.longest));
        }
        if tally.left_out > 0 {
            said.push(format!(
                "{} left out at or between missing values",
                counted(tally.left_out, "sample")
            ));
        }
        parts
    }

    fn names(&self) -> impl Iterator<Item = String> {
        let columns = self
            .table
            .assigned
            .inputs
            .iter()
            .chain(&self.table.assigned.outputs);
        columns.map(|column| self.table.layout.header.column(*column))
    }

    fn resampled(
        &self,
        pieces: &[Piece],
        step: f64,
        wanted: f64,
        said: &mut Vec<String>,
    ) -> Vec<(f64, Filled)> {
        let inputs = self.table.assigned.inputs.len();
        // On a finer grid outputs may stay missing between the rows.
        let places = self.keeps() && wanted <= step * (1.0 + 1e-6);
        let mut parts = Vec::new();
        for piece in pieces {
            // Each channel by the rows that have it; the grid is where all of them are, but for those that may be missing.
            let known: Vec<(Vec<f64>, Vec<f64>)> = self
                .table
                .columns
                .iter()
                .map(|column| {
                    let rows = piece.rows.iter().zip(&piece.times);
                    rows.filter_map(|(row, time)| Some((*time, *column.get(*row)?)))
                        .filter(|p| p.1.is_finite())
                        .unzip()
                })
                .collect();
            let ends = |k: &(Vec<f64>, Vec<f64>)| Some((*k.0.first()?, *k.0.last()?));
            let all = (piece
                .times
                .first()
                .copied()
                .zip(piece.times.last().copied()))
            .unwrap_or((f64::INFINITY, f64::NEG_INFINITY));
            let required = known.iter().take(if places { inputs } else { known.len() });
            let (from, to) = required.fold(all, |(from, to), k| {
                let (first, last) = ends(k).unwrap_or((f64::INFINITY, f64::NEG_INFINITY));
                (from.max(first), to.min(last))
            });
            if to - from < wanted {
                continue;
            }
            let columns: Vec<Vec<f64>> = known
                .iter()
                .enumerate()
                .map(|(index, (times, values))| {
                    let own = (times.last().copied().unwrap_or(0.0)
                        - times.first().copied().unwrap_or(0.0))
                        / (times.len().max(2) - 1) as f64;
                    let grid = Resampling {
                        times,
                        step: own,
                        wanted,
                        from,
                        to,
                    };
                    match (places, index < inputs) {
                        (true, false) => grid.placed(values),
                        (true, true) => grid.joined(values, true),
                        (false, held) => grid.column(values, held),
                    }
                })
                .collect();
            parts.push((from, Filled { from: 0, columns }));
        }
        let how = match (wanted > step, places) {
            (_, true) => "inputs held, outputs compared only where they were measured, put",
            (true, _) => "low-pass filtered and put",
            (false, _) => "inputs held, outputs joined by lines, put",
        };
        said.push(format!(
            "{how} on a grid of {} s from steps of about {} s",
            readable(wanted),
            readable(step)
        ));
        parts
    }
}

/// Time of the first sample of a piece: its stamp, unless that is off the grid of the others.
fn phase(piece: &Piece, step: f64) -> f64 {
    let first = piece.times.first().copied().unwrap_or(0.0);
    let off = piece
        .samples
        .iter()
        .zip(&piece.times)
        .map(|(k, t)| t - first - *k as f64 * step);
    let mean = off.sum::<f64>() / piece.times.len().max(1) as f64;
    if mean.abs() > super::time::STEP_TOLERANCE * step {
        readable(first + mean)
    } else {
        first
    }
}
