//! The answer in sentences.

mod fits_in_words;
mod nothing_missing;

pub(crate) use nothing_missing::says_that_nothing_is_missing;

use self::fits_in_words::{free_runs, held_out};
use self::nothing_missing::{as_well, nothing_missing};
use super::judgement::free_run::{Astray, STRAYS};
use super::where_to_look::places;
use super::within_bounds::at_bounds;
use super::{Answer, Origin};
use crate::explain::document::sentences::{number, p_value, quantity};
use crate::explain::engine::fitting::edit::{is_shared_term, users_of};
use crate::explain::engine::fitting::fitted::{Fitted, TIE};
use crate::explain::engine::select::CHANCE;
use crate::explain::engine::thresholds::{LEFT, NEEDED, SURE};
use crate::explain::explanation::{
    Alternative, EffectFound, JointTest, OutputFit, ParameterChange, Quantity, Verdict,
};
use crate::physics::estimate::{EstimateError, PlantRecording};
use crate::physics::{Equation, VariableId};

/// Rivals that the summary lists.
const MOST_RIVALS: usize = 4;
/// How the estimates differ from the text, where nothing is missing in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Differs {
    /// By no more than their standard deviations.
    No,
    /// In the initial states.
    Starts,
    /// In the parameters as a whole.
    Together(JointTest),
    /// In single parameters.
    Parameters,
}

/// What is told of an answer.
pub(super) struct Told<'a> {
    pub(super) verdict: Verdict,
    pub(super) probability: f64,
    pub(super) effects: &'a [EffectFound],
    pub(super) parameters: &'a [ParameterChange],
    pub(super) differs: Differs,
    pub(super) alternatives: &'a [Alternative],
    /// Free runs of the outputs, worst first.
    pub(super) outputs: &'a [OutputFit],
    /// Of the strongest score test at the end.
    pub(super) p_value: f64,
    /// Error of the free run over that of one-step predictions.
    pub(super) strays: f64,
    /// Without an effect, why the free run is too poor for nothing to be missing.
    pub(super) astray: Option<Astray>,
    /// What the criterion is sure of, but blocks left out refuse.
    pub(super) refused: Option<&'a Alternative>,
    /// Why no term can be added, where the recording is too short.
    pub(super) too_short: Option<EstimateError>,
}

