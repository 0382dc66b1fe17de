//! The first line of a recording: its separator, its names, or that it has none.

use super::channel::Channel;
use super::decimal::finite;
use super::delimited::split;
use super::lines::Lines;
use crate::log::log_error::{LogError, brief};

/// What the first line says.
#[derive(Debug, Clone)]
pub(crate) struct Header {
    /// The file's display name, for messages.
    pub(crate) name: String,
    /// One channel a column; named `1`, `2`, ... when the file has no header. A name may be empty.
    pub(crate) channels: Vec<Channel>,
    /// The headers as written, for commands that a message suggests.
    pub(crate) raw: Vec<String>,
    pub(crate) separator: u8,
    /// The first row is data already.
    pub(crate) headerless: bool,
    /// The header's line, from 1 (the first row's, when there is no header).
    pub(crate) line: u64,
}

impl Header {
    /// Skips comments and blank lines and reads the header. A first row of numbers is left to be read as data.
    pub(crate) fn read(lines: &mut Lines) -> Result<Self, LogError> {
        let name = lines.name().to_owned();
        loop {
            let number = lines.next_line();
            let (chunk, _) = lines.chunk()?;
            let Some(end) = memchr::memchr(b'\n', chunk) else {
                return Err(LogError::Empty { name });
            };
            let line = chunk.get(..end).unwrap_or_default();
            let trimmed = line.trim_ascii();
            if trimmed.is_empty() || trimmed.starts_with(b"#") {
                lines.consume(end + 1, 1);
                continue;
            }
            let header = Self::parse(name, number, line)?;
            if !header.headerless {
                lines.consume(end + 1, 1);
            }
            return Ok(header);
        }
    }

    fn parse(name: String, number: u64, line: &[u8]) -> Result<Self, LogError> {
        if let Some(hint) = not_text(line) {
            return Err(LogError::NotText {
                name,
                line: number,
                hint,
            });
        }
        let separator = separator(line);
        let mut raw = Vec::new();
        let mut fields = Vec::new();
        split(line, separator, &mut fields);
        for range in &fields {
            let field = line.get(range.clone()).unwrap_or_default();
            let Ok(field) = std::str::from_utf8(field) else {
                let hint = "a header is in another encoding; convert the file, such as \
                            `iconv -f latin1 -t utf-8 OLD.csv > NEW.csv`";
                return Err(LogError::NotText {
                    name,
                    line: number,
                    hint,
                });
            };
            // A doubled quote inside a quoted header is one quote.
            raw.push(field.replace("\"\"", "\""));
        }
        let headerless = raw.iter().all(|field| finite(field.as_bytes()).is_some());
        let channels = if headerless {
            (1..=raw.len())
                .map(|index| Channel::new(index.to_string()))
                .collect()
        } else {
            raw.iter().map(|field| Channel::parse(field)).collect()
        };
        Ok(Self {
            name,
            channels,
            raw,
            separator,
            headerless,
            line: number,
        })
    }

    /// All headers, quoted, for a message.
    pub(crate) fn list(&self) -> String {
        const SHOWN: usize = 40;
        let mut names: Vec<String> = self
            .channels
            .iter()
            .take(SHOWN)
            .map(|c| match c.name.is_empty() {
                true => "(no name)".to_owned(),
                false => format!("`{}`", brief(&c.to_string())),
            })
            .collect();
        if self.channels.len() > SHOWN {
            names.push(format!("... ({} in all)", self.channels.len()));
        }
        names.join(", ")
    }

    /// The name of a column in a message; its number where the header left it empty.
    pub(crate) fn column(&self, index: usize) -> String {
        match self.channels.get(index) {
            Some(channel) if !channel.name.is_empty() => brief(&channel.to_string()),
            _ => (index + 1).to_string(),
        }
    }

    /// The error of two columns (counted from 0) with one name.
    pub(crate) fn duplicate(&self, first: usize, second: usize) -> LogError {
        let (name, column) = (self.name.clone(), self.column(first));
        LogError::DuplicateHeader {
            name,
            line: self.line,
            column,
            first: first + 1,
            second: second + 1,
        }
    }

    /// What may be wrong with a file none of whose headers is recognised.
    pub(crate) fn hint(&self) -> &'static str {
        let comma_number = |field: &String| finite(field.replace(',', ".").as_bytes()).is_some();
        if self.headerless {
            " (the first row is all numbers, so the file has no header and columns go by number)"
        } else if self.raw.iter().any(|field| field.contains(','))
            && self.raw.iter().all(comma_number)
        {
            " (the first row looks like data with decimal commas: write decimal points)"
        } else if self.raw.iter().any(comma_number) {
            " (the first row looks like data: add a header line)"
        } else if self.raw.len() == 1
            && self
                .raw
                .iter()
                .any(|field| field.contains(char::is_whitespace))
        {
            " (only one: columns must be separated by commas, semicolons or tabs)"
        } else {
            ""
        }
    }
}

/// Why the first line cannot be CSV text, if it cannot.
fn not_text(line: &[u8]) -> Option<&'static str> {
    if line.starts_with(b"\xFF\xFE") || line.starts_with(b"\xFE\xFF") {
        return Some(
            "it is UTF-16; save it as `CSV UTF-8`, or `iconv -f utf-16 -t utf-8 OLD.csv > NEW.csv`",
        );
    }
    if line.starts_with(b"PK\x03\x04") {
        return Some("it is a zip archive or an Excel workbook; export it as CSV");
    }
    if line.contains(&0) {
        return Some("it holds NUL bytes; export the recording as CSV");
    }
    None
}

/// The separator of a header line: outside quotes and brackets, a semicolon wins (its cells may hold decimal commas),
/// then whichever of tab and comma is more frequent.
fn separator(line: &[u8]) -> u8 {
    let (mut quoted, mut bracket) = (false, false);
    let (mut semicolons, mut tabs, mut commas) = (0, 0, 0);
    for byte in line {
        match byte {
            b'"' => quoted = !quoted,
            b'[' => bracket = true,
            b']' => bracket = false,
            _ if quoted || bracket => {}
            b';' => semicolons += 1,
            b'\t' => tabs += 1,
            b',' => commas += 1,
            _ => {}
        }
    }
    if semicolons > 0 {
        b';'
    } else if tabs > commas {
        b'\t'
    } else {
        b','
    }
}
