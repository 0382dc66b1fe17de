//! What is said of one log.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::identify::Model;
use crate::report::text::{findings, verdict};
use crate::validate::Validation;

/// What became of a log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Status {
    /// A model was made.
    Identified,
    /// The model that was there already, made from the same bytes with the same options.
    Kept,
    /// There is none; the message says why.
    Failed,
}

/// A row of the summary. What a log without a model does not have is empty.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Row {
    /// The log, as it was named.
    pub(crate) name: String,
    /// What became of it.
    pub(crate) status: Status,
    /// Order of the model.
    pub(crate) order: Option<usize>,
    /// Samples of the log.
    pub(crate) samples: Option<usize>,
    /// Fit one step ahead in percent.
    pub(crate) fit_percent: Option<f64>,
    /// Fit of the free run in percent; empty also where there is no free run.
    pub(crate) free_run_fit_percent: Option<f64>,
    /// One sentence: what the model is, and whether to trust it.
    pub(crate) verdict: String,
    /// What the tests found, and what to know before trusting the model; separated by `; `.
    pub(crate) findings: String,
    /// Wall-clock time it took.
    pub(crate) seconds: f64,
    /// What went wrong.
    pub(crate) message: String,
}

impl Row {
    /// That of a log with a model.
    pub(super) fn of_model(
        log: &Path,
        status: Status,
        model: &Model,
        tests: Option<&Validation>,
    ) -> Self {
        let summary = model.summary.as_ref();
        let read = model.recordings.first().and_then(|r| r.reading.clone());
        let found: Vec<String> = read
            .into_iter()
            .chain(summary.into_iter().flat_map(|s| s.warnings.iter().cloned()))
            .chain(tests.into_iter().flat_map(findings))
            .collect();
        Self {
            name: log.display().to_string(),
            status,
            order: Some(model.system.states()),
            samples: summary.map(|s| s.samples),
            fit_percent: tests.map(|t| t.one_step.fit_percent),
            free_run_fit_percent: tests.and_then(|t| Some(t.free_run.as_ref()?.fit_percent)),
            verdict: verdict(model, tests),
            findings: found.join("; "),
            seconds: 0.0,
            message: String::new(),
        }
    }

    /// That of a log that gave no model.
    pub(super) fn failed(log: &Path, message: String) -> Self {
        Self {
            name: log.display().to_string(),
            status: Status::Failed,
            order: None,
            samples: None,
            fit_percent: None,
            free_run_fit_percent: None,
            verdict: String::new(),
            findings: String::new(),
            seconds: 0.0,
            message,
        }
    }
}
