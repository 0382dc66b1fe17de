//! `innovant reproduce`.

use std::fs;
use std::io::{self, IsTerminal};
use std::path::{Path, PathBuf};

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};

use super::terminal::{Output, note, print};
use super::{Outcome, Verbosity};
use crate::report::text::reproduction_text;
use crate::report::{reproduction_csv, reproduction_page, to_json};
use crate::reproduce::{Experiment, Reproduction, Study, experiment, experiments};

const EXAMPLE: &str = "Examples:
  innovant reproduce van-wingerden-1 --output-dir pages
  innovant reproduce all --runs 200 --threads 2

Each experiment writes NAME.html (a page with the figures of the paper), NAME.csv (all numbers) and NAME.json
(everything). It prints what the paper says, what is found here, and whether they agree. The same seed gives the
same files, on any number of threads.";

/// Reproduce the experiments of three papers: their tables and figures beside the printed ones
#[derive(Debug, Args)]
#[command(after_help = EXAMPLE)]
pub(super) struct Flags {
    /// Names of experiments, or `all`; without a name, a list of them
    #[arg(value_name = "EXPERIMENT")]
    experiments: Vec<String>,
    /// Number of Monte Carlo runs [default: that of the paper]
    #[arg(long, value_name = "N")]
    runs: Option<usize>,
    /// Seed of the runs
    #[arg(long, value_name = "SEED", default_value = "1")]
    seed: u64,
    /// Folder for the files; created if missing
    #[arg(short, long, value_name = "DIR", default_value = "reproduction")]
    output_dir: PathBuf,
}

/// The three files of an experiment.
struct Files {
    page: Output,
    numbers: Output,
    document: Output,
}

impl Files {
    fn check(folder: &Path, name: &str) -> anyhow::Result<Self> {
        let file =
            |extension: &str| Output::check(&folder.join(format!("{name}.{extension}")), &[]);
        Ok(Self {
            page: file("html")?,
            numbers: file("csv")?,
            document: file("json")?,
        })
    }

    /// Everything is made before the first file is written.
    fn write(&self, found: &Reproduction) -> anyhow::Result<()> {
        let page = reproduction_page(found)?;
        let numbers = reproduction_csv(found)?;
        let document = to_json(found)?;
        self.numbers.write(&numbers)?;
        self.document.write(&document)?;
        self.page.write(&page)?;
        Ok(())
    }
}

pub(super) fn run(flags: Flags, say: Verbosity) -> anyhow::Result<Outcome> {
    if flags.experiments.is_empty() {
        print(&list())?;
        return Ok(Outcome::Done);
    }
    let chosen = chosen(&flags.experiments)?;
    fs::create_dir_all(&flags.output_dir).map_err(|error| {
        anyhow::anyhow!(
            "{}: the folder cannot be made ({error}); choose another with --output-dir",
            flags.output_dir.display()
        )
    })?;
    let files = chosen
        .iter()
        .map(|e| Files::check(&flags.output_dir, e.name()))
        .collect::<anyhow::Result<Vec<Files>>>()?;
    for (experiment, files) in chosen.into_iter().zip(files) {
        let bar = bar(experiment, flags.runs, say.quiet);
        let progress = || {
            if let Some(bar) = &bar {
                bar.inc(1);
            }
        };
        let study = Study {
            runs: flags.runs,
            seed: flags.seed,
            progress: &progress,
        };
        let found = experiment.reproduce(&study);
        if let Some(bar) = &bar {
            bar.finish_and_clear();
        }
        let found = found?;
        files.write(&found)?;
        if !say.quiet {
            print(&format!("{}\n", reproduction_text(&found)))?;
            print(&format!("  {}\n\n", files.page.path().display()))?;
        }
        if say.verbose {
            note(&format!(
                "wrote {}, {} and {}\n",
                files.page.path().display(),
                files.numbers.path().display(),
                files.document.path().display()
            ));
        }
    }
    Ok(Outcome::Done)
}

/// The experiments of these names, in the order of the papers for `all`.
fn chosen(names: &[String]) -> anyhow::Result<Vec<&'static dyn Experiment>> {
    if names.iter().any(|name| name == "all") {
        return Ok(experiments());
    }
    let mut chosen: Vec<&'static dyn Experiment> = Vec::with_capacity(names.len());
    for name in names {
        let Some(found) = experiment(name) else {
            let known: Vec<&str> = experiments().iter().map(|e| e.name()).collect();
            anyhow::bail!(
                "there is no experiment `{name}`; choose from {}, or `all`",
                known.join(", ")
            );
        };
        if !chosen.iter().any(|e| e.name() == found.name()) {
            chosen.push(found);
        }
    }
    Ok(chosen)
}

fn list() -> String {
    let mut text = String::from("Experiments:\n");
    for experiment in experiments() {
        text.push_str(&format!(
            "  {:<18}{} ({} runs)\n",
            experiment.name(),
            experiment.title(),
            experiment.paper_runs()
        ));
    }
    text.push_str(
        "\nRun one with `innovant reproduce NAME`, all of them with `innovant reproduce all`.\n",
    );
    text
}

/// A bar over the runs, on a terminal.
fn bar(experiment: &dyn Experiment, runs: Option<usize>, quiet: bool) -> Option<ProgressBar> {
    if quiet || !io::stderr().is_terminal() {
        return None;
    }
    let runs = experiment.runs_of(runs.unwrap_or(experiment.paper_runs()));
    let bar = ProgressBar::new(runs as u64);
    if let Ok(style) = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} runs, {eta} left")
    {
        bar.set_style(style);
    }
    bar.set_message(experiment.name());
    Some(bar)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_found_once() {
        let names =
            |list: &[&str]| -> Vec<String> { list.iter().map(|n| (*n).to_owned()).collect() };
        let twice = chosen(&names(&["van-wingerden-2", "van-wingerden-2"])).unwrap();
        assert_eq!(twice.len(), 1);
        let all = chosen(&names(&["all"])).unwrap();
        assert_eq!(all.len(), experiments().len());
        let error = chosen(&names(&["van-wingerden"]))
            .err()
            .unwrap()
            .to_string();
        assert!(error.contains("van-wingerden-1"), "{error}");
    }
}
