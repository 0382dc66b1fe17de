//! Reading a model document, with errors that say where and what to do.

use std::fs;
use std::io::{self, Read};
use std::path::Path;

use nalgebra::{DMatrix, DVector};
use serde::Deserialize;
use serde_json::error::Category;

use super::channels::{InputDocument, OutputDocument};
use super::model_document::{MODEL_FORMAT, ModelDocument};
use crate::identify::{IdentifiedChannel, Model, Summary};
use crate::limits;
use crate::linalg::Rows;
use crate::log::Channel;
use crate::model::{ModelError, StateSpace};
use crate::report::document_error::{DocumentError, repeated};
use crate::report::json_location::{offset, path_at, position_of};

/// What to do about a document that is JSON but no model.
const SEE_SCHEMA: &str = "a model needs at least A, B, C and dt (sample_time); `innovant schema model` prints the \
                          whole format";

/// Memory that a byte of a document takes at the peak, as text, as document and as model: 128 MB for 12 MB of zeros, the
/// shortest numbers there are.
const BYTES_A_BYTE: u64 = 10;

/// A model with what its document says beyond it.
#[derive(Debug, Clone)]
pub struct ReadModel {
    /// The model.
    pub model: Model,
    /// The document it was read from.
    pub document: ModelDocument,
}

/// Reads a model from a file; `-` is standard input.
///
/// # Errors
/// [`DocumentError`] names file, line, column and key.
pub fn read_model(path: &Path) -> Result<ReadModel, DocumentError> {
    let stdin = path.as_os_str() == "-";
    let name = if stdin {
        "standard input".to_owned()
    } else {
        path.display().to_string()
    };
    let length = fs::metadata(path).map_or(0, |about| about.len());
    limits::check(
        length.saturating_mul(BYTES_A_BYTE),
        None,
        || format!("{name}: reading a document of {}", limits::size(length)),
        || "give a model of a lower order".to_owned(),
    )?;
    let bytes = if stdin {
        let mut bytes = Vec::new();
        io::stdin().read_to_end(&mut bytes).map(|_| bytes)
    } else {
        fs::read(path)
    };
    let bytes = bytes.map_err(|source| DocumentError::Open {
        name: name.clone(),
        source,
    })?;
    let text =
        String::from_utf8(bytes).map_err(|_| DocumentError::NotText { name: name.clone() })?;
    parse_model(&name, &text)
}

/// Reads a model from text; `name` stands for the file in messages.
///
/// # Errors
/// [`DocumentError`] names file, line, column and key.
pub fn parse_model(name: &str, text: &str) -> Result<ReadModel, DocumentError> {
    #[derive(Deserialize)]
    struct Probe {
        #[serde(default)]
        format: Option<serde_json::Value>,
    }
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    if !text.trim_start().starts_with('{') {
        return Err(no_document(name, text));
    }
    let probe: Probe = serde_json::from_str(text).map_err(|error| broken(name, text, &error))?;
    if let Some(format) = probe.format
        && format != MODEL_FORMAT
    {
        return Err(wrong_format(name, &format));
    }
    let document: ModelDocument =
        serde_json::from_str(text).map_err(|error| broken(name, text, &error))?;
    let model = model(&document).map_err(|(key, message)| DocumentError::Content {
        name: name.to_owned(),
        place: position_of(text, &key)
            .map(|at| format!(", line {}, column {}", at.line, at.column))
            .unwrap_or_default(),
        key,
        message: repeated(&message),
    })?;
    Ok(ReadModel { model, document })
}

pub(crate) fn no_document(name: &str, text: &str) -> DocumentError {
    let name = name.to_owned();
    let line = text.lines().find(|line| !line.trim().is_empty());
    match line {
        Some(line) if line.chars().any(|c| c.is_control() && c != '\t') => {
            DocumentError::NotText { name }
        }
        Some(line) => DocumentError::NotJson {
            name,
            start: line.trim().chars().take(40).collect(),
        },
        None => DocumentError::Broken {
            name,
            line: 1,
            column: 1,
            key: String::new(),
            message: "the file is empty".to_owned(),
            advice: SEE_SCHEMA,
        },
    }
}

