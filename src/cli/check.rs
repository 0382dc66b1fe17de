//! `innovant check`.

use std::path::PathBuf;

use clap::Args;

use super::Outcome;
use super::output::print;
use super::plant::load;
use crate::report::text::plant_text;

const EXAMPLE: &str = "Example:
  innovant check plant.mo";

/// Check a plant in equations: what is read, units, the order of the equations, an equilibrium
///
/// The text is flat Modelica: parameters, inputs, outputs, variables, equations. Errors name line and column and say what to
/// write instead.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLE)]
pub(super) struct Flags {
    /// Plant: Modelica text, or what `innovant identify --structure` writes
    #[arg(value_name = "PLANT")]
    plant: PathBuf,
}

pub(super) fn run(flags: &Flags) -> anyhow::Result<Outcome> {
    let loaded = load(&flags.plant)?;
    print(&plant_text(&loaded.plant))?;
    Ok(Outcome::Done)
}
