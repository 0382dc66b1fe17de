//! Rows of text to columns of numbers.
//!
//! A row is first read as what nearly all rows are: bare numbers between separators, taken in one pass over the bytes.
//! Whatever does not fit (quotes, an empty cell, a wrong count) is read again the careful way, which either
//! understands it or says what is wrong with it.

use std::ops::Range;

use super::decimal::{self, finite};
use super::delimited::split;
use super::header::Header;
use crate::log::log_error::{LogError, shorten};

/// Words that stand for a value that is not there, beside the spellings of NaN and infinity.
const MISSING: [&str; 7] = ["na", "n/a", "#n/a", "null", "none", "nil", "missing"];

/// Parses rows into the slots that the wanted columns were given.
#[derive(Debug)]
pub(crate) struct RowParser {
    header: Header,
    /// Slot of each column of the file; `None` for a column that is not wanted.
    slots: Vec<Option<usize>>,
    /// Column of the time stamps, when they are read.
    time: Option<usize>,
    /// Line of a blank line that was met: only blank lines may follow.
    blank: Option<u64>,
    fields: Vec<Range<usize>>,
}

/// How far [`RowParser::parse`] came.
#[derive(Debug, Default)]
pub(crate) struct Progress {
    pub(crate) bytes: usize,
    pub(crate) lines: u64,
    pub(crate) rows: usize,
}

impl RowParser {
    pub(crate) fn new(header: Header, slots: Vec<Option<usize>>, time: Option<usize>) -> Self {
        Self {
            header,
            slots,
            time,
            blank: None,
            fields: Vec::new(),
        }
    }

    pub(crate) fn header(&self) -> &Header {
        &self.header
    }

    /// Bytes of the shortest row there can be: a separator or line end for each column, a digit for each with a role.
    pub(crate) fn shortest_row(&self) -> usize {
        self.slots.len() + self.slots.iter().flatten().count()
    }

    /// Parses lines of `text` (whole lines, the first being line `first_line` of the file) until the text or the
    /// room in `columns` (rows `from..limit` of each slot) ends. `cut_off`: the file's last line had no line end.
    pub(crate) fn parse(
        &mut self,
        text: &[u8],
        first_line: u64,
        cut_off: bool,
        columns: &mut [Vec<f64>],
        rows: Range<usize>,
    ) -> (Progress, Result<(), LogError>) {
        let mut done = Progress::default();
        while done.rows < rows.len() {
            let Some(rest) = text.get(done.bytes..).filter(|rest| !rest.is_empty()) else {
                break;
            };
            let row = rows.start + done.rows;
            if self.blank.is_none()
                && let Some(used) = self.plain_row(rest, columns, row)
            {
                done.bytes += used;
                done.lines += 1;
                done.rows += 1;
                continue;
            }
            let end = memchr::memchr(b'\n', rest).unwrap_or(rest.len());
            let line = rest.get(..end).unwrap_or_default();
            let last = cut_off && end + 1 >= rest.len();
            match self.careful_row(line, first_line + done.lines, last, columns, row) {
                Ok(has_data) => done.rows += usize::from(has_data),
                Err(error) => return (done, Err(error)),
            }
            done.bytes += end + 1;
            done.lines += 1;
        }
        (done, Ok(()))
    }

    /// The quick way. `None` when the row is not made of bare numbers (and text in unwanted columns) or is wrong.
    #[inline]
    fn plain_row(&self, text: &[u8], columns: &mut [Vec<f64>], row: usize) -> Option<usize> {
        let separator = self.header.separator;
        let mut at = 0;
        let last = self.slots.len() - 1;
        for (column, slot) in self.slots.iter().enumerate() {
            if let Some(slot) = slot {
                while text.get(at) == Some(&b' ') {
                    at += 1;
                }
                let (value, used) = decimal::read(text.get(at..)?)?;
                at += used;
                while text.get(at) == Some(&b' ') {
                    at += 1;
                }
                *columns.get_mut(*slot)?.get_mut(row)? = value;
            } else {
                at += memchr::memchr3(separator, b'\n', b'"', text.get(at..)?)?;
            }
            let mut next = *text.get(at)?;
            if column < last {
                if next != separator {
                    return None;
                }
            } else {
                if next == b'\r' {
                    at += 1;
                    next = *text.get(at)?;
                }
                if next != b'\n' {
                    return None;
                }
            }
            at += 1;
        }
        Some(at)
    }

