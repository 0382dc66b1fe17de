//! Readers of whole recordings.
//!
//! | file | one idea |
//! |---|---|
//! | `reader` | the plain form as a stream of blocks |
//! | `layout` | separator, preamble, header, row of units of any other form |
//! | `whole` | a text as a table of numbers |

mod layout;
mod reader;
pub(crate) mod whole;

pub(crate) use reader::{BLOCK_ROWS, check_same_channels, check_same_sampling};
pub use reader::{Block, LogReader, LogSummary};
pub(crate) use whole::Whole;
