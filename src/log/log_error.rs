//! What can be wrong with a recording, and what to do about it.

use std::io;
use std::path::PathBuf;

use crate::limits::LimitError;

/// Everything that can go wrong when a log is read or written.
///
/// A message starts with the file and, where there is one, the line (from 1; the header counts) and the column, says
/// what was found, and ends with what to do. Fields called `name` are the file's display name.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages explain the fields")]
pub enum LogError {
    /// The file does not exist or may not be read.
    #[error(
        "{name}: cannot open: {source}; check the path and its permissions, or use `-` for standard input"
    )]
    Open { name: String, source: io::Error },
    /// Reading stopped half-way.
    #[error(
        "{name}, after line {line}: cannot read on: {source}; check the disk or the connection that it comes from, and \
         run this again"
    )]
    Read {
        name: String,
        line: u64,
        source: io::Error,
    },
    /// A pipe that would have to be read twice.
    #[error(
        "{name}: this recording has to be read a second time, and a pipe gives its bytes only once; save it to a file \
         and give the name of that"
    )]
    ReadOnce { name: String },
    /// A second reading found another recording.
    #[error(
        "{name}: the file changed while it was read: {found} samples at the second reading, {expected} at the first; \
         identify it when nothing writes to it any more, or from a copy"
    )]
    Changed {
        name: String,
        expected: usize,
        found: usize,
    },
    /// A file that was cut while it was read.
    #[error(
        "{name}: the file became shorter while it was read: {found} of {expected} bytes were there; read it again when \
         nothing writes to it any more, or from a copy"
    )]
    Shrunk {
        name: String,
        expected: u64,
        found: u64,
    },
    /// More than memory may hold.
    #[error(transparent)]
    Limit(#[from] LimitError),
    /// The compressed data are damaged or are not gzip at all.
    #[error(
        "{name}, after line {line}: broken gzip data: {source}; `gzip -t` tells whether the file is whole: copy it \
         again, or drop the `.gz` when it is not compressed"
    )]
    BrokenGzip {
        name: String,
        line: u64,
        source: io::Error,
    },
    /// No byte, or nothing but comments and blank lines.
    #[error(
        "{name}: the file is empty; expected a header line such as `t,u,y` and one row a sample"
    )]
    Empty { name: String },
    /// A header and nothing else.
    #[error("{name}: no data after the header on line {line}; expected one row a sample")]
    NoData { name: String, line: u64 },
    /// Bytes that no CSV text has.
    #[error("{name}, line {line}: this is not UTF-8 text: {hint}")]
    NotText {
        name: String,
        line: u64,
        hint: &'static str,
    },
    /// A line beyond one mebibyte: probably not a CSV file.
    #[error(
        "{name}, line {line}: longer than 1 MiB; is this a CSV file with one row a sample and line ends?"
    )]
    LineTooLong { name: String, line: u64 },
    /// A cell of a wanted column holds text.
    #[error(
        "{name}, line {line}, column `{column}`: `{text}` is not a number{hint}; correct the cell, or cut the log there"
    )]
    NotANumber {
        name: String,
        line: u64,
        column: String,
        text: String,
        hint: &'static str,
    },
    /// A cell of a wanted column is NaN, NA, null or infinite.
    #[error(
        "{name}, line {line}, column `{column}`: `{text}` is not a finite number; fill or interpolate missing values \
         (pandas: `.interpolate()`), or cut the log there and pass both parts as two experiments"
    )]
    NotFinite {
        name: String,
        line: u64,
        column: String,
        text: String,
    },
    /// A cell of a wanted column is empty.
    #[error(
        "{name}, line {line}, column `{column}`: the cell is empty (a missing value); fill or interpolate it (pandas: \
         `.interpolate()`), or cut the log there and pass both parts as two experiments"
    )]
    EmptyCell {
        name: String,
        line: u64,
        column: String,
    },
    /// A row with more or fewer fields than the header.
    #[error("{name}, line {line}: {found} fields where the header has {expected}{hint}")]
    RaggedRow {
        name: String,
        line: u64,
        expected: usize,
        found: usize,
        hint: &'static str,
    },
    /// A blank line with data after it.
    #[error(
        "{name}, line {line}: a blank line between rows; delete it, or split the file there and pass both parts as two \
         experiments if samples are missing"
    )]
    BlankLine { name: String, line: u64 },
    /// A column was asked for that the header does not have.
    #[error("{name}: no column `{column}`{suggestion}; the columns are {headers}")]
    UnknownColumn {
        name: String,
        column: String,
        suggestion: String,
        headers: String,
    },
    /// A name that fits several columns.
    #[error("{name}: `{column}` may be any of {matches}; write the header out, with its unit")]
    AmbiguousColumn {
        name: String,
        column: String,
        matches: String,
    },
    /// Two columns with a role share a name.
    #[error(
        "{name}, line {line}: columns {first} and {second} are both called `{column}`; rename one in the header"
    )]
    DuplicateHeader {
        name: String,
        line: u64,
        column: String,
        first: usize,
        second: usize,
    },
    /// One column was given two roles, or one role twice.
    #[error(
        "{name}: column `{column}` is given twice, as {first} and as {second}; name each column once"
    )]
    ColumnGivenTwice {
        name: String,
        column: String,
        first: &'static str,
        second: &'static str,
    },
    /// Neither inputs nor outputs can be told from the headers.
    #[error(
        "{name}: cannot tell inputs from outputs: the columns are {headers}{hint}; say which is which: `{example}`"
    )]
    NoRoles {
        name: String,
        headers: String,
        hint: &'static str,
        example: String,
    },
    /// Outputs were found and inputs were not.
    #[error(
        "{name}: no inputs: no header starts with u; the columns are {headers}; name them: `{example}`"
    )]
    NoInputs {
        name: String,
        headers: String,
        example: String,
    },
    /// Inputs were found and outputs were not.
    #[error(
        "{name}: no outputs: no header starts with y; the columns are {headers}; name them: `{example}`"
    )]
    NoOutputs {
        name: String,
        headers: String,
        example: String,
    },
    /// Neither a time column nor a sample time.
    #[error(
        "{name}: no time column (`t` or `time`) among {headers}; name it with `--time COLUMN`, or give the sample time \
         in seconds with `--dt S`"
    )]
    NoTime { name: String, headers: String },
    /// Time stamps such as ISO dates.
    #[error(
        "{name}, line {line}, column `{column}`: the time stamp `{text}` is not a number; convert the column to seconds \
         (pandas: `t = pandas.to_datetime(t); (t - t[0]).dt.total_seconds()`), or pass `--dt S` (the sample time in \
         seconds), which ignores the column"
    )]
    TimeNotANumber {
        name: String,
        line: u64,
        column: String,
        text: String,
    },
    /// A time unit that is not s, ms, us, ns, min or h.
    #[error(
        "{name}, column `{column}`: unknown time unit `{unit}` (known: s, ms, us, ns, min, h); convert the column to \
         seconds, or pass `--dt S`, which ignores it"
    )]
    TimeUnit {
        name: String,
        column: String,
        unit: String,
    },
    /// A time stamp that repeats or precedes the one before.
    #[error(
        "{name}, line {line}, column `{column}`: time goes from {before} s to {after} s, and it must increase; sort or \
         delete rows, split the file there if a new recording starts, or pass `--dt S`, which ignores the column"
    )]
    TimeNotIncreasing {
        name: String,
        line: u64,
        column: String,
        before: f64,
        after: f64,
    },
    /// A step of more than one and a half sample times: samples are missing.
    #[error(
        "{name}, line {line}, column `{column}`: a gap of {found} s before this row, where the step is {expected} s; \
         split the file there and pass both parts as two experiments: {recipe}"
    )]
    TimeGap {
        name: String,
        line: u64,
        column: String,
        found: f64,
        expected: f64,
        recipe: String,
    },
    /// A step that is more than 1 % off.
    #[error(
        "{name}, line {line}, column `{column}`: irregular sampling: the step is {found} s where {expected} s is \
         expected (1 % is allowed); resample to a uniform grid: {recipe}; or, when time stamps are only rounded, pass \
         `--dt {expected}`, which ignores the column"
    )]
    IrregularStep {
        name: String,
        line: u64,
        column: String,
        found: f64,
        expected: f64,
        recipe: String,
    },
    /// Each step is about right and yet the clock runs away from a uniform grid.
    #[error(
        "{name}, line {line}, column `{column}`: the clock drifts: time is {found} s where a uniform step of \
         {sample_time} s leads to {expected} s; resample to a uniform grid: {recipe}; or pass `--dt {sample_time}`, \
         which ignores the column"
    )]
    ClockDrift {
        name: String,
        line: u64,
        column: String,
        found: f64,
        expected: f64,
        sample_time: f64,
        recipe: Box<str>,
    },
    /// Several rows share a time stamp, not always as many.
    #[error(
        "{name}, column `{column}`: time stamps are only to {resolution} s, and between {least} and {most} rows share one, so \
         the time of a row cannot be told; log stamps with more digits, or pass `--dt S` when the rows are evenly spaced"
    )]
    CoarseStamps {
        name: String,
        column: String,
        resolution: f64,
        least: usize,
        most: usize,
    },
    /// `--dt` and the time column do not agree.
    #[error(
        "{name}, column `{column}`: its step is {found} s, and --dt says {asked} s; leave --dt out, or say what the column \
         is: `--time-unit ms` for another unit, `--time none` when it is no time"
    )]
    SampleTimeContradicted {
        name: String,
        column: String,
        found: f64,
        asked: f64,
    },
    /// So many samples are missing that nothing is left between them.
    #[error(
        "{name}: nothing is left between missing samples: {missing}; `--missing interpolate` fills them all, and \
         `--resample S` reads the recording at the rate of its slowest column"
    )]
    NothingLeft { name: String, missing: String },
    /// A recording in several parts where one is needed.
    #[error(
        "{name}: samples are missing ({said}), and one recording without gaps is needed here; cut the file there, or fill \
         them with `--missing interpolate`"
    )]
    InParts { name: String, said: String },
    /// What the plain reader leaves to the one that looks at the whole file.
    #[error(
        "{name}: column `{column}` holds dates, or time in another unit than seconds; read the file as a whole"
    )]
    Dated { name: String, column: String },
    /// The sample time asked for is zero, negative or not finite.
    #[error(
        "the sample time must be a positive number of seconds, between 1e-18 and 1e18, found {sample_time}; for example \
         `--dt 0.01`"
    )]
    InvalidSampleTime { sample_time: f64 },
    /// Experiments that belong together have other channels.
    #[error(
        "{name}: its {role} are {found}, but those of {first} are {expected}; experiments identified together need the \
         same columns: rename headers, or pick columns with `--inputs` and `--outputs`"
    )]
    DifferentChannels {
        name: String,
        role: &'static str,
        found: String,
        first: Box<str>,
        expected: Box<str>,
    },
    /// Experiments that belong together measure in other units.
    #[error(
        "{name}: column `{column}` is in `{found}`, but in `{expected}` in {first}; convert one of them to the other's \
         unit"
    )]
    DifferentUnits {
        name: String,
        column: String,
        found: Box<str>,
        first: Box<str>,
        expected: Box<str>,
    },
    /// Experiments that belong together were sampled at other rates.
    #[error(
        "{name}: the sample time is {found} s, but {expected} s in {first}; resample one of them, or identify them \
         apart (when only time stamps are off, `--dt S` sets the sample time of all)"
    )]
    DifferentSampling {
        name: String,
        found: f64,
        first: String,
        expected: f64,
    },
    /// Fewer samples than the task takes.
    #[error(
        "{name}: {samples} samples, and {purpose} takes at least {needed}; record longer{hint}"
    )]
    TooShort {
        name: String,
        samples: usize,
        needed: usize,
        purpose: String,
        hint: &'static str,
    },
    /// Columns in memory differ in length.
    #[error("{name}: column `{column}` has {found} samples where the first column has {expected}")]
    ColumnLength {
        name: String,
        column: String,
        expected: usize,
        found: usize,
    },
    /// The number of channel names and of data columns differ.
    #[error("{name}: {found} {role} columns where {expected} {role} channels are named")]
    ColumnCount {
        name: String,
        role: &'static str,
        expected: usize,
        found: usize,
    },
    /// A column in memory holds NaN or an infinity.
    #[error("{name}: column `{column}`, sample {sample} (from 0): {value} is not a finite number")]
    ColumnNotFinite {
        name: String,
        column: String,
        sample: usize,
        value: f64,
    },
    /// A split that would leave one side empty.
    #[error(
        "{name}: cannot split {samples} samples at sample {at}; both parts must have at least one"
    )]
    InvalidSplit {
        name: String,
        samples: usize,
        at: usize,
    },
    /// The output cannot be written; a file that was there before is as it was.
    #[error("{}: cannot write: {source}; choose another place or check permissions and free space", path.display())]
    Write { path: PathBuf, source: io::Error },
}

