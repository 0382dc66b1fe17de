//! What all pages are drawn with: pictures as SVG, numbers for people, looks and interaction.
//!
//! | file             | one idea                                                              |
//! |------------------|-----------------------------------------------------------------------|
//! | `plot`, `axis`, `trace` | a picture, its axes and ticks, its lines as SVG                |
//! | `number`         | how numbers are written                                               |
//! | `picture.html`   | the template of a picture                                             |
//! | `style.css`, `script.js` | the looks, the interaction                                    |
//!
//! The pictures are complete without the script: it adds zoom and readout, and reads the values back from the
//! lines.

pub(in crate::report) mod axis;
mod error;
pub(in crate::report) mod number;
pub(in crate::report) mod plot;
mod trace;

use minijinja::syntax::SyntaxConfig;
use minijinja::{AutoEscape, Environment, UndefinedBehavior};

pub use error::PageError;

const PICTURE: &str = include_str!("picture.html");
/// The looks of a page.
pub(in crate::report) const STYLE: &str = include_str!("style.css");
/// The interaction of a page.
pub(in crate::report) const SCRIPT: &str = include_str!("script.js");

/// Templates that escape whatever they are given, with that of a picture among them.
pub(in crate::report) fn templates() -> Result<Environment<'static>, PageError> {
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
    Ok(templates)
}
