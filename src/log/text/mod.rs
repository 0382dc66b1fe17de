//! Bytes to cells.
//!
//! | file | one idea |
//! |---|---|
//! | `byte_source` | where bytes come from: file, standard input, gzip; SHA-256 |
//! | `encoding` | UTF-8, UTF-16, Windows-1252 |
//! | `lines` | bytes to whole lines in a bounded buffer |
//! | `delimited` | a line to its fields |
//! | `header` | the first line: separator, names, units |
//! | `channel`, `unit` | a signal's name and unit; is this a unit |
//! | `decimal` | text to the nearest `f64`, fast |
//! | `cells` | numbers in many ways, words for missing values |
//! | `parse` | rows to columns |

mod byte_source;
mod cells;
mod channel;
pub(crate) mod decimal;
mod delimited;
mod encoding;
mod header;
mod lines;
mod parse;
mod unit;

pub use byte_source::Source;
pub(crate) use byte_source::Stream;
pub(crate) use cells::{Mark, Marks, fields, is_missing, is_number};
pub use channel::Channel;
pub(crate) use delimited::split;
pub(crate) use encoding::decode;
pub(crate) use header::Header;
pub(crate) use lines::Lines;
pub(crate) use parse::RowParser;
pub(crate) use unit::is_unit;
