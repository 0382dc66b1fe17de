//! The recordings as a method sees them.
//!
//! | file | step |
//! |---|---|
//! | `records` | samples from memory, or from files that are streamed |
//! | `reduced_records` | recordings of which only moments are left: pieces of a cluster's work |
//! | `delay` | channels shifted by known delays |
//! | `lags`, `memory_need` | lags that the moments need for the windows asked for, and the memory that takes |
//! | `recording_moments` | the recording as moments: read once, factored for any past window |
//! | `factor_source` | what a method may ask for: factors of any window, and the signals themselves |

mod delay;
mod factor_source;
mod lags;
mod memory_need;
mod recording_moments;
mod records;
mod reduced_records;

pub(crate) use delay::AlignedColumns;
pub(crate) use factor_source::Source;
pub(crate) use factor_source::deviations;
pub(crate) use lags::{lags_needed, longest_past};
pub(crate) use memory_need::Sizes;
pub(crate) use recording_moments::Data;
#[cfg(feature = "cli")]
pub(crate) use records::on_files;
pub use records::{FileRecords, MemoryRecords, ReadProgress, Recording, Records};
pub use reduced_records::{ReducedRecords, SAMPLES_KEPT};
