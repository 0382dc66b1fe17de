//! Tables of a linear model: summary, orders, poles and gains, validation, verdict.

mod fit_text;
mod model_text;
mod orders;
mod roots;
mod show_text;
mod validation_text;
mod verdict_text;

pub(crate) use fit_text::{fit_measures, fit_table};
pub(crate) use model_text::method;
pub use model_text::{ModelText, model_text};
pub(crate) use orders::comparison;
pub(crate) use orders::order_table;
pub(crate) use roots::{continuous_pole_table, gain_table, pole_table, shortened};
pub(crate) use show_text::responses;
pub use show_text::show_text;
pub use validation_text::validation_text;
pub(crate) use validation_text::{Headline, findings, headline, linearity_tested, test_tables};
pub use verdict_text::verdict;
pub(crate) use verdict_text::{doubtful, too_short};
