//! The page of an explanation: one HTML file that needs nothing else, neither a network nor other files.
//!
//! | file             | one idea                                                              |
//! |------------------|-----------------------------------------------------------------------|
//! | `view`           | everything the template is given                                      |
//! | `signals`, `maps`| the pictures over time; over frequency and over the learned law       |
//! | `plot`, `axis`, `trace` | a picture, its axes and ticks, its lines as SVG                |
//! | `proof`          | fit step by step, with the bootstrap interval                         |
//! | `findings`       | effects, places, rivals                                               |
//! | `closing`        | what is left, noise, provenance                                       |
//! | `number`, `words`| how numbers and effects are written                                   |
//! | `page.html`, `picture.html`, `sections.html`, `page.css`, `page.js` | the templates, the looks, the interaction |
//!
//! The pictures are complete without the script: it adds zoom and readout, and reads the values back from the lines.

mod axis;
mod closing;
mod error;
mod findings;
mod maps;
mod number;
mod plot;
mod proof;
mod signals;
mod trace;
mod view;
mod words;

#[cfg(test)]
pub(crate) mod fixtures;
#[cfg(test)]
mod tests;

use minijinja::syntax::SyntaxConfig;
use minijinja::value::{Serde, Value};
use minijinja::{AutoEscape, Environment, UndefinedBehavior, context};

pub use error::PageError;

use crate::explain::Explanation;

const PAGE: &str = include_str!("page.html");
const SECTIONS: &str = include_str!("sections.html");
const PICTURE: &str = include_str!("picture.html");
const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// The explanation as a page to open in a browser.
///
/// Whatever comes from files (names, units, sentences) is escaped.
///
/// # Errors
///
/// When the template cannot be filled, which no explanation should bring about.
pub fn explanation_page(explanation: &Explanation) -> Result<String, PageError> {
    let mut templates = Environment::new();
    templates.set_auto_escape_callback(|_| AutoEscape::Html);
    templates.set_undefined_behavior(UndefinedBehavior::Strict);
    templates.set_syntax(
        SyntaxConfig::builder()
            .trim_blocks(true)
            .lstrip_blocks(true)
            .build()?,
    );
    templates.add_template("picture", PICTURE)?;
    templates.add_template("sections", SECTIONS)?;
    templates.add_template("page", PAGE)?;
    let page = templates.get_template("page")?;
    Ok(page.render(context! {
        page => Value::from(Serde(view::view(explanation))),
        style => STYLE,
        script => SCRIPT,
    })?)
}
