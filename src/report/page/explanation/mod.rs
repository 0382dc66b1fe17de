//! The page of an explanation.
//!
//! | file             | one idea                                                              |
//! |------------------|-----------------------------------------------------------------------|
//! | `view`           | everything the template is given                                      |
//! | `signals`, `maps`| the pictures over time; over frequency and over the learned law       |
//! | `proof`          | fit step by step, with the bootstrap interval                         |
//! | `findings`       | effects, places, rivals                                               |
//! | `closing`        | what is left, noise, provenance                                       |
//! | `words`          | how effects are called                                                |
//! | `explanation.html`, `sections.html` | the templates                                      |

mod closing;
mod equation_map;
mod explanation_view;
mod explanation_words;
mod findings;
mod maps;
mod proof;
mod signals;

#[cfg(test)]
pub(crate) mod fixtures;
#[cfg(test)]
mod tests;

use super::{PageError, head, plot, provenance, render, typeset_number};
use crate::explain::Explanation;

const TEMPLATES: [(&str, &str); 2] = [
    ("sections", include_str!("sections.html")),
    ("explanation", include_str!("explanation.html")),
];

/// The explanation as a page to open in a browser.
///
/// Whatever comes from files (names, units, sentences) is escaped.
///
/// # Errors
/// When the template cannot be filled, which no explanation should bring about.
pub fn explanation_page(explanation: &Explanation) -> Result<String, PageError> {
    render(&TEMPLATES, &explanation_view::view(explanation))
}
