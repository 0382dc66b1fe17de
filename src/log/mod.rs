//! Recordings in and out: a [`Log`] is a time base with named inputs and outputs.
//!
//! A recording is a CSV file: one column a signal, one row a sample, headers such as `force [N]`. It is read as a
//! *stream* of column-major blocks ([`LogReader`]), in memory that does not grow with the file, while the sampling is
//! checked and the bytes are hashed; [`Log::read`] collects the blocks of a record which fits in memory.
//!
//! | folder or file | one idea                                                       |
//! |----------------|----------------------------------------------------------------|
//! | `text`         | bytes to cells: encoding, lines, header, fields to numbers     |
//! | `roles`        | which column is input, output, time                            |
//! | `time`         | time stamps to a uniform grid: checked, repaired, resampled    |
//! | `read`         | the plain form as a stream of blocks; any other form as a whole |
//! | `reading`      | a file however it is written, by one of these                  |
//! | `record`       | a whole record in memory                                       |
//! | `data_frame`   | columns of another language's table in memory                  |
//! | `quantisation` | was a signal recorded in steps                                 |
//! | `write`        | columns to CSV; a file appears whole or not at all             |
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

pub(crate) mod data_frame;
mod log_error;
mod quantisation;
mod read;
mod reading;
mod record;
mod roles;
pub(crate) mod sample_time;
#[cfg(test)]
mod tests;
mod text;
mod time;
pub(crate) mod write;

pub use log_error::LogError;
pub(crate) use quantisation::spacing;
pub(crate) use read::{BLOCK_ROWS, check_same_channels, check_same_sampling};
pub use read::{Block, LogReader, LogSummary};
pub use reading::Reading;
pub(crate) use record::LARGEST_SIZE;
pub use record::Log;
pub use roles::{Missing, RoleNeed, Roles, TimeUnit};
pub(crate) use sample_time::is_sample_time;
pub use text::{Channel, Source};
#[cfg(feature = "cli")]
pub(crate) use time::Origin;
pub(crate) use time::counted;
#[cfg(feature = "cli")]
pub(crate) use write::write_file_atomically;
pub use write::{CsvWriter, write_simulation, write_table};
