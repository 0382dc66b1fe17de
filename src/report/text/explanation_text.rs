//! An explanation for the terminal: the lines that an engineer believes.

use std::fmt::Write as _;

use super::wrapped;
use crate::explain::{Explanation, HypothesisVerdict, Verdict};

/// Verdict and summary.
pub fn explanation_text(explanation: &Explanation) -> String {
    let word = match explanation.verdict {
        Verdict::Consistent => "CONSISTENT",
        Verdict::Parameters => "PARAMETERS",
        Verdict::Named => "NAMED",
        Verdict::Family => "FAMILY",
        Verdict::Unexplained => "UNEXPLAINED",
    };
    let names: Vec<String> = explanation
        .effects
        .iter()
        .map(|e| e.effect.replace('_', " "))
        .collect();
    let mut text = String::new();
    let names = names.join(" and ");
    let _ = match (names.as_str(), explanation.verdict) {
        ("", _) => writeln!(text, "{word}"),
        // Without a proof it is no name.
        (closest, Verdict::Unexplained) => writeln!(text, "{word} (closest: {closest})"),
        (names, _) => writeln!(text, "{word}: {names}"),
    };
    for line in &explanation.summary {
        text.push_str(&wrapped("  ", line));
        if !text.ends_with('\n') {
            text.push('\n');
        }
    }
    for h in &explanation.hypotheses {
        let word = match h.verdict {
            HypothesisVerdict::Best => "BEST",
            HypothesisVerdict::Supported => "SUPPORTED",
            HypothesisVerdict::NotSupported => "NOT SUPPORTED",
            HypothesisVerdict::Refused => "REFUSED",
        };
        let line = format!("Hypothesis {}: {word}. {}", h.name, h.sentence);
        text.push_str(&wrapped("  ", &line));
    }
    text
}
