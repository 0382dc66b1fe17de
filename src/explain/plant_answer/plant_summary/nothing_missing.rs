//! What is said where no effect is found.

use super::{Differs, Told};
use crate::explain::document::sentences::{number, p_value};
use crate::explain::engine::thresholds::{LEFT, NEEDED};
use crate::explain::explanation::Verdict;
use crate::explain::plant_answer::judgement::free_run::{STRAYS, leaves_half};

const NOTHING_MISSING: &str = "nothing is missing in them.";

/// Whether a line of a summary says so.
pub(crate) fn says_that_nothing_is_missing(line: &str) -> bool {
    line.ends_with(NOTHING_MISSING)
}

/// What is said where no effect is found.
pub(super) fn nothing_missing(told: &Told, at_bound: bool, hidden: bool) -> Vec<String> {
    let with = match told.differs {
        Differs::No => "the values of the text",
        Differs::Starts => "the parameters of the text and other initial states",
        Differs::Together(_) => "estimated parameters",
        Differs::Parameters => "other parameters",
    };
    let strays = told.strays > STRAYS;
    let best = told.alternatives.iter().map(|a| a.criterion_gain);
    let no_effect = match best.fold(0.0, f64::max) < NEEDED {
        true => "no effect of the library improves the fit significantly",
        false => "no effect of the library improves simulations of held-out blocks",
    };
    let mut lines = vec![if let Some(short) = &told.too_short {
        format!(
            "Effects were not searched for, because the recording is too short: with one more, {short}."
        )
    } else if told.p_value < LEFT {
        format!(
            "With {with}, {no_effect}, but the residual is not white ({}).",
            p_value(told.p_value)
        )
    } else if let Some(poor) = told.outputs.iter().find(|o| leaves_half(o)) {
        format!(
            "The recording does not refute the equations with {with}, but their free run explains less than half of the variance of \
             {}: it says little of what may be missing.",
            poor.output
        )
    } else if at_bound && !as_well(told) {
        format!("The equations follow the recording with {with} within their bounds; {no_effect}.")
    } else if strays {
        format!("The equations explain the recording with {with} and slow noise; {no_effect}.")
    } else if hidden {
        format!("The equations follow the recording with {with}; {no_effect}.")
    } else if told.verdict == Verdict::Consistent {
        format!("The equations explain the recording with {with}; residuals are white.")
    } else {
        format!("The equations explain the recording with {with}; {NOTHING_MISSING}")
    }];
    if let Differs::Together(test) = told.differs {
        let correlated = match test.largest_correlation {
            r if r > 0.0 => format!(": estimates are correlated, by up to {r:.3}"),
            _ => String::new(),
        };
        lines.push(format!(
            "No parameter differs significantly from the text by itself, but together they do (chi-square {}, {} degrees of \
             freedom, {}){correlated}.",
            number(test.chi_square),
            test.degrees_of_freedom,
            p_value(test.p_value)
        ));
    }
    if strays {
        lines.push(format!(
            "The free run leaves {:.1} times the error of one-step predictions: slow noise and missing physics cannot be told apart \
             in this recording.",
            told.strays
        ));
    }
    lines
}

/// Whether the parameters of the text fit as well as the estimates.
pub(super) fn as_well(told: &Told) -> bool {
    told.verdict == Verdict::Consistent && matches!(told.differs, Differs::No | Differs::Starts)
}
