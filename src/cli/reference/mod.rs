//! Commands that print what the program knows: effects, JSON Schema, shell completions.

pub(crate) mod completions;
pub(crate) mod effects;
pub(crate) mod schema;
