//! What is left, what could have been seen, the noise, and where everything comes from.

use serde::Serialize;

use super::explanation_words::{capitalised, effect_name, listed};
use super::provenance::Source;
use super::typeset_number::{exact, fixed, number, p_value, percent, share, with_unit};
use crate::explain::{Explanation, NoiseFound};
use crate::log::Channel;

/// The test of what is left.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Left {
    adequate: bool,
    sentence: String,
    p_value: String,
    share: String,
    features: usize,
}

/// Where everything comes from.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Provenance {
    recordings: Vec<Source>,
    facts: Vec<(&'static str, String)>,
}

/// The test of what is left.
pub(super) fn left(of: &Explanation) -> Left {
    let of = &of.remaining;
    Left {
        adequate: of.adequate,
        sentence: of.sentence.clone(),
        p_value: p_value(of.p_value),
        share: share(of.share),
        features: of.features,
    }
}

/// Properties of the simulation that the recording contradicts: name, simulated, recorded, change, unit.
pub(super) fn changes(of: &Explanation) -> Vec<[String; 5]> {
    of.parameters
        .iter()
        .map(|p| {
            let change = (p.recording - p.simulation) / p.simulation.abs();
            let change = match change {
                c if !c.is_finite() => "–".to_owned(),
                c if c > 0.0 => format!("+{}", percent(c, 1)),
                c => percent(c, 1),
            };
            [
                p.name.clone(),
                number(p.simulation, 4),
                number(p.recording, 4),
                change,
                p.unit.clone(),
            ]
        })
        .collect()
}

/// Smallest effects that would have been seen: effect, channel, share of the output.
pub(super) fn detectable(of: &Explanation) -> Vec<[String; 3]> {
    of.detectable
        .iter()
        .map(|d| {
            [
                capitalised(&effect_name(&d.effect)),
                d.signal.clone(),
                percent(d.share_of_output, 2),
            ]
        })
        .collect()
}

/// The noise of every output: output, scale, colour, tails.
pub(super) fn noise(of: &Explanation) -> Vec<[String; 4]> {
    of.noise
        .iter()
        .map(|n| {
            let unit = of.signals.iter().find(|s| s.output == n.output);
            let unit = unit.map_or("", |s| s.unit.as_str());
            [
                n.output.clone(),
                with_unit(&number(n.innovation_std, 3), unit),
                colour(n),
                match n.degrees_of_freedom {
                    Some(df) => format!("heavy tails (t, {} degrees of freedom)", number(df, 2)),
                    None => "Gaussian".to_owned(),
                },
            ]
        })
        .collect()
}

fn colour(of: &NoiseFound) -> String {
    let listed = |name: &str, numbers: &[f64]| {
        let numbers: Vec<String> = numbers.iter().map(|n| fixed(*n, 2)).collect();
        format!("{name} = {}", numbers.join(", "))
    };
    match (of.autoregression.as_slice(), of.moving_average.as_slice()) {
        ([], []) => "white".to_owned(),
        (a, []) => format!("coloured, {}", listed("a", a)),
        (a, c) => format!("coloured, {}, {}", listed("a", a), listed("c", c)),
    }
}

fn channels(of: &[Channel]) -> String {
    let names: Vec<String> = of
        .iter()
        .map(|c| match &c.unit {
            Some(unit) => format!("{} [{unit}]", c.name),
            None => c.name.clone(),
        })
        .collect();
    listed(&names)
}

/// Where everything comes from.
pub(super) fn provenance(of: &Explanation) -> Provenance {
    let mut facts = vec![];
    if let Some(model) = &of.model {
        facts.extend([
            ("Inputs", channels(&model.inputs)),
            ("Outputs", channels(&model.outputs)),
            ("Sample time", with_unit(&exact(model.sample_time), "s")),
            ("States of the model", model.a.0.nrows().to_string()),
        ]);
        if model.input_delays.iter().any(|d| *d > 0) {
            let delays: Vec<String> = model.input_delays.iter().map(usize::to_string).collect();
            facts.push(("Input delays, in samples", delays.join(", ")));
        }
        if model.reference.is_some() {
            facts.push(("Simulator", "known by its outputs alone".to_owned()));
        }
    }
    if of.plant.is_some() {
        facts.push(("Simulator", "a plant in equations".to_owned()));
    }
    facts.push(("Written by", format!("innovant {}", of.version)));
    facts.push(("Format of the document", of.format.clone()));
    facts.retain(|(_, value)| !value.is_empty());
    Provenance {
        recordings: Source::all(&of.recordings),
        facts,
    }
}
