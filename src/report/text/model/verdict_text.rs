//! The first line: what this model is, and whether to trust it.

use super::validation_text::in_words;
use crate::identify::{Model, Summary};
use crate::report::text::count;
use crate::report::text::number::significant;
use crate::validate::{self, TooShort, Validation};

/// Level below which the test of the order speaks against the model.
const ORDER_TEST_LEVEL: f64 = 0.01;

/// One sentence: size of the model, what it rests on, and the verdict in plain words.
pub fn verdict(model: &Model, tests: Option<&Validation>) -> String {
    let system = &model.system;
    let size = format!(
        "Order {} model of {} from {}",
        system.states(),
        count(system.outputs(), "output"),
        count(system.inputs(), "input")
    );
    let sample_time = significant(system.sample_time, 6);
    match &model.summary {
        None => format!("{size}, sampled every {sample_time} s, without uncertainty"),
        Some(summary) => format!(
            "{size}, {} samples, {sample_time} s: {}",
            summary.samples,
            judgement(model, summary, tests)
        ),
    }
}

/// Whether something speaks against the model.
pub(crate) fn doubtful(summary: &Summary, tests: Option<&Validation>) -> bool {
    summary.diagnostics.predictor_radius >= 1.0
        || tests.is_some_and(|t| t.rejected)
        || order_too_low(summary)
}

fn order_too_low(summary: &Summary) -> bool {
    let test = summary.diagnostics.order_test.as_ref();
    test.and_then(|test| test.p_value)
        .is_some_and(|p| p < ORDER_TEST_LEVEL)
}

/// The recording is too short for anything to speak against the model.
pub(crate) fn too_short(model: &Model, tests: Option<&Validation>) -> Option<TooShort> {
    match (tests, &model.summary) {
        (Some(tests), _) => tests.too_short,
        // No test could be made at all.
        (None, Some(summary)) => {
            let system = &model.system;
            let size = (system.states(), system.inputs(), system.outputs());
            let parameters = model.covariance.as_ref()?.layout.identifiable();
            validate::too_short(size, parameters, summary.samples)
        }
        (None, None) => None,
    }
}

fn judgement(model: &Model, summary: &Summary, tests: Option<&Validation>) -> String {
    let order_too_low = order_too_low(summary);
    let vanished = tests.is_some_and(|t| t.one_step.exact());
    let short = too_short(model, tests).filter(|_| !order_too_low);
    let rejected = tests.is_some_and(|t| t.rejected);
    let unstable_predictor = summary.diagnostics.predictor_radius >= 1.0;
    let main = if let Some(short) = short {
        return short.sentence();
    } else if unstable_predictor {
        "not to be trusted, its one-step predictor is unstable"
    } else if rejected {
        "rejected, the recording holds more than it explains"
    } else if order_too_low {
        "the recording holds more than it explains"
    } else if vanished {
        "exact to rounding"
    } else if let Some(tests) = tests {
        in_words(tests)
    } else {
        "identified"
    };
    match summary.warnings.len() {
        0 => main.to_owned(),
        // The verdict says already what this one warns of.
        1 if order_too_low => main.to_owned(),
        n if doubtful(summary, tests) => {
            format!("{main}; see {}", count(n, "warning"))
        }
        n => format!("{main}, but see {}", count(n, "warning")),
    }
}
