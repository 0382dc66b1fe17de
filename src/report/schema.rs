//! The JSON Schema of the documents.

use schemars::generate::SchemaSettings;

use super::error::DocumentError;
use super::json::to_json;
use super::model_document::ModelDocument;

/// The JSON Schema (draft 2020-12) of `innovant-model/1` as it is written.
///
/// # Errors
/// [`DocumentError::Json`], which should not happen.
pub fn model_schema() -> Result<String, DocumentError> {
    let schema = SchemaSettings::draft2020_12()
        .for_serialize()
        .into_generator()
        .into_root_schema_for::<ModelDocument>();
    Ok(to_json(&schema)?)
}

/// The JSON Schema (draft 2020-12) of `innovant-explanation/1` as it is written.
///
/// # Errors
/// [`DocumentError::Json`], which should not happen.
pub fn explanation_schema() -> Result<String, DocumentError> {
    let schema = SchemaSettings::draft2020_12()
        .for_serialize()
        .into_generator()
        .into_root_schema_for::<crate::explain::Explanation>();
    Ok(to_json(&schema)?)
}

/// The JSON Schema (draft 2020-12) of `innovant-plant/1` as it is written.
///
/// # Errors
/// [`DocumentError::Json`], which should not happen.
pub fn plant_schema() -> Result<String, DocumentError> {
    let schema = SchemaSettings::draft2020_12()
        .for_serialize()
        .into_generator()
        .into_root_schema_for::<super::PlantDocument>();
    Ok(to_json(&schema)?)
}

/// The JSON Schema (draft 2020-12) of `innovant-reproduction/1` as it is written.
///
/// # Errors
/// [`DocumentError::Json`], which should not happen.
pub fn reproduction_schema() -> Result<String, DocumentError> {
    let schema = SchemaSettings::draft2020_12()
        .for_serialize()
        .into_generator()
        .into_root_schema_for::<crate::reproduce::Reproduction>();
    Ok(to_json(&schema)?)
}
