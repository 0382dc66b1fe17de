//! Many logs: a model of each.
//!
//! Logs are identified in parallel, each by itself, so that the result of one does not depend on the others nor on the
//! number of threads. A model is written as soon as it is made, whole or not at all; one that is there already is kept
//! when it was made from the same bytes with the same options. What goes wrong with a log is told in its row of the
//! summary and stops nothing else.
//!
//! | file | one idea |
//! |---|---|
//! | `job` | one log: its model from before, or a new one |
//! | `row` | what is said of it |
//! | `summary_csv` | all rows as CSV |

mod job;
mod row;
mod summary_csv;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use crate::identify::Options;
use crate::limits::{LimitError, memory_limit};
use crate::log::Roles;

pub(crate) use row::{Row, Status};
pub(crate) use summary_csv::summary_csv;

/// How many logs are to be identified.
#[derive(Debug, Clone, Default)]
pub(crate) struct Batch {
    /// Where the models go: the name of a log with `.json` in the place of `.csv`.
    pub(crate) output_dir: PathBuf,
    /// Column roles, of every log.
    pub(crate) roles: Roles,
    /// Options of every identification.
    pub(crate) options: Options,
    /// Identifies again also what is there already.
    pub(crate) again: bool,
}

/// Why a batch cannot be begun.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages explain the fields")]
pub(crate) enum BatchError {
    /// Two models would go into one file.
    #[error(
        "{first} and {second} would both become {model}: rename one of them, or run two batches with two output \
         directories"
    )]
    SameModel {
        first: PathBuf,
        second: PathBuf,
        model: PathBuf,
    },
    /// A model would replace a log.
    #[error("{log}: its model would be written over it; choose another --output-dir")]
    OverLog { log: PathBuf },
    /// The limit of memory cannot be read.
    #[error(transparent)]
    Limit(#[from] LimitError),
    /// The directory cannot be made.
    #[error("{path}: cannot make this directory: {source}; choose another --output-dir")]
    Directory {
        path: PathBuf,
        source: std::io::Error,
    },
}

/// Identifies a model of each log and writes it; `done` is told of each as it ends, from any thread.
///
/// The rows come back in the order of the logs.
///
/// # Errors
/// [`BatchError`] before any work, when two models would have one name or the directory cannot be made. What goes wrong
/// with one log is in its [`Row`].
pub(crate) fn run(
    logs: &[PathBuf],
    batch: &Batch,
    done: &(dyn Fn(&Row) + Sync),
) -> Result<Vec<Row>, BatchError> {
    let models = model_paths(logs, &batch.output_dir)?;
    fs::create_dir_all(&batch.output_dir).map_err(|source| BatchError::Directory {
        path: batch.output_dir.clone(),
        source,
    })?;
    // As many logs as there are threads are in memory at once.
    let share = match batch.options.memory_limit {
        Some(bytes) => bytes,
        None => memory_limit()?.bytes / rayon::current_num_threads() as u64,
    };
    let batch = &Batch {
        options: Options {
            memory_limit: Some(share),
            ..batch.options.clone()
        },
        ..batch.clone()
    };
    Ok(logs
        .par_iter()
        .zip(&models)
        .map(|(log, model)| {
            let row = job::run(log, model, batch);
            done(&row);
            row
        })
        .collect())
}

/// Where the model of each log goes.
fn model_paths(logs: &[PathBuf], folder: &Path) -> Result<Vec<PathBuf>, BatchError> {
    let mut taken: BTreeMap<PathBuf, &PathBuf> = BTreeMap::new();
    logs.iter()
        .map(|log| {
            let model = folder.join(format!("{}.json", stem(log)));
            if let Some(first) = taken.insert(model.clone(), log) {
                return Err(BatchError::SameModel {
                    first: first.clone(),
                    second: log.clone(),
                    model,
                });
            }
            if *log == model {
                return Err(BatchError::OverLog { log: log.clone() });
            }
            Ok(model)
        })
        .collect()
}

/// The name of a log without `.csv` and `.gz`.
fn stem(log: &Path) -> String {
    let name = log
        .file_name()
        .map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    let bare = name.strip_suffix(".gz").unwrap_or(&name);
    let cut = bare.len().saturating_sub(4);
    match bare.get(cut..) {
        Some(end) if cut > 0 && end.eq_ignore_ascii_case(".csv") => bare[..cut].to_owned(),
        _ => bare.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn models_are_called_as_their_logs() {
        for (log, expected) in [
            ("logs/monday.csv", "monday"),
            ("monday.CSV", "monday"),
            ("a.b.csv.gz", "a.b"),
            ("trace.txt", "trace.txt"),
            (".csv", ".csv"),
        ] {
            assert_eq!(stem(Path::new(log)), expected);
        }
    }

    #[test]
    fn two_logs_of_one_name_are_refused() {
        let logs = ["a/x.csv".into(), "b/x.csv.gz".into()];
        let error = model_paths(&logs, Path::new("out")).unwrap_err();
        assert!(
            error.to_string().contains("a/x.csv and b/x.csv.gz"),
            "{error}"
        );
    }
}
