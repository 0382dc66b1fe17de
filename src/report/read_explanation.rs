//! Reading an explanation document.

use std::fs;
use std::path::Path;

use super::document_error::{DocumentError, repeated};
use super::json_location::position_of;
use super::model::{broken, no_document};
use crate::explain::{AugmentedModel, EXPLANATION_FORMAT, Explanation};

/// Whether `text` is JSON that calls itself an explanation.
pub fn is_explanation(text: &str) -> bool {
    #[derive(serde::Deserialize)]
    struct Probe {
        format: String,
    }
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    serde_json::from_str::<Probe>(text).is_ok_and(|p| p.format.starts_with("innovant-explanation/"))
}

/// Reads an explanation from a file.
///
/// # Errors
/// [`DocumentError`] names file, line, column and key.
pub fn read_explanation(path: &Path) -> Result<Explanation, DocumentError> {
    let name = path.display().to_string();
    let bytes = fs::read(path).map_err(|source| DocumentError::Open {
        name: name.clone(),
        source,
    })?;
    let text =
        String::from_utf8(bytes).map_err(|_| DocumentError::NotText { name: name.clone() })?;
    parse_explanation(&name, &text)
}

/// Reads an explanation from text; `name` stands for the file in messages.
///
/// # Errors
/// [`DocumentError`] names file, line, column and key.
pub fn parse_explanation(name: &str, text: &str) -> Result<Explanation, DocumentError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    if !text.trim_start().starts_with('{') {
        return Err(no_document(name, text));
    }
    let explanation: Explanation =
        serde_json::from_str(text).map_err(|error| advised(broken(name, text, &error)))?;
    if explanation.format != EXPLANATION_FORMAT {
        return Err(DocumentError::Format {
            name: name.to_owned(),
            found: repeated(&explanation.format),
            expected: EXPLANATION_FORMAT,
            advice: "it was written by another version of innovant: update this one, or explain the recording again",
        });
    }
    if explanation.model.is_none() && explanation.plant.is_none() {
        let end = text.trim_end();
        return Err(advised(DocumentError::Broken {
            name: name.to_owned(),
            line: end.lines().count().max(1),
            column: end.lines().last().map_or(0, |l| l.chars().count()),
            key: String::new(),
            message: "there is no key `model`".to_owned(),
            advice: "",
        }));
    }
    explanation
        .model
        .as_ref()
        .map_or(Ok(()), AugmentedModel::check)
        .map_err(|error| DocumentError::Content {
            name: name.to_owned(),
            place: position_of(text, "model")
                .map(|at| format!(", line {}, column {}", at.line, at.column))
                .unwrap_or_default(),
            key: "model".to_owned(),
            message: repeated(&error.to_string()),
        })?;
    Ok(explanation)
}

/// The same error with advice that fits an explanation.
fn advised(error: DocumentError) -> DocumentError {
    match error {
        DocumentError::Broken {
            name,
            line,
            column,
            key,
            message,
            ..
        } => DocumentError::Broken {
            name,
            line,
            column,
            key,
            message,
            advice: "write it again with `innovant explain --output`; `innovant schema explanation` prints the format",
        },
        other => other,
    }
}
