//! The page of a reproduction.
//!
//! | file | one idea |
//! |---|---|
//! | `view` | everything the template is given |
//! | `pictures` | lines and bars |
//! | `reproduction.html` | the template |

mod reproduction_plots;
mod reproduction_view;

#[cfg(test)]
mod tests;

use super::{PageError, head, plot, render, typeset_number};
use crate::reproduce::Reproduction;

const TEMPLATES: [(&str, &str); 1] = [("reproduction", include_str!("reproduction.html"))];

/// The reproduction as a page to open in a browser.
///
/// # Errors
/// When the template cannot be filled, which no reproduction should bring about.
pub(crate) fn reproduction_page(reproduction: &Reproduction) -> Result<String, PageError> {
    render(&TEMPLATES, &reproduction_view::view(reproduction))
}
