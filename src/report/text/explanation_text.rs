//! An explanation for the terminal: the lines that an engineer believes.

use std::fmt::Write as _;

use super::{listed, wrapped};
use crate::explain::{EffectFound, Explanation, HypothesisVerdict, Verdict};

/// Verdict and summary.
pub fn explanation_text(explanation: &Explanation) -> String {
    let word = match explanation.verdict {
        Verdict::Consistent => "CONSISTENT",
        Verdict::Parameters => "PARAMETERS",
        Verdict::Named => "NAMED",
        Verdict::Family => "FAMILY",
        Verdict::Unexplained => "UNEXPLAINED",
    };
    let same = |e: &EffectFound| {
        explanation
            .effects
            .iter()
            .filter(|o| o.effect == e.effect)
            .count()
    };
    let name = |e: &EffectFound| match (same(e), &e.enters) {
        (2.., Some(place)) => format!("{} of {place}", e.effect.replace('_', " ")),
        _ => e.effect.replace('_', " "),
    };
    let names: Vec<String> = explanation.effects.iter().map(name).collect();
    let mut text = String::new();
    let names = listed(&names);
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
