//! The words of the page: what effects and places are called, and the verdict in one sentence.

use crate::explain::{EffectFound, Explanation, Verdict};
pub(super) use crate::report::text::listed;

/// What people call an effect: `coulomb_friction` is `Coulomb friction`.
pub(super) fn effect_name(id: &str) -> String {
    let text = match id {
        "law" => "unlisted function",
        "input_delay" => "input delay",
        "sensor_rectification" => "rectified sensor (absolute value)",
        "sensor_freeze" => "frozen sensor",
        "quadratic_stiffness" => "quadratic stiffness",
        "tank_outflow" => "tank outflow (square root)",
        "missing_input" => "input that the simulation lacks",
        "extra_mode" => "extra resonance",
        "series_backlash_friction" => "backlash and friction in series",
        "static_curve_between_filters" => "static curve between two filters",
        other => {
            return other
                .replace('_', " ")
                .replace("coulomb", "Coulomb")
                .replace("stribeck", "Stribeck");
        }
    };
    text.to_owned()
}

/// The name with its article, as it stands within a sentence.
fn with_article(id: &str) -> String {
    const COUNTED: [&str; 18] = [
        "end_stop",
        "input_dead_zone",
        "input_rate_limit",
        "input_asymmetry",
        "input_delay",
        "law",
        "actuator_lag",
        "sensor_offset",
        "sensor_drift",
        "sensor_rectification",
        "sensor_freeze",
        "periodic_disturbance",
        "load_step",
        "extra_mode",
        "gain_change",
        "stiffness_change",
        "position_dependent_gain",
        "static_curve_between_filters",
    ];
    let name = effect_name(id);
    let article = if id == "missing_input" {
        "an "
    } else if !COUNTED.contains(&id) {
        ""
    } else if name.starts_with(['a', 'e', 'i', 'o', 'u']) {
        "an "
    } else {
        "a "
    };
    format!("{article}{name}")
}

fn effect_at(effect: &EffectFound) -> String {
    let name = with_article(&effect.effect);
    if effect.signal.is_empty() {
        name
    } else {
        format!("{name} at {}", effect.signal)
    }
}

/// The first letter large.
pub(super) fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    match letters.next() {
        Some(first) => first.to_uppercase().chain(letters).collect(),
        None => String::new(),
    }
}

/// The text as a sentence; `None` without any.
pub(super) fn sentence(text: &str) -> Option<String> {
    let text = capitalised(text.trim());
    match text.chars().last()? {
        '.' | '!' | '?' => Some(text),
        _ => Some(format!("{text}.")),
    }
}

/// The verdict in one sentence.
pub(super) fn headline(of: &Explanation) -> String {
    let effects: Vec<String> = of.effects.iter().map(effect_at).collect();
    let together = of.parameters_together.is_some_and(|t| t.rejects());
    match (of.verdict, of.effects.as_slice()) {
        (Verdict::Consistent, _) if !of.remaining.adequate => {
            "No known effect improves the simulation significantly, but the residual is not white."
                .to_owned()
        }
        (Verdict::Consistent, _) if together => {
            "The physics of the simulation is right; its parameters differ, but only together."
                .to_owned()
        }
        (Verdict::Parameters, _) if !of.remaining.adequate => {
            "Other parameters fit the recording better, but the residual is still not white."
                .to_owned()
        }
        (Verdict::Consistent, _) => {
            "The simulation agrees with the recording: nothing differs beyond noise.".to_owned()
        }
        (Verdict::Parameters, _) => {
            "The physics of the simulation is right; its parameters are not.".to_owned()
        }
        (Verdict::Family, [best, ..]) => match of.alternatives.first() {
            Some(tie) => format!(
                "Something is missing: {} or, about as likely, {}.",
                effect_at(best),
                with_article(&tie.effect)
            ),
            None => format!(
                "Something is missing: {} is one of several explanations.",
                effect_at(best)
            ),
        },
        (Verdict::Named, [_, ..]) => format!("The simulation leaves out {}.", listed(&effects)),
        (Verdict::Named | Verdict::Family | Verdict::Unexplained, _) => {
            "The simulation leaves something out that no known effect explains.".to_owned()
        }
    }
}

/// The kind of answer in a word or two.
pub(super) fn kind(of: Verdict) -> &'static str {
    match of {
        Verdict::Consistent => "Consistent",
        Verdict::Parameters => "Other parameters",
        Verdict::Named => "Effect named",
        Verdict::Family => "Several candidates",
        Verdict::Unexplained => "Unexplained",
    }
}

/// The class of a verdict in the style sheet.
pub(super) fn class(of: Verdict) -> &'static str {
    match of {
        Verdict::Consistent => "is-consistent",
        Verdict::Parameters => "is-parameters",
        Verdict::Named => "is-named",
        Verdict::Family => "is-family",
        Verdict::Unexplained => "is-unexplained",
    }
}

/// Where an effect acts.
pub(super) fn port(name: &str) -> String {
    match name {
        "input" => "on the input, before the plant".to_owned(),
        "force" => "as a force inside the plant".to_owned(),
        "inside" => "inside the plant".to_owned(),
        "sensor" => "on the measurement, after the plant".to_owned(),
        "output" => "at the output".to_owned(),
        "path" => "on a path beside the plant".to_owned(),
        "exact" => "sample by sample, in the recording itself".to_owned(),
        "disturbance" => "from outside, as a disturbance".to_owned(),
        other => other.replace('_', " "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn articles_fit() {
        assert_eq!(with_article("coulomb_friction"), "Coulomb friction");
        assert_eq!(with_article("load_step"), "a load step");
        assert_eq!(with_article("extra_mode"), "an extra resonance");
        assert_eq!(with_article("end_stop"), "an end stop");
        assert_eq!(with_article("something_new"), "something new");
    }

    #[test]
    fn lists_read_as_sentences() {
        let words = |n: usize| -> Vec<String> {
            ["a", "b", "c"][..n]
                .iter()
                .map(|s| (*s).to_owned())
                .collect()
        };
        assert_eq!(listed(&words(0)), "");
        assert_eq!(listed(&words(1)), "a");
        assert_eq!(listed(&words(2)), "a and b");
        assert_eq!(listed(&words(3)), "a, b and c");
        assert_eq!(capitalised("élan"), "Élan");
        assert_eq!(sentence(" a step ").as_deref(), Some("A step."));
        assert_eq!(sentence(" "), None);
    }
}
