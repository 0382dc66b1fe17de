//! Documents and tables: a model as JSON (`innovant-model/1`), as a JSON Schema, and as text for people.
//!
//! | file             | one idea                                                          |
//! |------------------|-------------------------------------------------------------------|
//! | `model_document` | the keys of `innovant-model/1`                                    |
//! | `channels`, `matrix`, `packed`, `request` | its parts                                |
//! | `read`           | text to model, with errors that name line, column and key         |
//! | `json`           | how JSON is laid out; `location`: where in it something stands    |
//! | `schema`         | the JSON Schema                                                   |
//! | `text`           | tables for a terminal                                             |
//! | `page`, `reproduction` | pages of explanations and reproductions                     |
//! | `drawing`        | what pages are drawn with                                         |

mod channels;
mod drawing;
mod error;
mod json;
mod location;
mod matrix;
mod model_document;
mod packed;
mod page;
mod read;
mod read_explanation;
mod reproduction;
mod request;
mod schema;
pub mod text;

pub use channels::{InputDocument, OutputDocument};
pub use drawing::PageError;
pub use error::DocumentError;
pub use json::to_json;
pub use matrix::Rows;
pub(crate) use model_document::names;
pub use model_document::{
    DiagnosticsDocument, InvariantsDocument, MODEL_FORMAT, ModelDocument, Provenance,
};
pub use packed::CovarianceDocument;
pub use page::explanation_page;
pub use read::{ReadModel, parse_model, read_model};
pub use read_explanation::{is_explanation, parse_explanation, read_explanation};
pub use reproduction::{reproduction_csv, reproduction_page};
pub use request::Request;
pub use schema::{explanation_schema, model_schema, reproduction_schema};
