//! Recordings in and out: a [`Log`] is a time base with named inputs and outputs.
//!
//! A recording is a CSV file: one column a signal, one row a sample, headers such as `force [N]`. It is read as a
//! *stream* of column-major blocks ([`LogReader`]), in memory that does not grow with the file, while the sampling is
//! checked and the bytes are hashed; [`Log::read`] collects the blocks of a record which fits in memory.
//!
//! | file          | one idea                                                        |
//! |---------------|-----------------------------------------------------------------|
//! | `source`      | where bytes come from: file, standard input, gzip; SHA-256      |
//! | `lines`       | bytes to whole lines in a bounded buffer                        |
//! | `header`      | the first line: separator, names, units                         |
//! | `roles`       | which column is input, output, time                             |
//! | `decimal`     | text to the nearest `f64`, fast                                 |
//! | `parse`       | rows to columns                                                 |
//! | `sampling`    | is the time base uniform, and what is its step                  |
//! | `reader`      | the five above, put together as a stream of blocks              |
//! | `record`      | a whole record in memory                                        |
//! | `reading`     | a file however it is written: plain, or by the rows below       |
//! | `encoding`    | UTF-8, UTF-16, Windows-1252                                     |
//! | `layout`      | separator, preamble, header, row of units                       |
//! | `cells`       | numbers in many ways, words for missing values                  |
//! | `whole`       | a text as a table of numbers                                    |
//! | `stamp`, `stamps` | a date; a time column                                       |
//! | `clock`       | time stamps to a grid, repaired                                 |
//! | `repair`      | stamps that are coarse, repeated or out of order                |
//! | `fill`        | missing samples: bridged, or the recording is cut               |
//! | `resample`    | another rate                                                    |
//! | `unit`        | is this a unit                                                  |
//! | `lattice`     | was a signal recorded in steps                                  |
//! | `writer`      | columns to CSV; `atomic`: a file appears whole or not at all    |
//!
//! # What is accepted
//! The plain form is streamed: UTF-8 text (a byte order mark is skipped), lines ended by LF or CRLF, a separator `,`, `;`
//! or tab found in the header, quotes and spaces around fields, comment lines (`#`) and blank lines before the header,
//! numbers with decimal points, uniform time in seconds or the unit that its header states. A file whose first row is all
//! numbers has no header; its columns are named `1`, `2`, ... Text is allowed in columns that have no role.
//!
//! Whatever else loggers write is read as a whole ([`Reading`]): other encodings and separators, decimal commas, lines of
//! text above the header, units below it, dates, epochs, missing values and rows, repeated stamps, jitter. What was
//! recognised and repaired is said. Everything else is a [`LogError`] that names the file, the line and the column.
//!
//! # Example
//! ```
//! use innovant::log::{Log, Roles};
//!
//! let csv = "t,u [V],y [rad/s]\n0.0,1,0.00\n0.1,1,0.39\n0.2,0,0.63\n";
//! let log = Log::from_reader("motor.csv", csv.as_bytes(), &Roles::default())?;
//! assert_eq!(log.sample_time, 0.1);
//! assert_eq!(log.inputs[0].to_string(), "u [V]");
//! assert_eq!(log.output_data[0], [0.0, 0.39, 0.63]);
//! # Ok::<(), innovant::log::LogError>(())
//! ```

mod atomic;
mod cells;
mod channel;
mod clock;
mod decimal;
mod encoding;
mod error;
mod fill;
mod header;
mod lattice;
mod layout;
mod lines;
mod parse;
mod reader;
mod reading;
mod record;
mod repair;
mod resample;
mod roles;
mod sample_time;
mod sampling;
mod source;
mod stamp;
mod stamps;
mod table;
#[cfg(test)]
mod tests;
mod unit;
mod whole;
mod writer;

pub use atomic::write_file_atomically;
pub use channel::Channel;
pub use error::LogError;
pub use lattice::spacing;
pub use reader::{
    BLOCK_ROWS, Block, LogReader, LogSummary, check_same_channels, check_same_sampling,
};
pub use reading::Reading;
pub use record::{LARGEST_SIZE, Log};
pub use roles::{Missing, RoleNeed, Roles, TimeUnit};
pub use sample_time::is_sample_time;
pub use source::Source;
pub use stamps::Origin;
pub use table::{TableRoles, time_base_of};
pub use writer::{CsvWriter, write_table};
