//! Everything the template is given.

use serde::Serialize;

use super::closing::{Left, Provenance, changes, detectable, left, noise, provenance};
use super::findings::{Finding, Rival, Where, findings, location, rivals};
use super::maps::{frequency_maps, learned_curve};
use super::number::{probability, width};
use super::plot::Group;
use super::proof::{Proof, proof};
use super::signals::groups;
use super::words::{class, headline, kind, sentence};
use crate::explain::{Explanation, Verdict};

/// The page as the template sees it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct View {
    headline: String,
    kind: &'static str,
    class: &'static str,
    probability: String,
    /// Width of the bar beside the probability, in per cent.
    probability_width: String,
    summary: Vec<String>,
    names: Vec<String>,
    signals: Vec<Group>,
    maps: Vec<Group>,
    findings: Vec<Finding>,
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
    version: String,
}

/// The page of an explanation.
pub(super) fn view(of: &Explanation) -> View {
    let mut maps = frequency_maps(of);
    maps.extend(learned_curve(of));
    View {
        headline: headline(of),
        kind: kind(of.verdict),
        class: class(of.verdict),
        probability: probability(of.probability),
        probability_width: width(of.probability),
        summary: of.summary.clone(),
        names: of.recordings.iter().map(|r| r.name.clone()).collect(),
        signals: groups(of),
        maps,
        findings: findings(of),
        location: location(of),
        proof: proof(of),
        rivals: rivals(of),
        rivals_lost: of.verdict == Verdict::Named,
        changes: changes(of),
        left: left(of),
        noise: noise(of),
        detectable: detectable(of),
        experiment: of.separating_experiment.as_deref().and_then(sentence),
        provenance: provenance(of),
        version: of.version.clone(),
    }
}