fn wrong_format(name: &str, format: &serde_json::Value) -> DocumentError {
    let found = format
        .as_str()
        .map_or_else(|| format.to_string(), str::to_owned);
    let advice = if found.starts_with("innovant-model/") {
        "it was written by another version of innovant: update this one, or identify the model again"
    } else if found.starts_with("innovant-explanation/") {
        "this is an explanation and not a model"
    } else {
        "this is another kind of document; leave `format` out of a model that another program wrote"
    };
    DocumentError::Format {
        name: name.to_owned(),
        found: repeated(&found),
        expected: MODEL_FORMAT,
        advice,
    }
}

/// What serde_json says, with the key added.
pub(crate) fn broken(name: &str, text: &str, error: &serde_json::Error) -> DocumentError {
    let (line, column) = (error.line(), error.column());
    let at = offset(text, line, column);
    let said = error.to_string();
    let said = said
        .rsplit_once(" at line ")
        .map_or(said.as_str(), |(said, _)| said);
    let missing = said.strip_prefix("missing field ");
    let word = word_at(text, at);
    let (message, advice) = match (missing, error.classify(), word) {
        (Some(key), ..) => (format!("there is no key {key}"), SEE_SCHEMA),
        (None, Category::Eof, _) => (
            "the document ends in the middle of a value".to_owned(),
            "the file is not whole: write or copy it again",
        ),
        (None, Category::Syntax, "NaN" | "Infinity" | "-Infinity" | "nan" | "inf") => (
            format!("`{word}` is not a finite number"),
            "JSON has no such number, and a model needs finite ones",
        ),
        (None, Category::Syntax, _) => (
            format!("this is not JSON: {said}"),
            "correct the document there, or write it again with `innovant identify --output`",
        ),
        (None, ..) => (said.to_owned(), SEE_SCHEMA),
    };
    // Where a key is missing, the position is the end of the object that lacks it.
    let path = match missing {
        Some(_) => path_at(text, at.saturating_sub(1)),
        None => path_at(text, at),
    };
    DocumentError::Broken {
        name: name.to_owned(),
        line,
        column,
        key: if path.is_empty() {
            String::new()
        } else {
            format!(", key `{}`", repeated(&path))
        },
        message: repeated(&message),
        advice,
    }
}

/// The word that `at` is in or just behind.
fn word_at(text: &str, at: usize) -> &str {
    let part = |c: char| c.is_ascii_alphanumeric() || c == '-';
    let at = (0..=at.min(text.len()))
        .rev()
        .find(|at| text.is_char_boundary(*at))
        .unwrap_or(0);
    let (before, after) = text.split_at(at);
    let start = before.rfind(|c| !part(c)).map_or(0, |last| {
        last + before[last..].chars().next().map_or(1, char::len_utf8)
    });
    let end = after.find(|c| !part(c)).unwrap_or(after.len());
    &text[start..at + end]
}

