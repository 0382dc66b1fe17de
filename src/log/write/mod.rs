//! Columns to CSV, and files that appear whole or not at all.

mod atomic;
mod csv_writer;

pub use atomic::write_file_atomically;
pub use csv_writer::{CsvWriter, write_simulation, write_table};
