//! `innovant completions`.

use clap::Args;
use clap_complete::{Shell, generate};

use super::Outcome;
use super::output::print;

const EXAMPLE: &str = "Example:
  innovant completions bash > ~/.local/share/bash-completion/completions/innovant";

/// Print completions for a shell
#[derive(Debug, Args)]
#[command(after_help = EXAMPLE)]
pub(super) struct Flags {
    /// Shell
    shell: Shell,
}

pub(super) fn run(flags: &Flags) -> anyhow::Result<Outcome> {
    let mut text = Vec::new();
    generate(flags.shell, &mut super::command(), "innovant", &mut text);
    print(&String::from_utf8_lossy(&text))?;
    Ok(Outcome::Done)
}
