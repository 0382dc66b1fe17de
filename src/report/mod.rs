//! Documents and tables: a model as JSON (`innovant-model/1`), as a JSON Schema, and as text for people.
//!
//! | file             | one idea                                                          |
//! |------------------|-------------------------------------------------------------------|
//! | `model_document` | the keys of `innovant-model/1`                                    |
//! | `channels`, `packed`, `request` | its parts                                |
//! | `read`           | text to model, with errors that name line, column and key         |
//! | `json`           | how JSON is laid out; `location`: where in it something stands    |
//! | `schema`         | the JSON Schema                                                   |
//! | `text`           | tables for a terminal                                             |
//! | `page`           | pages of identifications, explanations and reproductions          |
//! | `overview`       | envelopes and spectra of a recording, gathered while it is read   |
//! | `plant_fit`      | how an estimated plant follows its recordings                     |
//! | `plant_document` | the keys of `innovant-plant/1`                                    |
//! | `simulator_document` | the external simulator in it                                 |
//! | `plant_linearisation` | a plant at an operating point: poles, gains, responses      |
//! | `plant_validation` | the judgement of a plant on recordings                        |
//! | `validation_document` | what `validate` writes                                      |
//! | `reproduction_csv` | all numbers of a reproduction as one long table                 |
//!
//! # The same input gives the same bytes
//! Documents and pages hold no time, no host and nothing that depends on the number of threads: the same version of the
//! program makes the same bytes of the same files and the same request on the same kind of processor
//! (`tests/cli/reproducible.rs`). Where a document comes from stands in one place, and is all that may differ when the same
//! bytes come under another name or are asked for in other words: `provenance` of a model (`tool`, `version`,
//! `recordings` with name and SHA-256, `request`); `version` and `recordings` of an explanation; `model` and `recordings`
//! of a validation. Of the summary of a batch `status` and `seconds` are of the run.

mod channels;
mod error;
mod json;
mod location;
mod model_document;
mod overview;
mod packed;
mod page;
mod plant_document;
mod plant_fit;
mod plant_linearisation;
mod plant_validation;
mod read;
mod read_explanation;
mod reproduction_csv;
mod request;
mod schema;
mod simulator_document;
pub mod text;
mod validation_document;

pub use channels::{InputDocument, OutputDocument};
pub use error::DocumentError;
pub use json::to_json;
pub use model_document::{
    DiagnosticsDocument, InvariantsDocument, MODEL_FORMAT, ModelDocument, Provenance,
};
pub use overview::{Excitation, Experiment, Overview, Watched};
pub use packed::CovarianceDocument;
pub use page::PageError;
pub use page::explanation::explanation_page;
pub use page::identification::identification_page;
pub use page::plant::plant_page;
pub use page::reproduction::reproduction_page;
pub use plant_document::{
    FitDocument, InitialStateDocument, PLANT_FORMAT, PlantDocument, TestDocument, is_plant,
};
pub use plant_fit::plant_fits;
pub use plant_linearisation::{
    IdentifiedDocument, LINEARISATION_FORMAT, LinearisationDocument, OperatingValue, Uncertain,
    frequency_grid, logarithmic,
};
pub use plant_validation::{
    InnovationSizeDocument, JudgeError, PlantValidation, judge_plant, text_alone,
};
pub use read::{ReadModel, parse_model, read_model};
pub use read_explanation::{is_explanation, parse_explanation, read_explanation};
pub use reproduction_csv::reproduction_csv;
pub use request::Request;
pub use schema::schema;
pub use simulator_document::SimulatorDocument;
pub use validation_document::{PLANT_VALIDATION_FORMAT, VALIDATION_FORMAT, ValidationDocument};
