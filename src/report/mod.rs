//! Documents and tables: a model as JSON (`innovant-model/1`), as a JSON Schema, and as text for people.
//!
//! | folder or file   | one idea                                                          |
//! |------------------|-------------------------------------------------------------------|
//! | `model`          | `innovant-model/1`: its keys; text to model, with errors that name line, column and key |
//! | `plant`          | `innovant-plant/1`, its external simulator, its fit; a plant at an operating point; the judgement of a plant on recordings |
//! | `validation_document` | what `validate` writes                                       |
//! | `read_explanation` | text to explanation                                             |
//! | `reproduction_csv` | all numbers of a reproduction as one long table                 |
//! | `json_schema`    | the JSON Schema                                                   |
//! | `json_layout`    | how JSON is laid out; `json_location`: where in it something stands |
//! | `text`           | tables for a terminal                                             |
//! | `page`           | pages of identifications, explanations and reproductions          |
//! | `overview`       | envelopes and spectra of a recording, gathered while it is read   |
//!
//! # The same input gives the same bytes
//! Documents and pages hold no time, no host and nothing that depends on the number of threads: the same version of the
//! program makes the same bytes of the same files and the same request on the same kind of processor
//! (`tests/cli/reproducible.rs`). Where a document comes from stands in one place, and is all that may differ when the same
//! bytes come under another name or are asked for in other words: `provenance` of a model (`tool`, `version`,
//! `recordings` with name and SHA-256, `request`); `version` and `recordings` of an explanation; `model` and `recordings`
//! of a validation. Of the summary of a batch `status` and `seconds` are of the run.

mod document_error;
mod json_layout;
mod json_location;
mod json_schema;
mod model;
mod overview;
#[cfg(feature = "report")]
mod page;
pub(crate) mod plant;
mod read_explanation;
#[cfg(feature = "cli")]
mod reproduction_csv;
pub(crate) mod text;
mod validation_document;

pub use crate::linalg::Rows;
pub use document_error::DocumentError;
pub use json_layout::to_json;
pub use json_schema::schema;
pub use model::{
    CovarianceDocument, DiagnosticsDocument, InputDocument, InvariantsDocument, MODEL_FORMAT,
    ModelDocument, OutputDocument, Provenance, ReadModel, Request, parse_model, read_model,
};
pub use overview::{Excitation, Experiment, Overview, Watched};
#[cfg(feature = "report")]
pub use page::PageError;
#[cfg(feature = "report")]
pub use page::explanation::explanation_page;
#[cfg(feature = "report")]
pub use page::identification::identification_page;
#[cfg(feature = "report")]
pub use page::plant::plant_page;
#[cfg(feature = "cli")]
pub(crate) use page::reproduction::reproduction_page;
pub use plant::{
    FitDocument, IdentifiedDocument, InitialStateDocument, InnovationSizeDocument, JudgeError,
    LINEARISATION_FORMAT, LinearisationDocument, NoiseDocument, OperatingValue, PLANT_FORMAT,
    ParameterDocument, PlantDocument, PlantValidation, SimulatorDocument,
    SimulatorParameterDocument, TestDocument, Uncertain, is_plant, judge_plant,
};
#[cfg(feature = "cli")]
pub(crate) use plant::{frequency_grid, logarithmic, plant_fits, text_alone};
pub use read_explanation::{is_explanation, parse_explanation, read_explanation};
#[cfg(feature = "cli")]
pub(crate) use reproduction_csv::reproduction_csv;
#[cfg(feature = "cli")]
pub(crate) use text::significant;
pub use validation_document::{PLANT_VALIDATION_FORMAT, VALIDATION_FORMAT, ValidationDocument};