impl LogError {
    /// Whether it is the machine that failed, and not what is written in the file.
    pub(crate) fn is_of_system(&self) -> bool {
        matches!(
            self,
            Self::Open { .. }
                | Self::Read { .. }
                | Self::ReadOnce { .. }
                | Self::Changed { .. }
                | Self::Shrunk { .. }
                | Self::Limit(_)
                | Self::Write { .. }
        )
    }

    /// Whether another way of reading the same bytes may understand them.
    pub(crate) fn is_of_content(&self) -> bool {
        !self.is_of_system()
            && !matches!(
                self,
                Self::BrokenGzip { .. } | Self::InvalidSampleTime { .. }
            )
    }

    /// Whether the times are on no uniform grid.
    pub(super) fn is_irregular(&self) -> bool {
        matches!(self, Self::IrregularStep { .. } | Self::ClockDrift { .. })
    }

    /// Whether the reader of our standard output has gone (`innovant ... | head`): success for a command line.
    pub fn is_broken_pipe(&self) -> bool {
        matches!(self, Self::Write { source, .. } if source.kind() == io::ErrorKind::BrokenPipe)
    }

    /// The error of a record with `samples` samples where `purpose` ("order 10 with a past window of 50") takes
    /// `needed`.
    pub fn too_short(name: &str, samples: usize, needed: usize, purpose: &str) -> Self {
        Self::TooShort {
            name: name.to_owned(),
            samples,
            needed,
            purpose: purpose.to_owned(),
            hint: "",
        }
    }
}

/// What a message says of a header: all of it, unless it is far longer than a name is.
pub(super) fn brief(header: &str) -> String {
    const SHOWN: usize = 100;
    match header.char_indices().nth(SHOWN) {
        Some((end, _)) => format!("{}...", &header[..end]),
        None => header.to_owned(),
    }
}

/// What a message quotes of a cell: at most forty characters, control characters escaped.
pub(super) fn shorten(text: &[u8]) -> String {
    const SHOWN: usize = 40;
    let head = text.get(..4 * SHOWN + 4).unwrap_or(text);
    let text = String::from_utf8_lossy(head);
    let mut short: String = text
        .chars()
        .take(SHOWN)
        .flat_map(char::escape_debug)
        .collect();
    if text.chars().nth(SHOWN).is_some() {
        short.push_str("...");
    }
    short
}
