//! `innovant effects`.

use clap::Args;

use crate::cli::Outcome;
use crate::cli::terminal::print;
use crate::report::text::effects_text;

const EXAMPLE: &str = "Examples:
  innovant effects                    ids and titles
  innovant effects quadratic_drag     equation, what imitates it, which recording separates them

The first list is for plants in equations (.mo), the second for linear models and columns of outputs.";

/// List the effects that `explain` can name, or describe one of them
#[derive(Debug, Args)]
#[command(after_help = EXAMPLE)]
pub(crate) struct Flags {
    /// Id of an effect
    #[arg(value_name = "ID")]
    id: Option<String>,
}

pub(crate) fn run(flags: &Flags) -> anyhow::Result<Outcome> {
    print(&effects_text(flags.id.as_deref())?)?;
    Ok(Outcome::Done)
}
