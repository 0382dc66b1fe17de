//! What was said, compared with the truth: the rules of the shared score.

use std::time::Instant;

use innovant::explain::{Explanation, Options, Verdict, explain};

use super::question::{Question, log};
use crate::concealed::{Case, Truth};

/// Effects that count as one kind.
const FAMILIES: [&[&str]; 2] = [
    &["coulomb_friction", "stribeck_friction"],
    &["gain_change", "x_thermal_derating"],
];
/// What else is taken out of the library with an effect, so that no relative of it stands in for it.
const RELATIVES: [&[&str]; 2] = [
    &["coulomb_friction", "stribeck_friction"],
    &["gain_change", "stiffness_change"],
];
/// Answers whose criteria differ by less explain equally well.
const TIE: f64 = 6.0;

/// How an answer compares with the truth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    Named,
    Family,
    Partial,
    Abstained,
    Missed,
    Wrong,
    TrueNegative,
    FalseAlarm,
    UnlistedRight,
    Failed,
}

/// An answer with its truth.
#[derive(Debug, Clone)]
pub struct Answer {
    pub label: String,
    pub truth: Truth,
    pub outputs: usize,
    pub verdict: Verdict,
    pub named: Vec<String>,
    pub probability: f64,
    pub outcome: Outcome,
    /// For a family: whether the truth is among those said to explain equally well.
    pub tied: bool,
    /// Share of the error on fresh data that the augmented model removes.
    pub removed: Option<f64>,
    /// Intersection over union of the first window with the true one.
    pub overlap: Option<f64>,
    /// Why there is no answer or no simulation.
    pub trouble: Option<String>,
    pub seconds: f64,
}

impl Answer {
    /// Asks, scores, and simulates the fresh input.
    pub fn to(label: String, case: &Case, without: &[String]) -> Self {
        let question = Question::of(case);
        let options = Options {
            without: without.to_vec(),
            seed: 0,
        };
        let start = Instant::now();
        let said = explain(
            std::slice::from_ref(&question.recording),
            &question.simulation,
            &options,
        );
        let mut answer = Self {
            label,
            truth: case.truth.clone(),
            outputs: case.recording.outputs.len(),
            verdict: Verdict::Unexplained,
            named: Vec::new(),
            probability: f64::NAN,
            outcome: Outcome::Failed,
            tied: false,
            removed: None,
            overlap: None,
            trouble: None,
            seconds: start.elapsed().as_secs_f64(),
        };
        match said {
            Ok(explanation) => answer.judge(case, &explanation),
            Err(error) => answer.trouble = Some(error.to_string()),
        }
        answer
    }

    /// Whether what was said is true.
    pub fn is_right(&self) -> bool {
        matches!(
            self.outcome,
            Outcome::Named | Outcome::Family | Outcome::TrueNegative | Outcome::UnlistedRight
        ) || self.tied
    }

    pub fn is_null(&self) -> bool {
        self.truth.effects.is_empty()
    }

    pub fn truth_in_words(&self) -> String {
        if self.is_null() {
            "nothing".to_owned()
        } else {
            self.truth.effects.join(" + ")
        }
    }

    pub fn said_in_words(&self) -> String {
        let verdict = format!("{:?}", self.verdict).to_lowercase();
        match &self.trouble {
            Some(trouble) => format!("{verdict}, {trouble}"),
            None if self.named.is_empty() => verdict,
            None => format!("{verdict}: {}", self.named.join(" + ")),
        }
    }

    fn judge(&mut self, case: &Case, explanation: &Explanation) {
        self.verdict = explanation.verdict;
        self.probability = explanation.probability;
        self.named = explanation
            .effects
            .iter()
            .map(|e| e.effect.clone())
            .collect();
        self.outcome = outcome(&self.truth.effects, self.verdict, &self.named);
        self.tied = self.verdict == Verdict::Family && !self.is_null() && {
            let best = explanation
                .effects
                .first()
                .map_or(0.0, |e| e.evidence.criterion_gain);
            self.truth.effects.iter().all(|id| {
                self.named.contains(id)
                    || explanation
                        .alternatives
                        .iter()
                        .any(|a| a.effect == *id && best - a.criterion_gain < TIE)
            })
        };
        if let Some([from, to]) = self.truth.window {
            self.overlap = Some(
                explanation
                    .location
                    .time
                    .first()
                    .map_or(0.0, |w| overlap([w[0], w[1]], [from, to])),
            );
        }
        // A simulation that is nearly right on fresh data leaves nothing to remove.
        const NEARLY_RIGHT: f64 = 0.02;
        if !self.is_null() && self.truth.rmse_fresh_sim > NEARLY_RIGHT * self.truth.y_std {
            match removed(case, explanation) {
                Ok(share) => self.removed = Some(share),
                Err(error) => self.trouble = Some(error),
            }
        }
    }
}

