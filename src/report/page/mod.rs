//! The page of an explanation: one HTML file that needs nothing else, neither a network nor other files.
//!
//! | file             | one idea                                                              |
//! |------------------|-----------------------------------------------------------------------|
//! | `view`           | everything the template is given                                      |
//! | `signals`, `maps`| the pictures over time; over frequency and over the learned law       |
//! | `proof`          | fit step by step, with the bootstrap interval                         |
//! | `findings`       | effects, places, rivals                                               |
//! | `closing`        | what is left, noise, provenance                                       |
//! | `words`          | how effects are called                                                |
//! | `page.html`, `sections.html` | the templates                                             |
//!
//! Pictures, numbers, looks and interaction come from `drawing`, which all pages share.

mod closing;
mod findings;
mod maps;
mod proof;
mod signals;
mod view;
mod words;

#[cfg(test)]
pub(crate) mod fixtures;
#[cfg(test)]
mod tests;

use minijinja::context;
use minijinja::value::{Serde, Value};

use super::drawing::{self, PageError, SCRIPT, STYLE, axis, number, plot};
use crate::explain::Explanation;

const PAGE: &str = include_str!("page.html");
const SECTIONS: &str = include_str!("sections.html");

/// The explanation as a page to open in a browser.
///
/// Whatever comes from files (names, units, sentences) is escaped.
///
/// # Errors
///
/// When the template cannot be filled, which no explanation should bring about.
pub fn explanation_page(explanation: &Explanation) -> Result<String, PageError> {
    let mut templates = drawing::templates()?;
    templates.add_template("sections", SECTIONS)?;
    templates.add_template("page", PAGE)?;
    let page = templates.get_template("page")?;
    Ok(page.render(context! {
        page => Value::from(Serde(view::view(explanation))),
        style => STYLE,
        script => SCRIPT,
    })?)
}
