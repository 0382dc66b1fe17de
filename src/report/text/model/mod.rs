//! Tables of a linear model: summary, orders, poles and gains, validation, verdict.

mod fit_text;
mod model_text;
mod orders;
mod roots;
mod show_text;
mod validation_text;
mod verdict_text;

pub(crate) use fit_text::fit_measures;
pub use model_text::{ModelText, model_text};
pub(crate) use orders::comparison;
pub use show_text::show_text;
pub use validation_text::validation_text;
pub(crate) use validation_text::{Headline, headline};
pub use verdict_text::verdict;

// What pages show too.
#[cfg(feature = "report")]
pub(crate) use fit_text::fit_table;
#[cfg(feature = "report")]
pub(crate) use model_text::method;
#[cfg(feature = "report")]
pub(crate) use orders::order_table;
#[cfg(feature = "report")]
pub(crate) use roots::{gain_table, pole_table};
#[cfg(feature = "report")]
pub(crate) use validation_text::{findings, linearity_tested, test_tables};
#[cfg(feature = "report")]
pub(crate) use verdict_text::{doubtful, too_short};

// What the command says of a linearisation.
#[cfg(feature = "cli")]
pub(crate) use roots::{continuous_pole_table, shortened};
#[cfg(feature = "cli")]
pub(crate) use show_text::responses;
