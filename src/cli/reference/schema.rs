//! `innovant schema`.

use clap::{Args, ValueEnum};

use crate::cli::Outcome;
use crate::cli::terminal::print;
use crate::explain::Explanation;
use crate::report::{
    LinearisationDocument, ModelDocument, PlantDocument, PlantValidation, ValidationDocument,
    schema,
};
use crate::reproduce::Reproduction;
use crate::validate::Validation;

const EXAMPLE: &str = "Example:
  innovant schema model > innovant-model-1.schema.json";

/// Print the JSON Schema of a document
#[derive(Debug, Args)]
#[command(after_help = EXAMPLE)]
pub(crate) struct Flags {
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
    /// innovant-validation/1, what `innovant validate MODEL --format json` prints
    Validation,
    /// innovant-plant-validation/1, what it prints of a plant in equations
    PlantValidation,
    /// innovant-linearisation/1, what `innovant show PLANT --format json` prints
    Linearisation,
    /// innovant-reproduction/1, what `innovant reproduce` writes
    Reproduction,
}

pub(crate) fn run(flags: &Flags) -> anyhow::Result<Outcome> {
    print(&match flags.document {
        Document::Model => schema::<ModelDocument>(),
        Document::Explanation => schema::<Explanation>(),
        Document::Plant => schema::<PlantDocument>(),
        Document::Validation => schema::<ValidationDocument<Validation>>(),
        Document::PlantValidation => schema::<ValidationDocument<PlantValidation>>(),
        Document::Linearisation => schema::<LinearisationDocument>(),
        Document::Reproduction => schema::<Reproduction>(),
    }?)?;
    Ok(Outcome::Done)
}
