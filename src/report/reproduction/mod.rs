//! A reproduction as a page and as CSV. The page needs nothing else, neither a network nor other files.
//!
//! | file | one idea |
//! |---|---|
//! | `view` | everything the template is given |
//! | `pictures` | line pictures |
//! | `bars` | bar charts |
//! | `numbers` | all numbers as one long CSV table |
//! | `page.html` | the template |

mod bars;
mod numbers;
mod pictures;
mod view;

#[cfg(test)]
mod tests;

use minijinja::context;
use minijinja::value::{Serde, Value};

pub use numbers::reproduction_csv;

use super::drawing::{PageError, SCRIPT, STYLE, templates};
use crate::reproduce::Reproduction;

const PAGE: &str = include_str!("page.html");

/// The reproduction as a page to open in a browser.
///
/// # Errors
/// When the template cannot be filled, which no reproduction should bring about.
pub fn reproduction_page(reproduction: &Reproduction) -> Result<String, PageError> {
    let mut templates = templates()?;
    templates.add_template("page", PAGE)?;
    let page = templates.get_template("page")?;
    Ok(page.render(context! {
        page => Value::from(Serde(view::view(reproduction))),
        style => STYLE,
        script => SCRIPT,
    })?)
}
