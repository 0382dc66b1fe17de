//! What the user sees: standard output and files, progress, the characters a terminal has.

mod output;
mod progress;
mod style;

pub(crate) use output::{Output, check_distinct, note, paths, print};
pub(crate) use progress::Progress;
pub(crate) use style::style;
