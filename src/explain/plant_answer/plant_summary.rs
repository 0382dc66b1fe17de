//! The answer in sentences.

use super::Answer;
use super::where_to_look::places;
use super::within_bounds::at_bounds;
use crate::explain::document::sentences::{number, quantity};
use crate::explain::engine::fitting::fitted::TIE;
use crate::explain::engine::select::CHANCE;
use crate::explain::explanation::{
    Alternative, EffectFound, FitSteps, ParameterChange, Quantity, Verdict,
};
use crate::physics::estimate::PlantRecording;

/// Parameters of an effect that the summary lists.
const MOST_ESTIMATES: usize = 6;
/// Rivals that it lists.
const MOST_RIVALS: usize = 4;

impl Answer<'_> {
    pub(super) fn summary(
        &self,
        verdict: Verdict,
        effects: &[EffectFound],
        parameters: &[ParameterChange],
        output: &str,
        (train, held_out): (&FitSteps, Option<&FitSteps>),
        p_value: f64,
    ) -> Vec<String> {
        let mut lines = Vec::new();
        match verdict {
            Verdict::Consistent => lines.push(
                "The equations explain the recording with the values of the text; what is left is noise.".to_owned(),
            ),
            Verdict::Parameters => lines.push(
                "The equations explain the recording with other parameters; nothing is missing in them.".to_owned(),
            ),
            Verdict::Named | Verdict::Family => {
                for effect in effects {
                    lines.push(format!("{}.", effect.sentence));
                    lines.extend(estimates(effect));
                }
            }
            Verdict::Unexplained => {
                lines.push(
                    "Something is missing in the equations, and no term of the library describes it surely.".to_owned(),
                );
                lines.extend(self.found.map.as_ref().and_then(places));
                lines.extend(effects.iter().map(|e| format!("The closest: {}.", e.sentence)));
            }
        }
        if !effects.is_empty() && p_value < CHANCE {
            lines.push(
                "Score tests still find structure in the residuals: more is missing than this."
                    .to_owned(),
            );
        }
        if !parameters.is_empty() {
            let each: Vec<String> = parameters
                .iter()
                .map(|p| {
                    let recorded = Quantity {
                        value: p.recording,
                        std: p.std,
                        unit: p.unit.clone(),
                    };
                    let (name, text) = (&p.name, number(p.simulation));
                    format!("{name} {text} -> {}", quantity(&recorded))
                })
                .collect();
            lines.push(format!(
                "Parameters that differ from the text: {}.",
                each.join("; ")
            ));
        }
        lines.extend(at_bounds(&self.plant.spec, &self.found.fit.point));
        if let (Some(held_out), false) = (held_out, effects.is_empty()) {
            lines.push(format!(
                "Fitted without a third of the recording, and run freely over it: {:.1} % without it, {:.1} % with it.",
                held_out.parameters_only.fit_percent, held_out.augmented.fit_percent
            ));
        }
        lines.push(format!(
            "Free run of {output}: {:.1} % with the values of the text, {:.1} % with estimated parameters and initial states{}.",
            train.simulation.fit_percent,
            train.parameters_only.fit_percent,
            if effects.is_empty() {
                String::new()
            } else {
                format!(", {:.1} % with what was found", train.augmented.fit_percent)
            }
        ));
        lines.extend(self.found.part.map(|part| {
            let all: usize = self.recordings.iter().map(PlantRecording::samples).sum();
            let which = match part.every {
                1 => "in one stretch of each recording".to_owned(),
                every => format!("one in {every}"),
            };
            format!(
                "Effects were searched for in {} of {all} samples, {which}; parameters, free runs and blocks left out are of all.",
                part.samples
            )
        }));
        lines
    }
}

/// What explains the recording as well as the effect that is said to be the closest; none where nothing does.
pub(super) fn as_good(closest: &EffectFound, alternatives: &[Alternative]) -> Option<String> {
    let others = alternatives.iter().filter(|a| {
        a.effect != closest.effect && closest.evidence.criterion_gain - a.criterion_gain <= TIE.0
    });
    let names: Vec<String> = others
        .take(MOST_RIVALS)
        .map(|a| a.effect.replace('_', " "))
        .collect();
    let first = closest.effect.replace('_', " ");
    (!names.is_empty()).then(|| format!("As good as {first} by BIC: {}.", names.join(", ")))
}

/// The parameters of an effect with their standard deviations; none for a curve, which has too many.
fn estimates(effect: &EffectFound) -> Option<String> {
    let few = (1..=MOST_ESTIMATES).contains(&effect.parameters.len());
    let each = effect.parameters.iter();
    let each: Vec<String> = each
        .map(|(name, q)| format!("{name} = {}", quantity(q)))
        .collect();
    few.then(|| format!("Estimated: {}.", each.join("; ")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explain::columns::tests::drag;

    #[test]
    fn what_is_as_good_as_the_closest_is_listed() {
        let closest = &drag().effects[0];
        let rival = |id: &str, less: f64| Alternative {
            effect: id.to_owned(),
            support: 1.0,
            criterion_gain: closest.evidence.criterion_gain - less,
            why_not: String::new(),
        };
        let all = [
            rival(&closest.effect, 0.0),
            rival("natural_convection", 5.0),
            rival("sensor_offset", 7.0),
        ];
        let said = as_good(closest, &all).unwrap();
        assert!(said.ends_with("by BIC: natural convection."), "{said}");
        assert_eq!(as_good(closest, &all[..1]), None);
    }
}
