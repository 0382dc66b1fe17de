//! Units, sentences and summaries.

use crate::explain::effects::{Definition, Port, Unit};
use crate::explain::explanation::{EFFECTS_TIE, EffectFound, Explanation, Quantity, Verdict};
use crate::log::Channel;

/// What is said first where nothing is named.
pub(crate) const NOTHING_ADEQUATE: &str =
    "Something is missing in the simulation that nothing in the library explains adequately.";

/// The recording that shows what is not linear.
pub(crate) const OTHER_AMPLITUDES: &str = "repeat the recording at half and at twice the amplitude, and once with a slow ramp over the whole range";

/// Unit of a parameter, as far as the channels' units tell.
pub(crate) fn unit_text(unit: Unit, input: &Channel, output: &Channel, integral: bool) -> String {
    let of = |channel: &Channel| channel.unit.clone();
    let per =
        |unit: Option<String>, more: &str| unit.map_or_else(String::new, |u| format!("{u}{more}"));
    match unit {
        Unit::Input => per(of(input), ""),
        Unit::InputRate => per(of(input), "/s"),
        Unit::InputSeconds => per(of(input), " s"),
        Unit::Position if integral => per(of(output), " s"),
        Unit::Position => per(of(output), ""),
        Unit::Rate if integral => per(of(output), ""),
        Unit::Rate => per(of(output), "/s"),
        Unit::Second => "s".to_owned(),
        Unit::Hertz => "Hz".to_owned(),
        Unit::Radian => "rad".to_owned(),
        Unit::Ratio => String::new(),
    }
}

/// A number with as many digits as it deserves.
pub(crate) fn number(value: f64) -> String {
    let size = value.abs();
    if size != 0.0 && !(1e-3..1e5).contains(&size) {
        format!("{value:.3e}")
    } else {
        let digits = if size == 0.0 {
            0
        } else {
            (3 - size.log10().floor() as i32).clamp(0, 6) as usize
        };
        format!("{value:.digits$}")
    }
}

/// An uncertainty so many times its value says that the recording hardly determines it.
const HARDLY: f64 = 10.0;
/// Probability by chance from which on what is left is called noise.
const WHITE: f64 = 0.01;

/// Digits after the point, at most.
const MOST_DIGITS: i32 = 9;

/// `0.42 +- 0.03 N`.
pub(crate) fn quantity(q: &Quantity) -> String {
    let unit = if q.unit.is_empty() {
        String::new()
    } else {
        format!(" {}", q.unit)
    };
    match q.std {
        Some(std) if std > 0.0 && std < HARDLY * q.value.abs().max(1e-300) => {
            let wanted = 1 - std.log10().floor() as i32;
            let digits = wanted.clamp(0, MOST_DIGITS) as usize;
            if !(1e-4..1e6).contains(&q.value.abs()) {
                format!("{} +- {std:.1e}{unit}", number(q.value))
            } else if wanted > MOST_DIGITS + 1 {
                format!("{:.digits$} +- {std:.0e}{unit}", q.value)
            } else {
                format!("{:.digits$} +- {std:.digits$}{unit}", q.value)
            }
        }
        Some(std) if std > 0.0 => format!(
            "{}{unit} (hardly determined: +- {}{unit})",
            number(q.value),
            number(std)
        ),
        _ => format!("{}{unit}", number(q.value)),
    }
}

/// `p = 0.38`, with as many digits as say something.
pub(crate) fn p_value(p: f64) -> String {
    if p >= 0.1 {
        format!("p = {p:.2}")
    } else if p >= 1e-3 {
        let short = format!("{p:.1e}").parse::<f64>();
        short.map_or_else(|_| format!("p = {p:.3}"), |p| format!("p = {p}"))
    } else if p >= 1e-12 {
        format!("p = {p:.0e}")
    } else {
        "p < 1e-12".to_owned()
    }
}

/// Where an effect sits, in words.
pub(crate) fn place(definition: &Definition, signal: &str) -> String {
    match definition.port() {
        Port::Input => format!("at the input {signal}"),
        Port::Force => format!("inside the plant, seen at {signal}"),
        Port::Sensor | Port::Exact => format!("at the sensor of {signal}"),
        Port::Path => format!("on the way from {signal}"),
    }
}

