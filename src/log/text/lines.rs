//! Bytes to whole lines, in a bounded buffer.

use std::io::{ErrorKind, Read};

use super::byte_source::Stream;
use crate::log::LogError;

/// Large enough that a read costs little, small enough to stay in the cache while it is parsed.
const CHUNK: usize = 256 * 1024;
/// The longest line; the buffer grows up to it only when a line asks for it.
const LONGEST: usize = 1 << 20;
const BYTE_ORDER_MARK: &[u8] = b"\xEF\xBB\xBF";

/// A stream cut at line ends. Every line comes with its `\n`: the last gets one if the file does not end in one, and is
/// left out if it is still being written.
pub(crate) struct Lines {
    name: String,
    stream: Stream,
    buffer: Vec<u8>,
    /// Unread bytes are `start..end`, of which `start..whole` are whole lines.
    start: usize,
    whole: usize,
    end: usize,
    line: u64,
    ended: bool,
    cut_off: bool,
}

impl Lines {
    pub(crate) fn new(name: String, stream: Stream) -> Self {
        let buffer = vec![0; CHUNK];
        Self {
            name,
            stream,
            buffer,
            start: 0,
            whole: 0,
            end: 0,
            line: 1,
            ended: false,
            cut_off: false,
        }
    }

    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    pub(crate) fn stream(&self) -> &Stream {
        &self.stream
    }

    pub(crate) fn into_stream(self) -> Stream {
        self.stream
    }

    /// Number (from 1) of the first line that is not consumed.
    pub(crate) fn next_line(&self) -> u64 {
        self.line
    }

    /// At least one whole line, unless the stream has ended: then nothing. With it comes whether its last line is the
    /// file's last and had no line end: it may be incomplete.
    pub(crate) fn chunk(&mut self) -> Result<(&[u8], bool), LogError> {
        if self.start == self.whole && !self.ended {
            self.refill()?;
        }
        Ok((
            self.buffer.get(self.start..self.whole).unwrap_or_default(),
            self.cut_off,
        ))
    }

    /// Takes `bytes`, which hold `lines` lines, off the front of the chunk.
    pub(crate) fn consume(&mut self, bytes: usize, lines: u64) {
        self.start = (self.start + bytes).min(self.whole);
        self.line += lines;
    }

    /// Reads compressed data to their end and says whether they are damaged; plain data cannot be.
    pub(crate) fn damage(&mut self) -> Option<LogError> {
        while self.stream.is_gzip() && !self.ended {
            self.end = 0;
            match self.read() {
                Ok(()) => {}
                Err(error) => {
                    self.ended = true;
                    return Some(error);
                }
            }
        }
        self.start = self.end;
        self.whole = self.end;
        None
    }

    fn refill(&mut self) -> Result<(), LogError> {
        self.buffer.copy_within(self.start..self.end, 0);
        self.end -= self.start;
        self.start = 0;
        self.whole = 0;
        let at_first = self.line == 1;
        let mut marked = false;
        while self.whole == 0 && !self.ended {
            if self.end == self.buffer.len() {
                self.grow()?;
            }
            let before = self.end;
            self.read()?;
            if at_first && !marked && self.end >= BYTE_ORDER_MARK.len() {
                marked = true;
                if self.buffer.starts_with(BYTE_ORDER_MARK) {
                    self.start = BYTE_ORDER_MARK.len();
                }
            }
            if self.ended && self.end > self.start {
                self.cut_off = self.buffer.get(self.end - 1) != Some(&b'\n');
                if self.cut_off && self.stream.has_grown() {
                    // The writer was in the middle of this line when the file was opened: what is there of it may be half
                    // a number. All before it was given out, for a refill starts where no whole line is left.
                    self.cut_off = false;
                    self.end = self.start;
                } else if self.cut_off {
                    self.buffer.truncate(self.end);
                    self.buffer.push(b'\n');
                    self.end += 1;
                }
            }
            let fresh = self
                .buffer
                .get(before.max(self.start)..self.end)
                .unwrap_or_default();
            if let Some(last) = memchr::memrchr(b'\n', fresh) {
                self.whole = before.max(self.start) + last + 1;
            }
        }
        self.whole = self.whole.max(self.start);
        Ok(())
    }

    fn grow(&mut self) -> Result<(), LogError> {
        let (name, line) = (self.name.clone(), self.line);
        if self.end <= LONGEST {
            self.buffer.resize((2 * self.end).min(LONGEST + 1), 0);
            Ok(())
        } else if memchr::memchr(0, &self.buffer).is_some() {
            let hint = "it holds NUL bytes; export the recording as CSV";
            Err(LogError::NotText { name, line, hint })
        } else {
            Err(LogError::LineTooLong { name, line })
        }
    }

    /// One read from the stream into the free end of the buffer.
    fn read(&mut self) -> Result<(), LogError> {
        loop {
            let free = self.buffer.get_mut(self.end..).unwrap_or_default();
            match self.stream.read(free) {
                Ok(count) => {
                    self.end += count;
                    self.ended = count == 0;
                    return Ok(());
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(source) => {
                    let known =
                        memchr::memchr_iter(b'\n', self.buffer.get(..self.end).unwrap_or_default())
                            .count();
                    let (name, line) = (self.name.clone(), self.line - 1 + known as u64);
                    let broken = matches!(
                        source.kind(),
                        ErrorKind::InvalidInput | ErrorKind::InvalidData | ErrorKind::UnexpectedEof
                    );
                    return Err(if broken && self.stream.is_gzip() {
                        LogError::BrokenGzip { name, line, source }
                    } else {
                        LogError::Read { name, line, source }
                    });
                }
            }
        }
    }
}

impl std::fmt::Debug for Lines {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Lines")
            .field("name", &self.name)
            .field("line", &self.line)
            .finish_non_exhaustive()
    }
}