impl Answer<'_> {
    pub(super) fn summary(&self, told: &Told) -> Vec<String> {
        let mut lines = Vec::new();
        let bounds = at_bounds(&self.plant.spec, &self.found.fit.point, &self.covariance);
        match told.verdict {
            Verdict::Consistent | Verdict::Parameters => {
                let hidden = self.found.likelier.as_ref();
                let bound = !bounds.determined.is_empty();
                lines.extend(nothing_missing(told, bound, hidden.is_some()));
                lines.extend(hidden.map(|f| self.hidden(f)));
            }
            Verdict::Named | Verdict::Family => {
                for (effect, fitted) in told.effects.iter().zip(self.effects()) {
                    lines.push(format!("{}.", effect.sentence));
                    lines.extend(self.estimates(fitted, effect, "Estimated"));
                }
                let gain = self.found.gain();
                if gain < SURE {
                    lines.push(format!(
                        "By BIC alone it would not be named (gain {}, needed {}): it takes more than half of the mean square off \
                         held-out blocks, and no other function takes as much off them.",
                        number(gain),
                        number(SURE)
                    ));
                }
                lines.push(format!(
                    "Probability that this is right: {:.0} %; {}.",
                    100.0 * told.probability,
                    structure(told.p_value)
                ));
            }
            Verdict::Unexplained => {
                lines.push(
                    "Something is missing in the equations, and no term of the library describes it surely.".to_owned(),
                );
                lines.extend(told.astray.as_ref().map(|astray| match astray {
                    Astray::WorseThanConstant(output) => format!(
                        "A constant follows {output} better than the free run of the equations does."
                    ),
                    Astray::AsConstant => "A constant follows the recording better than the equations do with the values of the text, and \
                                           as well as they do with any others."
                        .to_owned(),
                    Astray::Slow if told.strays > STRAYS => format!(
                        "The free run leaves {:.1} times the error of one-step predictions, and more than half of the variance: \
                         no noise of a sensor is so slow.",
                        told.strays
                    ),
                    Astray::Slow => "The free run leaves more than half of the variance, and its error changes slowly: no noise of a \
                                     sensor is so slow."
                        .to_owned(),
                }));
                lines.extend(told.refused.map(|a| {
                    format!(
                        "The effect `{}` improves the fit (gain {:.1}, needed {NEEDED:.1}), but not simulations of held-out blocks: {}.",
                        a.effect,
                        a.criterion_gain,
                        a.why_not.split(": its criterion").next().unwrap_or_default()
                    )
                }));
                lines.extend(self.found.map.as_ref().and_then(places));
                for (effect, fitted) in told.effects.iter().zip(self.effects()) {
                    lines.push(closest(effect));
                    lines.extend(self.doubt(fitted).map(|doubt| doubt.to_string()));
                    lines.extend(self.estimates(
                        fitted,
                        effect,
                        "Its estimates, if it is the cause",
                    ));
                }
                if !told.effects.is_empty() && told.p_value < LEFT {
                    lines.push(format!("With it, {}.", structure(told.p_value)));
                }
            }
        }
        lines.extend(self.shared_terms(told.effects));
        let unproven = told.verdict == Verdict::Unexplained && !told.effects.is_empty();
        lines.extend(changes(told.parameters, self.origin, unproven));
        // The bounds of a structure are those of physics: a spring that is not there is at one.
        let written = self.origin == Origin::Text;
        lines.extend(bounds_in_words(&bounds.determined, told).filter(|_| written));
        lines.extend((written && !bounds.undetermined.is_empty()).then(|| {
            format!(
                "At a bound of the text, and the recording alone says less of it than its bounds: {}.",
                bounds.undetermined.join(", ")
            )
        }));
        let with_effects = !told.effects.is_empty();
        if with_effects {
            lines.extend(held_out(told.outputs));
        }
        lines.push(free_runs(told.outputs, with_effects, self.origin));
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

impl Answer<'_> {
    /// What stands for terms that several rates share, where effects enter there.
    fn shared_terms(&self, effects: &[EffectFound]) -> Option<String> {
        let spec = &self.plant.spec;
        let named = |v: &VariableId| {
            let name = &spec.variable(*v).name;
            is_shared_term(spec, *v) && effects.iter().any(|e| e.sentence.contains(name))
        };
        let said = |e: &Equation| {
            let v = e.unknown.variable();
            let span = spec.expressions.span(e.right);
            let name = |v: VariableId| spec.variable(v).name.clone();
            let users: Vec<String> = users_of(spec, v).into_iter().map(name).collect();
            let text = &spec.text[span.start..span.end];
            format!(
                "{} = {text} of the text is what the equations of {} share.",
                name(v),
                users.join(" and ")
            )
        };
        let equations = spec
            .equations
            .iter()
            .filter(|e| named(&e.unknown.variable()));
        let each: Vec<String> = equations.map(said).collect();
        (!each.is_empty()).then(|| each.join(" "))
    }

    /// An effect that makes the residual likelier, each with a noise model of its own, but of which few values are independent: what is
    /// missing may make them depend on each other.
    fn hidden(&self, fitted: &Fitted) -> String {
        format!(
            "Something may be missing: with the effect `{}`, {}, the residual is likelier as coloured noise, but without it few values \
             are independent, and they do not prove it (gain {}, needed {}).",
            self.called(&self.plant.spec, fitted),
            fitted.candidate.equation,
            number(fitted.gain),
            number(NEEDED)
        )
    }
}

/// What score tests find beside an effect.
fn structure(p: f64) -> String {
    let probability = p_value(p);
    if p >= LEFT {
        return format!("score tests find no structure in the residuals ({probability})");
    }
    let more = if p < CHANCE {
        ": more is missing than this"
    } else {
        ""
    };
    format!("score tests still find structure in the residuals ({probability}){more}")
}

/// An effect that is not proven.
fn closest(effect: &EffectFound) -> String {
    let id = match effect.hypothesis {
        true => String::new(),
        false => format!(" ({})", effect.effect),
    };
    format!(
        "The closest candidate, which is not proven{id}: {}.",
        effect.sentence
    )
}

/// Parameters that differ from the text, or all of a structure.
fn changes(parameters: &[ParameterChange], origin: Origin, unproven: bool) -> Option<String> {
    let each: Vec<String> = parameters
        .iter()
        .map(|p| {
            let recorded = Quantity {
                value: p.recording,
                std: p.std,
                unit: p.unit.clone(),
            };
            let (name, now) = (&p.name, quantity(&recorded));
            match origin {
                Origin::Text => format!("{name} {} -> {now}", number(p.simulation)),
                Origin::Structure => format!("{name} = {now}"),
            }
        })
        .collect();
    let which = match (origin, unproven) {
        (Origin::Text, false) => "Parameters that differ from the text",
        (Origin::Text, true) => "With this candidate, parameters that differ from the text",
        (Origin::Structure, _) => "Parameters of the equations",
    };
    (!each.is_empty()).then(|| format!("{which}: {}.", each.join("; ")))
}

/// Parameters at bounds, and what that says: nothing where the values of the text do as well.
fn bounds_in_words(bounds: &[String], told: &Told) -> Option<String> {
    let which = bounds.join(", ");
    (!bounds.is_empty()).then(|| {
        if as_well(told) {
            format!("At a bound of the text, but no significant difference from it: {which}.")
        } else {
            format!(
                "At a bound of the text: {which}. The bound is wrong, or something else in the equations."
            )
        }
    })
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

#[cfg(test)]
pub(super) mod tests;
