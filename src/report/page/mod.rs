//! The pages: one look for explanations, identifications and reproductions. A page is one HTML file that opens
//! offline: it needs neither a network nor other files.
//!
//! | file             | one idea                                                              |
//! |------------------|-----------------------------------------------------------------------|
//! | `explanation`, `identification`, `plant`, `reproduction` | what each page shows          |
//! | `plot`           | a picture as data: axes, series, shaded windows                       |
//! | `thin`           | long lines thinned, digits that a screen can show                     |
//! | `typeset_number` | how numbers are written                                               |
//! | `base.html`, `plots.html`, `style.css` | frame, pictures and looks of every page         |
//! | `draw.js`        | draws the pictures                                                    |
//! | `plotly`         | plotly.js, which does the drawing                                     |
//!
//! Whatever comes from files (names, units, sentences) is escaped: by the templates in HTML, by `plot` in the data of
//! pictures, and by `draw.js` where plotly.js reads tags in texts. The content security policy of the page allows
//! nothing to be loaded.

pub(in crate::report) mod explanation;
mod head;
pub(in crate::report) mod identification;
mod page_error;
pub(in crate::report) mod plant;
mod plot;
mod plotly;
mod provenance;
#[cfg(feature = "cli")]
pub(in crate::report) mod reproduction;
mod thin;
mod typeset_number;

#[cfg(test)]
mod tests;

use minijinja::syntax::SyntaxConfig;
use minijinja::value::{Serde, Value};
use minijinja::{AutoEscape, Environment, UndefinedBehavior, context};
use serde::Serialize;

pub use page_error::PageError;

const BASE: &str = include_str!("base.html");
const PLOTS: &str = include_str!("plots.html");
const STYLE: &str = include_str!("style.css");
const SCRIPT: &str = include_str!("draw.js");

/// Fills templates (name and text); the last of them is the page.
///
/// # Errors
/// When the templates and `page` do not fit together.
fn render<T: Serialize>(
    own: &[(&'static str, &'static str)],
    page: &T,
) -> Result<String, PageError> {
    let mut templates = Environment::new();
    templates.set_auto_escape_callback(|_| AutoEscape::Html);
    templates.set_undefined_behavior(UndefinedBehavior::Strict);
    templates.set_syntax(
        SyntaxConfig::builder()
            .trim_blocks(true)
            .lstrip_blocks(true)
            .build()?,
    );
    let shared = [("base", BASE), ("plots", PLOTS)];
    let mut name = "base";
    for (this, text) in shared.into_iter().chain(own.iter().copied()) {
        templates.add_template(this, text)?;
        name = this;
    }
    Ok(templates.get_template(name)?.render(context! {
        page => Value::from(Serde(page)),
        style => STYLE,
        script => SCRIPT,
        library => plotly::plotly(),
    })?)
}
