//! The `innovant` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    innovant::internal::cli::run(std::env::args_os())
}
