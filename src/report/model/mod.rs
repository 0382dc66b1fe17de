//! The document `innovant-model/1`: its keys, and how it is read.

mod channels;
mod model_document;
mod packed;
mod read_model;
mod request;

pub use channels::{InputDocument, OutputDocument};
pub use model_document::{
    DiagnosticsDocument, InvariantsDocument, MODEL_FORMAT, ModelDocument, Provenance,
};
pub use packed::CovarianceDocument;
pub use read_model::{ReadModel, parse_model, read_model};
pub(crate) use read_model::{broken, no_document};
pub use request::Request;
