//! The library: the papers' formulas in their literal form, reference arithmetic, invariances, the shape of the code, and what
//! every method has to do.

mod answers;
mod chiuso_picci_variance;
#[path = "../support/data.rs"]
mod data;
mod data_files;
mod extended_precision;
mod invariance;
mod knudsen_coverage;
mod literal_covariance;
mod literal_nested;
mod methods;
mod model_document;
mod orders;
mod properties;
mod public_api;
mod shape;
#[path = "../support/variance.rs"]
mod variance;
