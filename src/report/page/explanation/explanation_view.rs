//! Everything the template is given.

use serde::Serialize;

use super::closing::{Left, Provenance, changes, detectable, left, noise, provenance};
use super::explanation_words::{class, headline, kind, sentence};
use super::findings::{Asked, Finding, Rival, Where, asked, findings, location, rivals};
use super::head::{Head, sections};
use super::maps::{frequency_maps, laws, learned_curve};
use super::plot::Group;
use super::proof::{Proof, proof};
use super::signals::groups;
use super::typeset_number::{probability, typeset, width};
use crate::explain::{Explanation, Verdict};

/// The page as the template sees it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct View {
    #[serde(flatten)]
    head: Head,
    headline: String,
    kind: &'static str,
    probability: String,
    /// Width of the bar beside the probability, in per cent.
    probability_width: String,
    summary: Vec<String>,
    signals: Vec<Group>,
    maps: Vec<Group>,
    findings: Vec<Finding>,
    asked: Vec<Asked>,
    location: Option<Where>,
    proof: Proof,
    rivals: Vec<Rival>,
    rivals_lost: bool,
    changes: Vec<[String; 5]>,
    left: Left,
    noise: Vec<[String; 4]>,
    detectable: Vec<[String; 3]>,
    experiment: Option<String>,
    provenance: Provenance,
}

/// The page of an explanation.
pub(super) fn view(of: &Explanation) -> View {
    let mut maps = frequency_maps(of);
    maps.extend(learned_curve(of));
    maps.extend(laws(of));
    let headline = headline(of);
    let (signals, findings, location) = (groups(of), findings(of), location(of));
    let (rivals, changes) = (rivals(of), changes(of));
    let experiment = of.separating_experiment.as_deref().and_then(sentence);
    View {
        head: Head {
            title: headline.clone(),
            class: class(of.verdict),
            command: "explain",
            names: of.recordings.iter().map(|r| r.name.clone()).collect(),
            sections: sections(&[
                ("pictures", "Pictures", !signals.is_empty()),
                ("found", "Effect", !findings.is_empty()),
                ("asked", "Hypotheses", !of.hypotheses.is_empty()),
                ("where", "Where", location.is_some()),
                ("proof", "Proof", true),
                ("rivals", "Rivals", !rivals.is_empty()),
                ("parameters", "Parameters", !changes.is_empty()),
                ("left", "What is left", true),
                ("experiment", "Next experiment", experiment.is_some()),
                ("provenance", "Provenance", true),
            ]),
            version: of.version.clone(),
        },
        headline,
        kind: kind(of.verdict),
        probability: probability(of.probability),
        probability_width: width(of.probability),
        summary: of.summary.iter().map(|line| typeset(line)).collect(),
        signals,
        maps,
        findings,
        asked: asked(of),
        location,
        proof: proof(of),
        rivals,
        rivals_lost: of.verdict == Verdict::Named,
        changes,
        left: left(of),
        noise: noise(of),
        detectable: detectable(of),
        experiment,
        provenance: provenance(of),
    }
}