    /// The careful way: whether the line has data, or what is wrong with it.
    fn careful_row(
        &mut self,
        line: &[u8],
        number: u64,
        cut_off: bool,
        columns: &mut [Vec<f64>],
        row: usize,
    ) -> Result<bool, LogError> {
        let name = || self.header.name.clone();
        if line.trim_ascii().is_empty() {
            // A tab alone may be two empty cells, but with nothing in them the row is as good as blank.
            self.blank.get_or_insert(number);
            return Ok(false);
        }
        if let Some(line) = self.blank {
            return Err(LogError::BlankLine { name: name(), line });
        }
        if line.contains(&0) {
            let hint =
                "the line holds NUL bytes (a logger that lost power?); delete it and what follows";
            return Err(LogError::NotText {
                name: name(),
                line: number,
                hint,
            });
        }
        split(line, self.header.separator, &mut self.fields);
        let (expected, found) = (self.slots.len(), self.fields.len());
        if expected != found {
            let hint = self.ragged_hint(line, cut_off, found);
            return Err(LogError::RaggedRow {
                name: name(),
                line: number,
                expected,
                found,
                hint,
            });
        }
        for (column, (slot, field)) in self.slots.iter().zip(&self.fields).enumerate() {
            let Some(slot) = slot else { continue };
            let cell = line.get(field.clone()).unwrap_or_default();
            let Some(value) = finite(cell) else {
                return Err(self.bad_cell(cell, number, column));
            };
            if let Some(place) = columns
                .get_mut(*slot)
                .and_then(|column| column.get_mut(row))
            {
                *place = value;
            }
        }
        Ok(true)
    }

    /// The error of a line with another number of fields than the header; `cut_off`: the file ends in it.
    pub(crate) fn ragged(&self, line: &str, number: u64, cut_off: bool) -> LogError {
        let mut fields = Vec::new();
        split(line.as_bytes(), self.header.separator, &mut fields);
        LogError::RaggedRow {
            name: self.header.name.clone(),
            line: number,
            expected: self.slots.len(),
            found: fields.len(),
            hint: self.ragged_hint(line.as_bytes(), cut_off, fields.len()),
        }
    }

    fn ragged_hint(&self, line: &[u8], cut_off: bool, found: usize) -> &'static str {
        let expected = self.slots.len();
        if cut_off && found < expected {
            "; the file ends in the middle of this line: delete it"
        } else if self.header.separator == b',' && found == 2 * expected {
            "; were decimals written with commas? Write decimal points, or separate the columns with semicolons"
        } else if found == 1 && line.iter().any(|byte| b",;\t".contains(byte)) {
            "; this row has another separator than the header: use one throughout"
        } else if found < expected {
            "; add what is missing (an interpolated value), or cut the log there"
        } else {
            "; remove what is too much (a stray separator?), or cut the log there"
        }
    }

    pub(crate) fn bad_cell(&self, cell: &[u8], line: u64, index: usize) -> LogError {
        let (name, column, text) = (
            self.header.name.clone(),
            self.header.column(index),
            shorten(cell),
        );
        if cell.is_empty() {
            return LogError::EmptyCell { name, line, column };
        }
        let word = text.to_ascii_lowercase();
        // `1.#INF` and `-1.#IND` are what old C libraries print.
        let not_finite =
            fast_float2::parse::<f64, _>(cell.strip_prefix(b"+").unwrap_or(cell)).is_ok();
        if not_finite
            || MISSING.contains(&word.as_str())
            || word.trim_start_matches('-').starts_with("1.#")
        {
            return LogError::NotFinite {
                name,
                line,
                column,
                text,
            };
        }
        if self.time == Some(index) {
            return LogError::TimeNotANumber {
                name,
                line,
                column,
                text,
            };
        }
        let hint = if self
            .header
            .raw
            .get(index)
            .is_some_and(|header| header.as_bytes() == cell)
        {
            " but the header again (were files joined? Split them and pass both as two experiments)"
        } else if finite(word.replacen(',', ".", 1).as_bytes()).is_some() {
            " (a decimal comma? Write decimal points)"
        } else if std::str::from_utf8(cell).is_err() {
            " nor is it UTF-8 text"
        } else {
            ""
        };
        LogError::NotANumber {
            name,
            line,
            column,
            text,
            hint,
        }
    }
}
