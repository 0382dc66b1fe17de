//! The document.

pub(crate) mod channel_units;
pub(crate) mod explain_error;
pub(crate) mod explanation;
pub(crate) mod plots;
pub(crate) mod sentences;
