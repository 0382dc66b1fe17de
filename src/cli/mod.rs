//! The command line: one file a subcommand; those that only print what the program knows stand in `reference`, those of
//! plants in equations in `plant`, external simulators in `simulator`.
//!
//! Flags are parsed by clap into one type and then checked into a second, which says what to do without any
//! further question (as ripgrep does). Exit codes: 0 done, 1 the model was rejected, 2 an error, with one
//! message on standard error. If the reader of standard output has gone (`innovant ... | head`), the command
//! succeeds.

mod align;
mod batch;
mod check;
mod explain;
mod flags;
mod identify;
mod plant;
mod reference;
mod reproduce;
mod response_csv;
mod show;
mod simulate;
mod simulator;
mod terminal;
mod validate;

use std::ffi::OsString;
use std::io;
use std::process::ExitCode;

use clap::{Args, CommandFactory, Parser, Subcommand};

use crate::log::LogError;
use flags::Resources;

/// What is said above the list of commands.
const ABOUT: &str = "State-space models with uncertainty from recordings, in open or closed loop";

/// What is said below it.
const EXAMPLE: &str = "Example:
  innovant identify log.csv --output model.json    columns u* are inputs, y* outputs, t is time
  innovant validate model.json fresh.csv           does the model hold on another recording?
  innovant explain log.csv --simulation sim.csv    what does the simulation lack?
  innovant simulate model.json input.csv > out.csv
  innovant show model.json
  innovant identify log.csv --structure plant.mo   parameters of your own equations
  innovant batch logs/*.csv --output-dir models    a model of each of many logs
  innovant reproduce all                           tables and figures of three papers, computed again

Exit codes: 0 done; 1 the model or simulation was rejected; 2 an error.";

#[derive(Debug, Parser)]
#[command(name = "innovant", version, about = ABOUT, after_help = EXAMPLE, max_term_width = 100)]
struct Cli {
    #[command(flatten)]
    verbosity: Verbosity,
    #[command(flatten)]
    resources: Resources,
    #[command(subcommand)]
    command: Option<Command>,
}

/// How much is said.
#[derive(Debug, Clone, Copy, Args)]
struct Verbosity {
    /// Print errors only: no table, no progress, no notes
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    quiet: bool,
    /// Report progress in words on standard error
    #[arg(short, long, global = true)]
    verbose: bool,
}

#[derive(Debug, Subcommand)]
enum Command {
    Identify(identify::Flags),
    Batch(batch::Flags),
    Explain(explain::Flags),
    Effects(reference::effects::Flags),
    Validate(validate::Flags),
    Simulate(simulate::Flags),
    Check(check::Flags),
    Show(show::Flags),
    Reproduce(reproduce::Flags),
    Schema(reference::schema::Flags),
    Completions(reference::completions::Flags),
}

/// How a command ended, if not in an error.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Outcome {
    Done,
    Rejected,
}

/// Runs the command line `arguments` (the first is the program's name).
pub fn run<I, T>(arguments: I) -> ExitCode
where
    I: IntoIterator<Item = T>,
    T: Into<OsString> + Clone,
{
    let cli = match Cli::try_parse_from(arguments) {
        Ok(cli) => cli,
        Err(message) => {
            // Help and version go to standard output and are no error.
            let _ = message.print();
            return ExitCode::from(if message.use_stderr() { 2 } else { 0 });
        }
    };
    match dispatch(cli) {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::Rejected) => ExitCode::from(1),
        Err(error) if is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            // The messages of the library hold their causes already.
            terminal::note(&format!("error: {error}\n"));
            ExitCode::from(2)
        }
    }
}

fn dispatch(cli: Cli) -> anyhow::Result<Outcome> {
    let say = cli.verbosity;
    cli.resources.apply()?;
    match cli.command {
        None => {
            terminal::print(&command().render_help().to_string())?;
            Ok(Outcome::Done)
        }
        Some(Command::Identify(flags)) => identify::run(flags, say),
        Some(Command::Batch(flags)) => batch::run(flags, say),
        Some(Command::Explain(flags)) => explain::run(flags, say),
        Some(Command::Effects(flags)) => reference::effects::run(&flags),
        Some(Command::Validate(flags)) => validate::run(flags, say),
        Some(Command::Simulate(flags)) => simulate::run(flags, say),
        Some(Command::Check(flags)) => check::run(&flags, say),
        Some(Command::Show(flags)) => show::run(flags, say),
        Some(Command::Reproduce(flags)) => reproduce::run(flags, say),
        Some(Command::Schema(flags)) => reference::schema::run(&flags),
        Some(Command::Completions(flags)) => reference::completions::run(&flags),
    }
}

/// The command line as clap knows it.
fn command() -> clap::Command {
    Cli::command()
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error.chain().any(|cause| {
        cause
            .downcast_ref::<LogError>()
            .is_some_and(LogError::is_broken_pipe)
            || cause
                .downcast_ref::<io::Error>()
                .is_some_and(|io| io.kind() == io::ErrorKind::BrokenPipe)
    })
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_command_line_is_consistent() {
        super::command().debug_assert();
    }
}
