//! The page of an estimated plant in equations.
//!
//! | file         | one idea                                                        |
//! |--------------|-----------------------------------------------------------------|
//! | `view`       | everything the template is given: verdict, tables, equations    |
//! | `pictures`   | outputs, inputs and residuals over time; autocorrelations       |
//! | `plant.html` | the template                                                    |

mod plant_plots;
mod plant_view;

#[cfg(test)]
mod tests;

use super::{PageError, head, plot, provenance, render, typeset_number};
use crate::physics::Plant;
use crate::physics::estimate::{Evaluation, PlantRecording};
use crate::report::PlantDocument;

const TEMPLATES: [(&str, &str); 1] = [("plant", include_str!("plant.html"))];

/// An estimated plant as a page to open in a browser: verdict, fit, parameters with their correlations, recorded and simulated
/// outputs, residuals with their tests, and the equations with the estimated values.
///
/// `records` are the recordings that it was estimated from, `found` is the plant on them. Whatever comes from files (names,
/// units, equations) is escaped.
///
/// # Errors
/// [`PageError::Template`] when the template cannot be filled, which no plant should bring about.
pub fn plant_page(
    plant: &Plant,
    document: &PlantDocument,
    records: &[PlantRecording],
    found: &Evaluation,
) -> Result<String, PageError> {
    render(
        &TEMPLATES,
        &plant_view::view(plant, document, records, found),
    )
}
