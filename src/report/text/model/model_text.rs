//! The summary of an identification.

use std::fmt;

use super::fit_text::fit;
use super::orders::order_evidence;
use super::roots::{poles, static_gains};
use super::validation_text::{findings, linearity_tested};
use super::verdict_text::verdict;
use crate::covariance::{Invariants, invariants};
use crate::identify::{CovarianceKind, Model, Summary, channel_names};
use crate::report::text::{Style, comparison, wrapped};
use crate::validate::Validation;

/// Poles and gains that a summary lists.
const LINES_SHOWN: usize = 12;

/// What the summary of a model shows.
#[derive(Debug, Clone, Copy)]
pub struct ModelText<'a> {
    /// The model.
    pub model: &'a Model,
    /// Tests of its residuals.
    pub tests: Option<&'a Validation>,
    /// Orders that were asked for, when there were several.
    pub orders: &'a [usize],
    /// How to write it.
    pub style: Style,
}

/// Verdict, fit, poles, gains, how order and windows were chosen, warnings.
pub fn model_text(text: &ModelText<'_>) -> String {
    let ModelText {
        model,
        tests,
        orders,
        style,
    } = *text;
    let mut out = wrapped("", &verdict(model, tests));
    if let Some(tests) = tests {
        out.push_str(&fit(tests));
    }
    if let Some(described) = described(model) {
        out.push_str(&dynamics(model, &described, LINES_SHOWN, style));
    }
    if let Some(summary) = &model.summary {
        out.push_str(&if orders.len() > 1 {
            comparison(summary, orders)
        } else {
            order_evidence(summary)
        });
        out.push_str(&how(summary));
        if let Some(tested) = tests.and_then(linearity_tested) {
            out.push_str(&wrapped("  ", tested));
        }
        let warnings = summary.warnings.iter().map(|w| ("warning: ", w));
        let found = tests.map(findings).unwrap_or_default();
        let found = found.iter().map(|f| ("finding: ", f));
        for (index, (word, sentence)) in warnings.chain(found).enumerate() {
            if index == 0 {
                out.push('\n');
            }
            out.push_str(&wrapped(word, sentence));
        }
    }
    out
}

/// Everything but the frequency response; `None` when it cannot be computed.
pub(crate) fn described(model: &Model) -> Option<Invariants> {
    invariants(
        &model.system,
        model.covariance.as_ref(),
        &channel_names(&model.outputs),
        &channel_names(&model.inputs),
        &[],
        0,
    )
    .ok()
}

/// Poles and gains.
pub(super) fn dynamics(model: &Model, described: &Invariants, most: usize, style: Style) -> String {
    let spread = match (&model.covariance, style.plus_minus) {
        (Some(_), pm) => format!(" ({pm} one standard deviation)"),
        (None, _) => String::new(),
    };
    let channels = |of: &[crate::identify::IdentifiedChannel]| {
        of.iter().map(|c| c.channel.clone()).collect::<Vec<_>>()
    };
    let mut out = poles(&format!("Poles{spread}"), &described.poles, most, style);
    out.push_str(&static_gains(
        &format!("Static gain{spread}"),
        &described.static_gain,
        most,
        &channels(&model.inputs),
        &channels(&model.outputs),
        style,
    ));
    out
}

/// How the numbers came about.
fn how(summary: &Summary) -> String {
    let mut out = String::from("\nHow\n");
    for sentence in summary.explanation.iter().chain([&method(summary)]) {
        out.push_str(&wrapped("  ", sentence));
    }
    out
}

/// Algorithm, windows, polish and covariance.
pub(crate) fn method(summary: &Summary) -> String {
    let polish = if summary.polished {
        "polished to maximum likelihood"
    } else {
        "not polished"
    };
    let covariance = match (
        summary.options.covariance,
        summary.diagnostics.jackknife_blocks,
    ) {
        (CovarianceKind::Model, None) => "covariance from the model".to_owned(),
        (_, Some(blocks)) => {
            format!("covariance from {blocks} blocks of the data (jackknife)")
        }
        (CovarianceKind::Robust, None) => "robust covariance".to_owned(),
    };
    let stochastic = summary
        .stochastic
        .map_or(String::new(), |step| format!(" with K by {}", step.name()));
    format!(
        "{}{stochastic}, past window {}, future window {}, {polish}; {covariance}",
        summary.method.name(),
        summary.horizons.past,
        summary.horizons.future
    )
}

impl fmt::Display for Model {
    /// The summary that `innovant identify` prints, without the tests of the residuals.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&model_text(&ModelText {
            model: self,
            tests: None,
            orders: &[],
            style: Style::ASCII,
        }))
    }
}
