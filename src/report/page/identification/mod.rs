//! The page of an identified model.
//!
//! | file         | one idea                                                     |
//! |--------------|--------------------------------------------------------------|
//! | `view`       | everything the template is given: verdict, fit, tables       |
//! | `order`      | singular values, criteria of order and window                |
//! | `response`   | frequency response and step response with their bands        |
//! | `poles`      | the map of poles and zeros with their ellipses               |
//! | `residuals`  | correlations of what is left, with their bounds              |
//! | `recording`  | the recordings and what excites the plant                    |
//! | `identification.html` | the template                                        |

mod identification_view;
mod order_plots;
mod pole_zero_map;
mod recording_plots;
mod residual_plots;
mod response_plots;

#[cfg(test)]
mod tests;

use super::{PageError, head, plot, provenance, render, typeset_number};
use crate::identify::Model;
use crate::report::Overview;
use crate::validate::Validation;

const TEMPLATES: [(&str, &str); 1] = [("identification", include_str!("identification.html"))];

/// Pictures of one kind that are shown before the rest is folded away.
const SHOWN: usize = 9;

/// The model as a page to open in a browser: verdict, order, frequency response, poles, step response, residuals and,
/// with an overview, the recordings.
///
/// Whatever comes from files (names, units) is escaped.
///
/// # Errors
/// [`PageError::Covariance`] or [`PageError::Model`] when what follows from the model cannot be computed; [`PageError::Template`] when the template
/// cannot be filled, which no model should bring about.
pub fn identification_page(
    model: &Model,
    tests: Option<&Validation>,
    overview: Option<&Overview>,
) -> Result<String, PageError> {
    render(
        &TEMPLATES,
        &identification_view::view(model, tests, overview)?,
    )
}

/// Groups beyond [`SHOWN`] are folded away.
fn folded(mut groups: Vec<plot::Group>) -> Vec<plot::Group> {
    for group in groups.iter_mut().skip(SHOWN) {
        group.folded = true;
    }
    groups
}

/// Pictures side by side, those beyond [`SHOWN`] folded away.
fn grid(id: &str, title: &str, mut plots: Vec<plot::Plot>) -> Vec<plot::Group> {
    let rest = plots.split_off(plots.len().min(SHOWN));
    let more = format!("{} more", rest.len());
    let group = |id: String, title: &str, plots: Vec<plot::Plot>, folded| plot::Group {
        id,
        title: title.to_owned(),
        caption: String::new(),
        plots,
        folded,
        linked: false,
        beside: true,
    };
    [
        group(id.to_owned(), title, plots, false),
        group(format!("{id}-more"), &more, rest, true),
    ]
    .into_iter()
    .filter(|group| !group.plots.is_empty())
    .collect()
}
