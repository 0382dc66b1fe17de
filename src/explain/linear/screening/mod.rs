//! Screening.

pub(crate) mod features;
pub(crate) mod output_adequacy;
pub(crate) mod rectified_signs;
pub(crate) mod score_tests;
pub(crate) mod templates;