/// The sentence of one effect.
pub(crate) fn sentence(definition: &Definition, found: &EffectFound) -> String {
    let numbers: Vec<String> = found
        .parameters
        .iter()
        .filter(|(name, _)| !name.starts_with("direction"))
        .take(4)
        .map(|(name, q)| format!("{} {}", name.replace('_', " "), quantity(q)))
        .collect();
    let numbers = if numbers.is_empty() {
        String::new()
    } else {
        format!(": {}", numbers.join(", "))
    };
    let mut text = format!(
        "{} {}{numbers}.",
        definition.name,
        place(definition, &found.signal)
    );
    if let Some(first) = text.get_mut(0..1) {
        first.make_ascii_uppercase();
    }
    text
}

/// The lines that the terminal shows.
pub(crate) fn summary(e: &Explanation, needed: f64) -> Vec<String> {
    let mut lines = Vec::new();
    let percent = |p: f64| format!("{:.0} %", 100.0 * p);
    match e.verdict {
        Verdict::Consistent | Verdict::Parameters if e.fit.train.augmented.leaves_half() => {
            lines.push(format!(
                "The recording does not refute the simulation, but its free run explains less than half of the variance of {}: it says \
                 little of what may be missing.",
                e.fit.output
            ));
        }
        Verdict::Consistent => lines.push(format!(
            "The recording agrees with the simulation: no difference beyond noise (probability {}).",
            percent(e.probability)
        )),
        Verdict::Parameters => lines.push(format!(
            "Same physics, other parameters (probability {}).",
            percent(e.probability)
        )),
        Verdict::Named => lines.extend(e.effects.iter().map(|f| f.sentence.clone())),
        Verdict::Family => {
            lines.extend(e.effects.iter().map(|f| f.sentence.clone()));
            let best = e.effects.first().map_or(0.0, |f| f.evidence.criterion_gain);
            let ties: Vec<String> = e
                .alternatives
                .iter()
                .filter(|a| best - a.criterion_gain < EFFECTS_TIE)
                .take(3)
                .map(|a| a.effect.replace('_', " "))
                .collect();
            if !ties.is_empty() {
                lines.push(format!("This recording does not tell it from {}.", ties.join(" or ")));
            }
        }
        Verdict::Unexplained => lines.push(
            NOTHING_ADEQUATE.to_owned(),
        ),
    }
    if let (Verdict::Unexplained, Some(nearest)) = (e.verdict, e.alternatives.first())
        && nearest.criterion_gain > needed
    {
        lines.push(format!(
            "The nearest is {}, and it is not named: {}.",
            nearest.effect.replace('_', " "),
            nearest.why_not.trim_end_matches('.')
        ));
    }
    if !matches!(e.verdict, Verdict::Consistent | Verdict::Parameters) {
        lines.push(match e.location.time.as_slice() {
            [] => format!(
                "Where: {}, throughout the recording.",
                e.location.outputs.join(", ")
            ),
            [first, ..] => format!(
                "Where: {}, from {} s to {} s.",
                e.location.outputs.join(", "),
                number(first[0]),
                number(first[1])
            ),
        });
    }
    if let Some(heldout) = &e.fit.heldout {
        let f = |v: f64| format!("{v:.1} %");
        // What was found is other parameters when the verdict says so, and nothing when it says consistent.
        let steps = match e.verdict {
            Verdict::Consistent => f(heldout.simulation.fit_percent),
            Verdict::Parameters => {
                let (simulation, other) = (&heldout.simulation, &heldout.augmented);
                let worse = match other.fit_percent < simulation.fit_percent {
                    true => ", which are no better",
                    false => "",
                };
                format!(
                    "simulation {}, other parameters {}{worse}",
                    f(simulation.fit_percent),
                    f(other.fit_percent)
                )
            }
            Verdict::Named | Verdict::Family | Verdict::Unexplained => format!(
                "simulation {}, other parameters {}, with this {}",
                f(heldout.simulation.fit_percent),
                f(heldout.parameters_only.fit_percent),
                f(heldout.augmented.fit_percent)
            ),
        };
        // Where tests find something in what is left, it is not noise alone, nor where the simulator is not known.
        let is_known = e.model.as_ref().is_none_or(|m| m.reference.is_none());
        let allows = match is_known && e.remaining.p_value >= WHITE {
            true => format!("; noise allows {}", f(heldout.noise_floor.fit_percent)),
            false => String::new(),
        };
        lines.push(format!(
            "Fit of {} on blocks that were never fitted: {steps}{allows}.",
            e.fit.output
        ));
    }
    if let (Verdict::Parameters, true) = (e.verdict, !e.parameters.is_empty()) {
        let changes: Vec<String> = e
            .parameters
            .iter()
            .take(4)
            .map(|p| {
                let recording = Quantity {
                    value: p.recording,
                    std: p.std,
                    unit: p.unit.clone(),
                };
                format!(
                    "{} {} -> {}",
                    p.name,
                    number(p.simulation),
                    quantity(&recording)
                )
            })
            .collect();
        lines.push(format!("{}.", changes.join("; ").trim_end()));
    }
    // The best rival that lost; those that tie are named above.
    let best = e.effects.first().map_or(0.0, |f| f.evidence.criterion_gain);
    let lost = e
        .alternatives
        .iter()
        .find(|a| best - a.criterion_gain >= EFFECTS_TIE);
    if let (Verdict::Named | Verdict::Family, Some(rival)) = (e.verdict, lost) {
        lines.push(format!(
            "Not {}: {}.",
            rival.effect.replace('_', " "),
            rival.why_not.trim_end_matches('.')
        ));
    }
    if matches!(
        e.verdict,
        Verdict::Named | Verdict::Family | Verdict::Unexplained
    ) {
        let gain = e.effects.first().map(|f| f.evidence.criterion_gain);
        lines.push(format!(
            "{}Probability that this is right: {}. {}",
            gain.filter(|g| *g > 0.0)
                .map_or_else(String::new, |g| format!(
                    "Evidence {} (needed {needed:.0}). ",
                    number(g)
                )),
            percent(e.probability),
            e.remaining.sentence
        ));
    }
    if let Some(experiment) = &e.separating_experiment {
        lines.push(format!("To settle it: {experiment}."));
    }
    if matches!(e.verdict, Verdict::Consistent | Verdict::Parameters) && !e.detectable.is_empty() {
        let list: Vec<String> = e
            .detectable
            .iter()
            .take(3)
            .map(|d| {
                format!(
                    "{} from {:.2} %",
                    d.effect.replace('_', " "),
                    100.0 * d.share_of_output
                )
            })
            .collect();
        lines.push(format!(
            "This recording would have shown {} of the output.",
            list.join(", ")
        ));
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probabilities_have_the_digits_that_say_something() {
        for (p, text) in [
            (0.384, "p = 0.38"),
            (0.0234, "p = 0.023"),
            (4.2e-9, "p = 4e-9"),
            (0.0, "p < 1e-12"),
        ] {
            assert_eq!(p_value(p), text);
        }
    }

    #[test]
    fn quantities_say_how_certain_they_are() {
        let said = |value: f64, std: Option<f64>| {
            quantity(&Quantity {
                value,
                std,
                unit: "s".to_owned(),
            })
        };
        assert_eq!(said(0.4213, Some(0.031)), "0.421 +- 0.031 s");
        assert_eq!(said(-12.0, Some(3.0)), "-12.0 +- 3.0 s");
        assert_eq!(said(2.5e-7, Some(1e-8)), "2.500e-7 +- 1.0e-8 s");
        assert_eq!(said(1.216e-10, Some(1e-12)), "1.216e-10 +- 1.0e-12 s");
        assert_eq!(
            said(0.5548, Some(28.0)),
            "0.5548 s (hardly determined: +- 28.00 s)"
        );
        assert_eq!(said(0.5548, None), "0.5548 s");
    }
}
