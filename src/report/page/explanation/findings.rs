//! What was found, where, and against which rivals.

use serde::Serialize;

use super::equation_map::{MapView, equation_map};
use super::explanation_words::{capitalised, effect_name, listed, port};
use super::plot::interval;
use super::typeset_number::{
    fixed, number, p_value, percent, typeset, uncertain, width, with_unit,
};
use crate::explain::{EffectFound, Evidence, Explanation, HypothesisVerdict, Verdict};

/// An effect.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Finding {
    name: String,
    variant: String,
    id: String,
    place: String,
    sentence: String,
    equation: String,
    parameters: Vec<[String; 4]>,
    evidence: Vec<[String; 3]>,
}

/// A line of the table of rivals.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Rival {
    name: String,
    support: String,
    width: String,
    gain: String,
    why: String,
    answer: bool,
}

/// A hypothesis of the user.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Asked {
    name: String,
    text: String,
    verdict: &'static str,
    gain: String,
    sentence: String,
}

/// Where recording and simulation differ.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Where {
    sentences: Vec<String>,
    windows: Vec<[String; 2]>,
    bands: Vec<[String; 2]>,
    regimes: Vec<[String; 4]>,
    map: Option<MapView>,
}

/// The effects, most important first.
pub(super) fn findings(of: &Explanation) -> Vec<Finding> {
    of.effects.iter().map(finding).collect()
}

/// What was asked, in the order of the questions.
pub(super) fn asked(of: &Explanation) -> Vec<Asked> {
    of.hypotheses
        .iter()
        .map(|h| Asked {
            name: h.name.clone(),
            text: h.text.clone(),
            verdict: match h.verdict {
                HypothesisVerdict::Best => "Best",
                HypothesisVerdict::Supported => "Supported",
                HypothesisVerdict::NotSupported => "Not supported",
                HypothesisVerdict::Refused => "Refused",
            },
            gain: h.gain.map_or("–".to_owned(), |g| number(g, 3)),
            sentence: typeset(&h.sentence),
        })
        .collect()
}

fn finding(of: &EffectFound) -> Finding {
    let place = match of.signal.as_str() {
        "" => port(&of.port),
        signal => format!("{signal}, {}", port(&of.port)),
    };
    Finding {
        name: capitalised(&effect_name(&of.effect)),
        variant: of.variant.replace('_', " "),
        id: of.effect.clone(),
        place: place.trim_end_matches([',', ' ']).to_owned(),
        sentence: typeset(&of.sentence),
        equation: of.equation.clone(),
        parameters: of
            .parameters
            .iter()
            .map(|(name, q)| {
                let relative = match q.std {
                    Some(std) if q.value != 0.0 && std > 0.0 => {
                        format!("{} %", number(100.0 * std / q.value.abs(), 2))
                    }
                    _ => "–".to_owned(),
                };
                [
                    name.replace('_', " "),
                    uncertain(q.value, q.std),
                    q.unit.clone(),
                    relative,
                ]
            })
            .collect(),
        evidence: evidence(&of.evidence),
    }
}

/// Found by a test of its own, sample by sample, that needs no criterion.
fn is_exact(of: &Evidence) -> bool {
    of.criterion_gain == 0.0 && of.criterion_needed == 0.0
}

/// What was measured, what it came to, what it is compared with.
fn evidence(of: &Evidence) -> Vec<[String; 3]> {
    if is_exact(of) {
        return Vec::new();
    }
    let mut rows = vec![[
        "Gain in BIC".to_owned(),
        number(of.criterion_gain, 3),
        format!("needed: {}", number(of.criterion_needed, 3)),
    ]];
    if let Some(gain) = of.heldout_gain {
        let reads = if gain > 0.0 {
            "above zero: it foresees what was not fitted"
        } else {
            "not above zero: it does not foresee what was not fitted"
        };
        rows.push([
            "Gain in log likelihood (twice) on blocks never fitted".to_owned(),
            number(gain, 3),
            reads.to_owned(),
        ]);
    }
    if let Some(halves) = of.halves_disagree {
        let reads = if halves < 3.0 {
            "both halves of the recording agree"
        } else {
            "the halves of the recording disagree"
        };
        rows.push([
            "Largest disagreement of the halves, in deviations".to_owned(),
            fixed(halves, 1),
            reads.to_owned(),
        ]);
    }
    rows
}

/// The answer and, below it, what else was tried.
pub(super) fn rivals(of: &Explanation) -> Vec<Rival> {
    if of.alternatives.is_empty() {
        return Vec::new();
    }
    let answer = match of.verdict {
        Verdict::Named | Verdict::Family => of.effects.first(),
        Verdict::Consistent | Verdict::Parameters | Verdict::Unexplained => None,
    };
    let first = answer.map(|effect| {
        let exact = is_exact(&effect.evidence);
        let gain = number(effect.evidence.criterion_gain, 3);
        Rival {
            name: capitalised(&effect_name(&effect.effect)),
            support: percent(1.0, 0),
            width: "100".to_owned(),
            gain: if exact { "–".to_owned() } else { gain },
            why: match (of.verdict, exact) {
                (_, true) => "The answer: seen sample by sample, by a test of its own",
                (Verdict::Named, false) => "The answer",
                (_, false) => "The best so far",
            }
            .to_owned(),
            answer: true,
        }
    });
    let others = of.alternatives.iter().map(|rival| Rival {
        name: capitalised(&effect_name(&rival.effect)),
        support: percent(rival.support, 0),
        width: width(rival.support),
        gain: number(rival.criterion_gain, 3),
        why: rival.why_not.clone(),
        answer: false,
    });
    first.into_iter().chain(others).collect()
}

/// The places; `None` when there are none to speak of.
pub(super) fn location(of: &Explanation) -> Option<Where> {
    let place = &of.location;
    let mut sentences = Vec::new();
    if !place.outputs.is_empty() {
        let differ = match place.outputs.len() {
            1 => "differs",
            _ => "differ",
        };
        let names = listed(&place.outputs);
        sentences.push(format!("{names} {differ} beyond noise."));
    }
    if let Some(at) = place.port.as_deref().filter(|p| !p.is_empty()) {
        sentences.push(format!("The cause lies {}.", port(at)));
    }
    if place.time.is_empty() && !place.outputs.is_empty() {
        sentences.push("The difference runs through the whole recording.".to_owned());
    }
    let found = Where {
        sentences,
        windows: place
            .time
            .iter()
            .map(|[from, to, strength]| [interval(*from, *to, "s"), number(*strength, 3)])
            .collect(),
        bands: place
            .frequency
            .iter()
            .map(|[from, to, excess]| {
                [
                    interval(*from, *to, "Hz"),
                    with_unit(&fixed(*excess, 1), "dB"),
                ]
            })
            .collect(),
        regimes: place
            .regime
            .iter()
            .map(|r| {
                let range = interval(r.from, r.to, "");
                [
                    r.variable.clone(),
                    range,
                    format!("{} ×", number(r.excess, 2)),
                    p_value(r.p_value),
                ]
            })
            .collect(),
        map: place.equations.as_ref().and_then(equation_map),
    };
    let empty = found.sentences.is_empty()
        && found.windows.is_empty()
        && found.bands.is_empty()
        && found.regimes.is_empty()
        && found.map.is_none();
    (!empty).then_some(found)
}
