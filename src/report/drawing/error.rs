//! What can go wrong with a page.

/// A page that cannot be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PageError {
    /// The template and what it is given do not fit together.
    #[error("the page cannot be written: {0}; this is a mistake in innovant, please report it")]
    Template(#[from] minijinja::Error),
}
