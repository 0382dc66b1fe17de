//! `innovant batch`.

use std::path::PathBuf;

use clap::Args;

use super::flags::{ModelFlags, RoleFlags};
use super::terminal::{Progress, check_distinct, note, print};
use super::{Outcome, Verbosity};
use crate::batch::{Batch, Row, Status, run as run_batch, summary_csv};
use crate::log::{Source, write_file_atomically};

/// The summary in the output directory.
const SUMMARY: &str = "summary.csv";

const EXAMPLE: &str = "Examples:
  innovant batch logs/*.csv --output-dir models
  innovant batch logs/*.csv.gz --inputs voltage --outputs speed --order 4 --output-dir models

A log called monday.csv becomes DIR/monday.json; DIR/summary.csv has a line for each log. Run again after an
interruption or with more logs, it makes only what is missing: a model is kept when it was made from the same bytes
(by SHA-256) with the same options by the same version.

Exit codes: 0 every log has a model; 1 some have none (the summary and standard error say why); 2 an error.";

/// Identify a model of each of many logs, in parallel; resumable
///
/// The logs are independent: one model per log. (For one model from several experiments, use `innovant identify`.) A log
/// that cannot be identified does not stop the others.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLE)]
pub(super) struct Flags {
    /// Logs: CSV, also gzipped
    #[arg(value_name = "LOG", required = true)]
    logs: Vec<PathBuf>,
    /// Folder for the models and the summary; created if missing
    #[arg(short, long, value_name = "DIR")]
    output_dir: PathBuf,
    #[command(flatten)]
    roles: RoleFlags,
    #[command(flatten)]
    model: ModelFlags,
    /// Identify all logs again, also those that have a model already
    #[arg(long)]
    again: bool,
}

pub(super) fn run(flags: Flags, say: Verbosity) -> anyhow::Result<Outcome> {
    if flags.logs.iter().any(|log| log.as_os_str() == "-") {
        anyhow::bail!("`-`: a batch reads files, because it names its models after them");
    }
    let sources: Vec<Source> = flags.logs.iter().cloned().map(Source::from).collect();
    check_distinct(&sources)?;
    let batch = Batch {
        output_dir: flags.output_dir,
        roles: flags.roles.roles(),
        options: flags.model.options(),
        again: flags.again,
    };
    let progress = Progress::counting(flags.logs.len(), "logs", say.quiet);
    let rows = run_batch(&flags.logs, &batch, &|row: &Row| {
        progress.aside(|| tell(row, say));
        progress.one_more();
    })?;
    progress.finish();
    let path = batch.output_dir.join(SUMMARY);
    write_file_atomically(&path, summary_csv(&rows)?.as_bytes())?;
    let count = |status: Status| rows.iter().filter(|row| row.status == status).count();
    let failed = count(Status::Failed);
    if !say.quiet {
        print(&format!(
            "{} identified, {} kept from before, {failed} failed; written to {}\n",
            count(Status::Identified),
            count(Status::Kept),
            path.display()
        ))?;
    }
    Ok(if failed > 0 {
        Outcome::Rejected
    } else {
        Outcome::Done
    })
}

/// What went wrong is told at once; with `-v` also what went well.
fn tell(row: &Row, say: Verbosity) {
    match row.status {
        // The messages of the log module name their file already.
        Status::Failed if row.message.starts_with(&row.name) => {
            note(&format!("error: {}\n", row.message));
        }
        Status::Failed => note(&format!("error: {}: {}\n", row.name, row.message)),
        Status::Kept if say.verbose => note(&format!("{}: kept\n", row.name)),
        Status::Identified if say.verbose => {
            note(&format!(
                "{}: {}, {:.3} s\n",
                row.name, row.verdict, row.seconds
            ));
        }
        _ => {}
    }
}
