//! Where the bytes of a recording come from.

use std::convert::Infallible;
use std::fmt;
use std::fs::{self, File};
use std::io::{self, BufReader, Chain, Cursor, Read};
use std::path::PathBuf;
use std::str::FromStr;
use std::sync::Mutex;

use flate2::bufread::MultiGzDecoder;
use sha2::{Digest, Sha256};

use crate::log::LogError;

/// What was read of standard input, of which there is one in a process, to be read again; `None` once it is too much.
static HEAD: Mutex<Option<Vec<u8>>> = Mutex::new(Some(Vec::new()));

/// Bytes of standard input that are kept. A longer recording is streamed, and what takes a second look at it asks for a
/// file.
const KEPT: usize = 32 << 20;

/// Standard input from its start; keeps what it reads.
struct Again {
    /// What was read before and is given out first.
    known: Cursor<Vec<u8>>,
}

impl Again {
    /// `None` when the start is gone.
    fn new() -> Option<Self> {
        let head = HEAD.lock().ok()?.clone()?;
        Some(Self {
            known: Cursor::new(head),
        })
    }
}

impl Read for Again {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.known.read(buffer)?;
        if count > 0 || buffer.is_empty() {
            return Ok(count);
        }
        let count = io::stdin().read(buffer)?;
        if let Ok(mut head) = HEAD.lock() {
            if head
                .as_ref()
                .is_some_and(|bytes| bytes.len() + count > KEPT)
            {
                *head = None;
            }
            if let (Some(bytes), Some(fresh)) = (head.as_mut(), buffer.get(..count)) {
                bytes.extend_from_slice(fresh);
            }
        }
        Ok(count)
    }
}

/// A file, or standard input.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Source {
    /// A file; decompressed while reading when it ends in `.gz` or starts as gzip data do.
    Path(PathBuf),
    /// Standard input, `-` on the command line; decompressed when it starts as gzip data do.
    Stdin,
}

impl FromStr for Source {
    type Err = Infallible;

    /// `-` is standard input, all else a path. Cannot fail.
    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(Self::from(text))
    }
}

impl From<&str> for Source {
    fn from(text: &str) -> Self {
        if text == "-" {
            Self::Stdin
        } else {
            Self::Path(text.into())
        }
    }
}

impl From<PathBuf> for Source {
    fn from(path: PathBuf) -> Self {
        if path.as_os_str() == "-" {
            Self::Stdin
        } else {
            Self::Path(path)
        }
    }
}

impl fmt::Display for Source {
    /// The name that messages and documents use.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Path(path) => path.display().fmt(f),
            Self::Stdin => f.write_str("standard input"),
        }
    }
}

impl Source {
    /// Whether a second reading gives the same bytes: that of a file does, a pipe has none left.
    pub(crate) fn can_be_read_again(&self) -> bool {
        match self {
            Self::Stdin => false,
            // What is not there any more fails with its own message.
            Self::Path(path) => fs::metadata(path).map_or(true, |about| about.is_file()),
        }
    }

    /// Whether all of it can be read from its start, once a first reading went some way.
    pub(crate) fn can_be_reopened(&self) -> bool {
        match self {
            Self::Stdin => HEAD.lock().is_ok_and(|head| head.is_some()),
            Self::Path(_) => self.can_be_read_again(),
        }
    }

