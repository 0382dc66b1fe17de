//! The JSON Schema of the documents.

use schemars::JsonSchema;
use schemars::generate::SchemaSettings;

use super::document_error::DocumentError;
use super::json_layout::to_json;

/// The JSON Schema (draft 2020-12) of a document as it is written, such as `schema::<ModelDocument>()`.
///
/// # Errors
/// [`DocumentError::Json`], which should not happen.
pub fn schema<T: JsonSchema>() -> Result<String, DocumentError> {
    let settings = SchemaSettings::draft2020_12().for_serialize();
    Ok(to_json(
        &settings.into_generator().into_root_schema_for::<T>(),
    )?)
}
