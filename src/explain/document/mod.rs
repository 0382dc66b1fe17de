//! Text, plots and errors that the documents of both engines share.
//!
//! | file | what it holds |
//! |---|---|
//! | `explain_error` | what can be wrong with a question |
//! | `sentences` | numbers, quantities and summaries as text |
//! | `plots` | traces with few points, spectra |
//! | `channel_units` | units of channels, as loggers write them |

pub(crate) mod channel_units;
pub(crate) mod explain_error;
pub(crate) mod plots;
pub(crate) mod sentences;