    /// Opens the source and looks at its first two bytes.
    pub(crate) fn open(&self) -> Result<Stream, LogError> {
        let failed = |source| LogError::Open {
            name: self.to_string(),
            source,
        };
        match self {
            Self::Stdin => {
                let again = Again::new().ok_or_else(|| LogError::ReadOnce {
                    name: self.to_string(),
                })?;
                Stream::new(Box::new(again), false, None).map_err(failed)
            }
            Self::Path(path) => {
                let file = File::open(path).map_err(failed)?;
                let about = file.metadata().map_err(failed)?;
                if about.is_dir() {
                    return Err(failed(io::ErrorKind::IsADirectory.into()));
                }
                let size = about.is_file().then_some(about.len());
                let gzip = path
                    .extension()
                    .is_some_and(|extension| extension.eq_ignore_ascii_case("gz"));
                match size {
                    // A file that is being written to is read as far as it went when it was opened. (Files that say
                    // they are empty may be made while they are read, as those of /proc.)
                    Some(size) if size > 0 => {
                        let again = file.try_clone().map_err(failed)?;
                        let stream = Stream::new(Box::new(file.take(size)), gzip, Some(size));
                        stream.map(|stream| Stream {
                            file: Some(again),
                            ..stream
                        })
                    }
                    _ => Stream::new(Box::new(file), gzip, None),
                }
                .map_err(failed)
            }
        }
    }
}

/// Counts and hashes the raw bytes that pass.
struct Witness {
    reader: Chain<Cursor<Vec<u8>>, Box<dyn Read + Send>>,
    hash: Sha256,
    bytes: u64,
}

impl Read for Witness {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.reader.read(buffer)?;
        self.hash.update(buffer.get(..count).unwrap_or_default());
        self.bytes += count as u64;
        Ok(count)
    }
}

enum Decoder {
    Plain(Witness),
    Gzip(Box<MultiGzDecoder<BufReader<Witness>>>),
}

/// The text of a recording, decompressed, with a tally of the raw bytes below it.
pub(crate) struct Stream {
    decoder: Decoder,
    size: Option<u64>,
    /// The file that is read, when it is one, to ask about its size.
    file: Option<File>,
}

impl Stream {
    /// Wraps `reader`; `size` is the number of raw bytes to expect, if it is known.
    pub(crate) fn new(
        mut reader: Box<dyn Read + Send>,
        gzip: bool,
        size: Option<u64>,
    ) -> io::Result<Self> {
        let mut head = Vec::new();
        reader.by_ref().take(2).read_to_end(&mut head)?;
        let gzip = gzip || head == [0x1F, 0x8B];
        let witness = Witness {
            reader: Cursor::new(head).chain(reader),
            hash: Sha256::new(),
            bytes: 0,
        };
        let decoder = if gzip {
            let buffered = BufReader::with_capacity(64 * 1024, witness);
            Decoder::Gzip(Box::new(MultiGzDecoder::new(buffered)))
        } else {
            Decoder::Plain(witness)
        };
        Ok(Self {
            decoder,
            size,
            file: None,
        })
    }

    pub(super) fn is_gzip(&self) -> bool {
        matches!(self.decoder, Decoder::Gzip(_))
    }

    /// Raw bytes read so far.
    pub(crate) fn bytes_read(&self) -> u64 {
        match &self.decoder {
            Decoder::Plain(witness) => witness.bytes,
            Decoder::Gzip(decoder) => decoder.get_ref().get_ref().bytes,
        }
    }

    /// Raw bytes in all, when the source is a file.
    pub(crate) fn bytes_total(&self) -> Option<u64> {
        self.size
    }

    /// Whether the file is longer than when it was opened: someone is writing to it.
    pub(super) fn has_grown(&self) -> bool {
        let length = self.file.as_ref().and_then(|file| file.metadata().ok());
        length.is_some_and(|about| Some(about.len()) > self.size)
    }

    /// SHA-256 (hexadecimal) and number of the raw bytes read.
    pub(crate) fn into_digest(self) -> (String, u64) {
        let witness = match self.decoder {
            Decoder::Plain(witness) => witness,
            Decoder::Gzip(decoder) => decoder.into_inner().into_inner(),
        };
        let hex = witness
            .hash
            .finalize()
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect();
        (hex, witness.bytes)
    }
}

impl Read for Stream {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match &mut self.decoder {
            Decoder::Plain(witness) => witness.read(buffer),
            Decoder::Gzip(decoder) => decoder.read(buffer),
        }
    }
}
