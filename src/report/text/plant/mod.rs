//! Tables of a plant in equations: estimated, linearised, judged.

#[cfg(feature = "cli")]
mod linearisation_text;
mod plant_text;
mod plant_validation_text;

pub use plant_text::{plant_estimate_text, plant_text};
pub use plant_validation_text::plant_validation_text;

// What pages show too.
#[cfg(feature = "report")]
pub(crate) use plant_text::{leaves_something_out, parameter_table, verdict};
#[cfg(feature = "report")]
pub(crate) use plant_validation_text::{initial_state_table, residual_test_table};

#[cfg(feature = "cli")]
pub(crate) use linearisation_text::linearisation_text;