/// The model of a document, or the key that is wrong and why.
fn model(document: &ModelDocument) -> Result<Model, (String, String)> {
    let wrong = |key: &str, message: String| (key.to_owned(), message);
    let raw = |rows: &Rows| rows.0.clone();
    let a = raw(&document.a);
    let n = a.nrows();
    let d = document.d.as_ref().map(raw);
    // `[]` does not say how many columns it has: the other matrices do.
    let inputs = match (&document.inputs, &d) {
        (Some(inputs), _) => inputs.len(),
        (None, Some(d)) if document.b.0.is_empty() => d.ncols(),
        _ => document.b.0.ncols(),
    };
    let outputs = match &document.outputs {
        Some(outputs) => outputs.len(),
        None => document.c.0.nrows(),
    };
    let b = document.b.clone().shaped(n, inputs);
    let c = document.c.clone().shaped(outputs, n);
    let d = d.map_or_else(
        || DMatrix::zeros(c.nrows(), b.ncols()),
        |d| Rows(d).shaped(outputs, inputs),
    );
    let k = document
        .k
        .clone()
        .map_or_else(|| DMatrix::zeros(n, c.nrows()), |k| k.shaped(n, outputs));
    let system =
        StateSpace::new(a, b, c, d, k, document.sample_time).map_err(|error| match &error {
            ModelError::Shape { matrix, .. } | ModelError::NotFinite { matrix, .. } => {
                wrong(matrix, error.to_string())
            }
            ModelError::SampleTime { .. } => wrong(
                "sample_time",
                format!("{error}; a continuous-time model has to be sampled first"),
            ),
            _ => wrong("C", error.to_string()),
        })?;
    let (r, l) = (system.inputs(), system.outputs());

    let inputs = channels(
        document.inputs.as_deref(),
        ("inputs", "B", "column", 'u'),
        r,
        |input: InputDocument| input.into(),
    )?;
    let outputs = channels(
        document.outputs.as_deref(),
        ("outputs", "C", "row", 'y'),
        l,
        |output: OutputDocument| output.into(),
    )?;
    let innovation_covariance = match &document.innovation_covariance {
        None => None,
        Some(rows) if rows.0.shape() == (l, l) => Some(rows.0.clone()),
        Some(rows) => {
            return Err(wrong(
                "innovation_covariance",
                format!(
                    "it is {} x {}, but must be {l} x {l}: a row and a column for each output",
                    rows.0.nrows(),
                    rows.0.ncols()
                ),
            ));
        }
    };
    let initial_state = match &document.x0 {
        None => DVector::zeros(n),
        Some(x0) if x0.len() == n => DVector::from_column_slice(x0),
        Some(x0) => {
            return Err(wrong(
                "x0",
                format!("it has {} entries, but the model has {n} states", x0.len()),
            ));
        }
    };
    let covariance = document
        .covariance
        .as_ref()
        .map(|covariance| covariance.covariance(n, r, l))
        .transpose()
        .map_err(|message| wrong("covariance", message))?;
    Ok(Model {
        system,
        inputs,
        outputs,
        innovation_covariance,
        initial_state,
        covariance,
        summary: summary(document),
        recordings: document
            .provenance
            .as_ref()
            .map(|p| p.recordings.clone())
            .unwrap_or_default(),
    })
}

/// Named channels, or `u1`, `u2`, ... when the document names none.
fn channels<D: Clone>(
    named: Option<&[D]>,
    (key, matrix, line, letter): (&str, &str, &str, char),
    count: usize,
    convert: impl Fn(D) -> IdentifiedChannel,
) -> Result<Vec<IdentifiedChannel>, (String, String)> {
    let Some(named) = named else {
        return Ok((1..=count)
            .map(|i| IdentifiedChannel {
                channel: Channel::new(format!("{letter}{i}")),
                level: 0.0,
                delay: 0,
            })
            .collect());
    };
    if named.len() != count {
        return Err((
            key.to_owned(),
            format!(
                "there are {} of them, but {matrix} has {count} {line}{}",
                named.len(),
                if count == 1 { "" } else { "s" }
            ),
        ));
    }
    let channels: Vec<IdentifiedChannel> = named.iter().cloned().map(convert).collect();
    for (i, one) in channels.iter().enumerate() {
        if channels[..i]
            .iter()
            .any(|other| other.channel.name == one.channel.name)
        {
            return Err((
                key.to_owned(),
                format!(
                    "two of them are called `{}`; names must differ",
                    one.channel.name
                ),
            ));
        }
    }
    Ok(channels)
}

/// How the model came about, when the document says all of it.
fn summary(document: &ModelDocument) -> Option<Summary> {
    Some(Summary {
        method: document.method?,
        stochastic: document.stochastic,
        weight: document.weight?,
        polished: document.polished?,
        order: document.order?,
        horizons: document.horizons?,
        samples: document.samples?,
        degrees_of_freedom: document.degrees_of_freedom?,
        options: document.options.clone()?,
        diagnostics: document.diagnostics.clone()?.fit,
        explanation: document.explanation.clone()?,
        warnings: document.warnings.clone()?,
    })
}
