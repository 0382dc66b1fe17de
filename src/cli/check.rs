//! `innovant check`.

use std::path::PathBuf;

use clap::Args;

use super::plant::{load, tell_warnings};
use super::terminal::print;
use super::{Outcome, Verbosity};
use crate::report::text::plant_text;

const EXAMPLE: &str = "Example:
  innovant check plant.mo";

/// Check a plant in equations: declarations, units, order of the equations, an equilibrium
///
/// The text is flat Modelica: parameters, inputs, outputs, variables, equations. Errors name the line and the column, and say
/// what to write instead.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLE)]
pub(super) struct Flags {
    /// Plant: Modelica text, or what `innovant identify --structure` writes
    #[arg(value_name = "PLANT")]
    plant: PathBuf,
}

pub(super) fn run(flags: &Flags, say: Verbosity) -> anyhow::Result<Outcome> {
    let loaded = load(&flags.plant)?;
    tell_warnings(&loaded, say);
    print(&plant_text(&loaded.plant))?;
    Ok(Outcome::Done)
}
