//! What can be wrong with a document, and what to do about it.

use std::io;

use crate::limits::LimitError;

/// So many characters of what a document says are repeated in a message, at most.
const MOST_REPEATED: usize = 400;

/// What a document says, cut short where it is long.
pub(super) fn repeated(text: &str) -> String {
    match text.char_indices().nth(MOST_REPEATED) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}

/// A document that cannot be read, or a model that cannot be written as one.
///
/// A message starts with the file and, where there is one, line, column and key.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages explain the fields")]
pub enum DocumentError {
    /// It would take more memory than it may.
    #[error(transparent)]
    Limit(#[from] LimitError),
    /// The file does not exist or may not be read.
    #[error("{name}: cannot open: {source}; check the path and its permissions")]
    Open { name: String, source: io::Error },
    /// The bytes are no text.
    #[error(
        "{name}: this is not a JSON document but binary data; give the model that `innovant identify --output` wrote"
    )]
    NotText { name: String },
    /// The text is something else than JSON.
    #[error(
        "{name}: this is not a JSON document: it starts with `{start}`; give the model that `innovant identify --output` \
         wrote (for simulate and validate the model comes first, then the recording)"
    )]
    NotJson { name: String, start: String },
    /// JSON with a mistake in it, or the wrong type of value somewhere.
    #[error("{name}, line {line}, column {column}{key}: {message}; {advice}")]
    Broken {
        name: String,
        line: usize,
        column: usize,
        /// Empty, or `, key ...`.
        key: String,
        message: String,
        advice: &'static str,
    },
    /// A document of another kind or version.
    #[error("{name}: the format is `{found}`, and `{expected}` is needed; {advice}")]
    Format {
        name: String,
        found: String,
        expected: &'static str,
        advice: &'static str,
    },
    /// Values that do not fit together.
    #[error("{name}{place}, key `{key}`: {message}")]
    Content {
        name: String,
        /// Empty, or `, line .., column ..`.
        place: String,
        key: String,
        message: String,
    },
    /// A model holds a number that JSON has no word for.
    #[error("the model cannot be written: `{key}` is not finite; identify it with other options")]
    NotFinite { key: &'static str },
    /// The invariants of a model cannot be computed.
    #[error("the model cannot be described: {0}")]
    Invariants(#[from] crate::covariance::CovarianceError),
    /// The document cannot be turned into text.
    #[error("the document cannot be written as JSON: {0}")]
    Json(#[from] serde_json::Error),
}