/// The effects of `truth` and their relatives, to be taken out of the library.
pub fn without(truth: &Truth) -> Vec<String> {
    let mut ids = truth.effects.clone();
    for relatives in RELATIVES {
        if truth.effects.iter().any(|id| relatives.contains(&&**id)) {
            ids.extend(relatives.iter().map(|id| (*id).to_owned()));
        }
    }
    ids.sort();
    ids.dedup();
    ids
}

fn same_family(a: &str, b: &str) -> bool {
    a == b
        || FAMILIES
            .iter()
            .any(|family| family.contains(&a) && family.contains(&b))
}

fn outcome(real: &[String], verdict: Verdict, named: &[String]) -> Outcome {
    let listed = real.iter().any(|id| !id.starts_with("x_"));
    let quiet = matches!(verdict, Verdict::Consistent | Verdict::Parameters);
    match (real.is_empty(), quiet) {
        (true, true) => return Outcome::TrueNegative,
        (true, false) => return Outcome::FalseAlarm,
        (false, true) => return Outcome::Missed,
        (false, false) => {}
    }
    if verdict == Verdict::Unexplained {
        return if listed {
            Outcome::Abstained
        } else {
            Outcome::UnlistedRight
        };
    }
    if !listed {
        return Outcome::Wrong;
    }
    let kin = real
        .iter()
        .filter(|t| named.iter().any(|n| same_family(t, n)))
        .count();
    let extra = named
        .iter()
        .any(|n| !real.iter().any(|t| same_family(t, n)));
    if real.iter().all(|t| named.contains(t)) && !extra {
        Outcome::Named
    } else if kin == real.len() && !extra {
        Outcome::Family
    } else if kin > 0 {
        Outcome::Partial
    } else {
        Outcome::Wrong
    }
}

fn overlap(a: [f64; 2], b: [f64; 2]) -> f64 {
    let common = (a[1].min(b[1]) - a[0].max(b[0])).max(0.0);
    let union = a[1].max(b[1]) - a[0].min(b[0]);
    if union > 0.0 { common / union } else { 0.0 }
}

/// Share of the simulation's error on the first output that the augmented model removes on the fresh input.
fn removed(case: &Case, explanation: &Explanation) -> Result<f64, String> {
    let inputs: Vec<&[f64]> = case.fresh_input.iter().map(Vec::as_slice).collect();
    let predicted = match (&explanation.model, &explanation.plant) {
        (Some(model), _) => {
            let simulated: Option<Vec<&[f64]>> = case
                .fresh_simulation
                .as_ref()
                .map(|s| s.iter().map(Vec::as_slice).collect());
            model
                .simulate(&inputs, None, simulated.as_deref())
                .map_err(|error| error.to_string())?
        }
        (None, Some(plant)) => {
            let fresh = log("fresh", case.truth.dt, &case.fresh_input, &case.fresh_truth);
            plant
                .simulate(&fresh, case.fresh_simulation.as_deref())
                .map_err(|error| error.to_string())?
        }
        (None, None) => return Err("nothing to simulate".to_owned()),
    };
    let (y, truth) = (&predicted[0], &case.fresh_truth[0]);
    let start = y.len() / 20;
    let square: f64 = y[start..]
        .iter()
        .zip(&truth[start..])
        .map(|(a, b)| (a - b).powi(2))
        .sum();
    let error = (square / (y.len() - start) as f64).sqrt();
    Ok(1.0 - error / case.truth.rmse_fresh_sim)
}
