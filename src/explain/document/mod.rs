//! The explanation as a document (`innovant-explanation/1`), and what both engines say alike.
//!
//! | file | what it holds |
//! |---|---|
//! | `explanation` | the types of the document |
//! | `explain_error` | what can be wrong with a question |
//! | `sentences` | numbers, quantities and summaries as text |
//! | `plots` | traces with few points, spectra |
//! | `channel_units` | units of channels, as loggers write them |

pub(crate) mod channel_units;
pub(crate) mod explain_error;
pub(crate) mod explanation;
pub(crate) mod plots;
pub(crate) mod sentences;
