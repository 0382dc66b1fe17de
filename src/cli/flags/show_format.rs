//! In which form a model is shown.

use clap::ValueEnum;

/// Values of `innovant show --format`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ShowFormat {
    Text,
    Json,
    Csv,
    Modelica,
}
