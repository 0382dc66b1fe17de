//! The judgement of a plant in equations on a recording.

use crate::report::text::model::{Headline, fit_measures, headline};
use crate::report::text::number::{probability, significant, with_std};
use crate::report::text::table::Table;
use crate::report::text::{Style, wrapped};
use crate::report::{InitialStateDocument, PlantValidation, TestDocument};

/// Verdict, fit, initial states, tests, size of the residuals, findings.
pub fn plant_validation_text(of: &PlantValidation, style: Style) -> String {
    let mut out = wrapped(
        "",
        &headline(&Headline {
            what: "Plant",
            relation: of.relation,
            samples: of.samples,
            level: of.level,
            rejected: of.rejected,
            too_short: of.too_short.as_ref(),
            accepted: "the residuals are white and do not depend on the inputs",
        }),
    );
    let fit = fit_measures(&of.one_step, of.free_run.as_ref());
    out += &format!("\nFit\n{}", fit.lines());
    out += &initial_state_text(&of.initial_states, style);
    out += &format!(
        "\nResiduals\n{}",
        residual_test_table(&of.residual_tests).lines()
    );
    if !of.innovation_size.is_empty() {
        let mut table = Table::new(["output", "stated", "found"]);
        for size in &of.innovation_size {
            table.row([
                size.output.clone(),
                significant(size.stated_std, 4),
                significant(size.found_std, 4),
            ]);
        }
        out += &format!(
            "\nSize of the residuals one step ahead (rms)\n{}",
            table.lines()
        );
    }
    for (index, finding) in of.findings.iter().enumerate() {
        if index == 0 {
            out.push('\n');
        }
        out += &wrapped("finding: ", finding);
    }
    out
}

/// Initial states of the first recording.
pub(super) fn initial_state_text(of: &[Vec<InitialStateDocument>], style: Style) -> String {
    let Some(first) = of.first().filter(|s| !s.is_empty()) else {
        return String::new();
    };
    let title = match of.len() {
        1 => "Initial states",
        _ => "Initial states of the first recording",
    };
    format!("\n{title}\n{}", initial_state_table(first, style).lines())
}

/// The same of one recording as a table.
pub(crate) fn initial_state_table(of: &[InitialStateDocument], style: Style) -> Table {
    let mut table = Table::new(["state", "value"]);
    for s in of {
        table.row([s.name.clone(), with_std(Some(s.value), s.std, style)]);
    }
    table
}

#[cfg(feature = "report")]
/// Level at which the tests together are said to fail.
const LEVEL: f64 = 0.01;

#[cfg(feature = "report")]
/// Whether one of the tests fails.
pub(crate) fn tests_fail(tests: &[TestDocument]) -> bool {
    let level = LEVEL / tests.len().max(1) as f64;
    tests.iter().any(|t| t.p_value < level)
}

/// Questions that are asked of the residuals, and their answers.
pub(crate) fn residual_test_table(tests: &[TestDocument]) -> Table {
    let mut table = Table::new(["output", "question", "chi-square", "degrees", "p"]).flush_left(1);
    for t in tests {
        let question = match t.question.as_str() {
            "white" => "white?",
            "inputs" => "independent of past inputs?",
            _ => "independent of products of inputs and outputs?",
        };
        table.row([
            t.output.clone(),
            question.to_owned(),
            significant(t.statistic, 4),
            t.degrees.to_string(),
            probability(t.p_value),
        ]);
    }
    table
}
