//! The documents of a plant in equations: estimated, linearised, judged.

mod parameter_document;
mod plant_document;
mod plant_fit;
mod plant_linearisation;
mod plant_validation;
mod simulator_document;

pub use parameter_document::ParameterDocument;
pub use plant_document::{
    FitDocument, InitialStateDocument, NoiseDocument, PLANT_FORMAT, PlantDocument, TestDocument,
    is_plant,
};
pub use plant_fit::plant_fits;
#[cfg(feature = "cli")]
pub(crate) use plant_linearisation::logarithmic;
pub use plant_linearisation::{
    IdentifiedDocument, LINEARISATION_FORMAT, LinearisationDocument, OperatingValue, Uncertain,
    frequency_grid,
};
pub use plant_validation::{
    InnovationSizeDocument, JudgeError, PlantValidation, judge_plant, text_alone,
};
pub use simulator_document::{SimulatorDocument, SimulatorParameterDocument};
