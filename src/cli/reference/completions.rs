//! `innovant completions`.

use clap::Args;
use clap_complete::{Shell, generate};

use crate::cli::Outcome;
use crate::cli::terminal::print;

const EXAMPLE: &str = "Example:
  innovant completions bash > ~/.local/share/bash-completion/completions/innovant";

/// Print completions for a shell
#[derive(Debug, Args)]
#[command(after_help = EXAMPLE)]
pub(crate) struct Flags {
    /// Shell
    shell: Shell,
}

pub(crate) fn run(flags: &Flags) -> anyhow::Result<Outcome> {
    let mut text = Vec::new();
    generate(
        flags.shell,
        &mut crate::cli::command(),
        "innovant",
        &mut text,
    );
    print(&String::from_utf8_lossy(&text))?;
    Ok(Outcome::Done)
}
