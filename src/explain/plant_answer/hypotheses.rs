//! What is said of the user's hypotheses, whether they win or not.

use std::collections::BTreeMap;

use super::free_runs::figure;
use super::{Answer, within_bounds};
use crate::explain::document::sentences::{number, quantity};
use crate::explain::engine::fitting::fitted::{Fitted, TIE, with_more};
use crate::explain::engine::hypothesis::{Hypothesis, Trial};
use crate::explain::engine::thresholds::{NEEDED, SURE};
use crate::explain::explanation::{
    FitFigure, HypothesisFit, HypothesisFound, HypothesisRival, HypothesisVerdict, Quantity,
};
use crate::noise::Series;
use crate::physics::ModelSpec;
use crate::physics::estimate::{EstimateOptions, Study};

/// Rivals that are listed.
const RIVALS: usize = 5;

impl Answer<'_> {
    /// The id of what was found, or the name of the hypothesis.
    pub(super) fn called(&self, spec: &ModelSpec, fitted: &Fitted) -> String {
        match fitted.hypothesis.and_then(|i| self.hypotheses.get(i)) {
            Some(hypothesis) => hypothesis.name().to_owned(),
            None => crate::explain::engine::terms::names::named(spec, fitted).to_owned(),
        }
    }

    /// One answer for each hypothesis; `output` is the place of the output whose fit is told.
    pub(super) fn hypotheses(
        &self,
        recorded: &Series,
        only: &Series,
        output: usize,
    ) -> Vec<HypothesisFound> {
        let each = self.hypotheses.iter().zip(&self.found.trials).enumerate();
        each.map(|(i, (h, trial))| self.hypothesis(i, h, trial, (recorded, only, output)))
            .collect()
    }

    fn hypothesis(
        &self,
        which: usize,
        hypothesis: &Hypothesis,
        trial: &Trial,
        (recorded, only, output): (&Series, &Series, usize),
    ) -> HypothesisFound {
        let step = trial.accepted.unwrap_or(0);
        let tried = self.found.steps.get(step).map_or(&[][..], Vec::as_slice);
        let own = tried
            .iter()
            .find(|f| f.hypothesis == Some(which))
            .or(trial.alone.as_ref());
        let mut found = HypothesisFound {
            name: hypothesis.name().to_owned(),
            text: hypothesis.text().to_owned(),
            verdict: HypothesisVerdict::Refused,
            gain: None,
            gain_beside: trial.beside.filter(|_| trial.accepted.is_none()),
            gain_needed: NEEDED,
            equation: String::new(),
            parameters: BTreeMap::new(),
            rivals: vec![],
            fit: None,
            sentence: match self.too_short(hypothesis.numbers().len()) {
                Some(short) => format!("The recording is too short for it: {short}."),
                None => "The plant with it cannot be simulated over the recording.".to_owned(),
            },
        };
        let Some(own) = own else {
            return found;
        };
        let again = (trial.accepted.is_none()).then(|| self.by_least_squares(own));
        let own = &again.flatten().unwrap_or_else(|| own.clone());
        let first = self.base.parameters()
            + self.found.steps[..step]
                .iter()
                .filter_map(|s| s.first())
                .map(|f| f.candidate.names.len())
                .sum::<usize>();
        let names = &own.candidate.names;
        let values = &own.fit.point[first..first + names.len()];
        let options = with_more(
            &EstimateOptions {
                free: vec![true; first],
                ..self.found.options.clone()
            },
            names.len(),
        );
        let study = Study::new(&own.candidate.plant, self.recordings, &options).ok();
        let covariance = study
            .as_ref()
            .map(|s| within_bounds(&self.plant.spec, s.covariance(&own.fit)));
        let at_bounds: Vec<String> = hypothesis
            .at_bounds(values)
            .iter()
            .map(|n| n.name.clone())
            .collect();
        for (i, (name, &value)) in names.iter().zip(values).enumerate() {
            let std = covariance
                .as_ref()
                .map(|c| c[(first + i, first + i)].max(0.0).sqrt());
            let stated = hypothesis.numbers()[i].unit.clone();
            let unit = stated.unwrap_or_else(|| self.unit(name));
            // At a bound the curvature says nothing about how certain the number is.
            let inside = !at_bounds.contains(&hypothesis.numbers()[i].name);
            let std = std.filter(|s| inside && s.is_finite() && *s > 0.0);
            found
                .parameters
                .insert(name.clone(), Quantity { value, std, unit });
        }
        found.gain = Some(own.gain);
        found.equation = own.candidate.equation.clone();
        found.rivals = self.rivals(step, tried, own);
        found.fit = study
            .and_then(|s| s.free_run(&own.fit))
            .map(|with| self.figures(recorded, only, &with, output));
        found.verdict = verdict(own, trial, &found, &at_bounds);
        found.sentence = self.hypothesis_sentence(&found, &at_bounds);
        found
    }

    /// A hypothesis beside the plant alone by least squares, where that is what the answer is by: a likelihood whose noise model
    /// follows the recording says little of it.
    fn by_least_squares(&self, own: &Fitted) -> Option<Fitted> {
        if !self.found.options.least_squares {
            return None;
        }
        let first = self.base.parameters();
        let options = EstimateOptions {
            free: vec![true; first],
            ..self.found.options.clone()
        };
        let base = Study::new(self.plant, self.recordings, &options).ok()?;
        let without = base.least_squares(&self.found.baseline.point)?;
        let share = base.effective_share(&without)?;
        let base = base.with_information(share);
        let options = with_more(&options, own.candidate.names.len());
        let study = Study::new(&own.candidate.plant, self.recordings, &options).ok()?;
        let study = study.with_information(share);
        let starts = [&own.fit.point, &own.candidate.from(&without, first).point];
        let fits = starts
            .into_iter()
            .filter_map(|start| study.least_squares(start));
        let fit = fits.min_by(|a, b| a.deviance.total_cmp(&b.deviance))?;
        let gain = base.criterion(&without) - study.criterion(&fit);
        Some(Fitted {
            fit,
            gain,
            ..own.clone()
        })
    }

    fn figures(
        &self,
        recorded: &Series,
        only: &Series,
        with: &Series,
        output: usize,
    ) -> HypothesisFit {
        let recorded = self.column(recorded, output);
        let of = |s: &Series| -> FitFigure { figure(&recorded, &self.column(s, output)) };
        HypothesisFit {
            output: self.outputs()[output].0.clone(),
            parameters_only: of(only),
            with_hypothesis: of(with),
        }
    }

    fn rivals(&self, step: usize, tried: &[Fitted], own: &Fitted) -> Vec<HypothesisRival> {
        let spec = self.spec_before(step);
        let enough = own.gain - tie(own.gain);
        let mut sorted: Vec<&Fitted> = tried
            .iter()
            .filter(|f| f.hypothesis != own.hypothesis && f.gain >= enough && f.gain >= NEEDED)
            .collect();
        sorted.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        let mut rivals: Vec<HypothesisRival> = Vec::new();
        for fitted in sorted {
            let effect = self.called(spec, fitted);
            if rivals.len() < RIVALS && !rivals.iter().any(|r| r.effect == effect) {
                rivals.push(HypothesisRival {
                    effect,
                    gain: fitted.gain,
                    equation: fitted.candidate.equation.clone(),
                });
            }
        }
        rivals
    }

    fn hypothesis_sentence(&self, found: &HypothesisFound, at_bounds: &[String]) -> String {
        let gain = found.gain.unwrap_or(0.0);
        let parameters: Vec<String> = found
            .parameters
            .iter()
            .map(|(name, q)| format!("{name} = {}", quantity(q)))
            .collect();
        let with = if parameters.is_empty() {
            String::new()
        } else {
            format!(" with {}", parameters.join(", "))
        };
        let of = |r: &HypothesisRival| {
            format!("{} (gain {})", r.effect.replace('_', " "), number(r.gain))
        };
        let best = found.rivals.first().map(of);
        let mut text = match found.verdict {
            HypothesisVerdict::Best => format!(
                "It explains the recording{with}: gain {} (needed {}){}.",
                number(gain),
                number(NEEDED),
                match &best {
                    Some(best) => format!(", as well as {best}"),
                    None => ", and nothing else does as well".to_owned(),
                }
            ),
            HypothesisVerdict::Supported => match &best {
                Some(best) => format!(
                    "It explains the recording{with} (gain {}), and so does {best}.",
                    number(gain)
                ),
                None => format!(
                    "It explains the recording{with} (gain {}, needed {}), not surely enough to be named.",
                    number(gain),
                    number(NEEDED)
                ),
            },
            HypothesisVerdict::NotSupported => match &best {
                Some(best) if gain >= NEEDED => format!(
                    "Alone it gains {}{with}, but {best} explains the recording better.",
                    number(gain)
                ),
                _ => format!(
                    "It gains {}{with}, where {} is needed.",
                    number(gain),
                    number(NEEDED)
                ),
            },
            HypothesisVerdict::Refused => format!(
                "Within its bounds it makes nothing better (gain {}): {} at a bound{with}.",
                number(gain),
                match at_bounds {
                    [one] => format!("{one} ends"),
                    several => format!("{} end", several.join(" and ")),
                }
            ),
        };
        if let Some(beside) = found.gain_beside
            && self.found.accepted > 0
        {
            let named: Vec<String> = (0..self.found.accepted)
                .filter_map(|step| {
                    let first = self.found.steps.get(step)?.first()?;
                    Some(self.called(self.spec_before(step), first).replace('_', " "))
                })
                .collect();
            text.push_str(&format!(
                " Beside {} it gains {}.",
                named.join(" and "),
                number(beside)
            ));
        }
        if let Some(fit) = &found.fit {
            text.push_str(&format!(
                " Free run of {}: {:.1} % without it, {:.1} % with it.",
                fit.output, fit.parameters_only.fit_percent, fit.with_hypothesis.fit_percent
            ));
        }
        text
    }
}

/// Gains that differ by less are equal.
fn tie(gain: f64) -> f64 {
    TIE.0.max(TIE.1 * gain)
}

fn verdict(
    own: &Fitted,
    trial: &Trial,
    found: &HypothesisFound,
    at_bounds: &[String],
) -> HypothesisVerdict {
    let better = found.rivals.first().map_or(0.0, |r| r.gain);
    if trial.accepted.is_some() {
        if own.gain >= SURE {
            HypothesisVerdict::Best
        } else {
            HypothesisVerdict::Supported
        }
    } else if own.gain < NEEDED {
        if at_bounds.is_empty() || own.gain > 0.0 {
            HypothesisVerdict::NotSupported
        } else {
            HypothesisVerdict::Refused
        }
    } else if better - own.gain <= tie(better) || trial.beside.is_some_and(|g| g >= NEEDED) {
        HypothesisVerdict::Supported
    } else {
        HypothesisVerdict::NotSupported
    }
}
