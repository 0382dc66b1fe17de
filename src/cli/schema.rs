//! `innovant schema`.

use clap::{Args, ValueEnum};

use super::Outcome;
use super::output::print;
use crate::report::{explanation_schema, model_schema, plant_schema, reproduction_schema};

const EXAMPLE: &str = "Example:
  innovant schema model > innovant-model-1.schema.json";

/// Print the JSON Schema of a document
#[derive(Debug, Args)]
#[command(after_help = EXAMPLE)]
pub(super) struct Flags {
    /// Kind of document
    document: Document,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Document {
    /// innovant-model/1, what `innovant identify --output` writes
    Model,
    /// innovant-explanation/1, what `innovant explain --output` writes
    Explanation,
    /// innovant-plant/1, what `innovant identify --structure` writes
    Plant,
    /// innovant-reproduction/1, what `innovant reproduce` writes
    Reproduction,
}

pub(super) fn run(flags: &Flags) -> anyhow::Result<Outcome> {
    match flags.document {
        Document::Model => print(&model_schema()?)?,
        Document::Explanation => print(&explanation_schema()?)?,
        Document::Plant => print(&plant_schema()?)?,
        Document::Reproduction => print(&reproduction_schema()?)?,
    }
    Ok(Outcome::Done)
}
