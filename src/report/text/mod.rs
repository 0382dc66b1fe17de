//! Tables for people: nothing wider than a hundred columns.

#[cfg(feature = "cli")]
mod effects_text;
mod explanation_text;
mod model;
mod number;
mod plant;
#[cfg(feature = "cli")]
mod reproduction_text;
mod table;

#[cfg(feature = "cli")]
pub(crate) use effects_text::effects_text;
pub use explanation_text::explanation_text;
pub(crate) use model::comparison;
pub use model::{ModelText, model_text, show_text, validation_text, verdict};
#[cfg(feature = "report")]
pub(crate) use model::{
    doubtful, findings, fit_table, gain_table, linearity_tested, method, order_table, pole_table,
    test_tables, too_short,
};
#[cfg(feature = "report")]
pub(crate) use number::percent;
#[cfg(feature = "cli")]
pub(crate) use number::significant;
#[cfg(feature = "cli")]
pub(crate) use plant::linearisation_text;
#[cfg(feature = "report")]
pub(crate) use plant::{
    initial_state_table, leaves_something_out, parameter_table, residual_test_table,
    verdict as plant_verdict,
};
pub use plant::{plant_estimate_text, plant_text, plant_validation_text};
#[cfg(feature = "cli")]
pub(crate) use reproduction_text::reproduction_text;
#[cfg(feature = "report")]
pub(crate) use table::Table;

/// Widest line.
pub(crate) const WIDTH: usize = 100;

/// How text is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Style {
    /// Between a value and its standard deviation.
    pub plus_minus: &'static str,
}

impl Style {
    /// For a terminal that knows ASCII only.
    pub const ASCII: Self = Self { plus_minus: "+-" };
    /// For a terminal that knows Unicode.
    pub const UNICODE: Self = Self { plus_minus: "±" };
}

/// `text` in lines of at most [`WIDTH`] columns; the first starts with `first`, the others with as many spaces.
pub(crate) fn wrapped(first: &str, text: &str) -> String {
    let indent = first.chars().filter(|c| *c != '\n').count();
    let mut out = String::from(first);
    let mut column = indent;
    for (index, word) in text.split_whitespace().enumerate() {
        let width = word.chars().count();
        if index > 0 && column + 1 + width > WIDTH {
            out.push('\n');
            out.push_str(&" ".repeat(indent));
            column = indent;
        } else if index > 0 {
            out.push(' ');
            column += 1;
        }
        out.push_str(word);
        column += width;
    }
    out.push('\n');
    out
}

/// `1 input`, `2 inputs`.
pub(crate) fn count(number: usize, what: &str) -> String {
    format!("{number} {what}{}", if number == 1 { "" } else { "s" })
}

/// `a`, `a and b`, `a, b and c`.
pub(crate) fn listed(of: &[String]) -> String {
    match of {
        [] => String::new(),
        [only] => only.clone(),
        [most @ .., last] => format!("{} and {last}", most.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_sentences_are_wrapped_and_indented() {
        let text = wrapped("warning: ", &"word ".repeat(60));
        assert!(text.lines().all(|line| line.chars().count() <= WIDTH));
        assert!(
            text.lines()
                .skip(1)
                .all(|line| line.starts_with("         word"))
        );
        assert_eq!(text.matches("word").count(), 60);
    }

    #[test]
    fn one_is_singular() {
        assert_eq!(count(1, "input"), "1 input");
        assert_eq!(count(2, "output"), "2 outputs");
    }
}
