//! The answer in sentences.

use super::judgement::free_run::{Astray, STRAYS, leaves_half};
use super::where_to_look::places;
use super::within_bounds::at_bounds;
use super::{Answer, Origin};
use crate::explain::document::sentences::{number, p_value, quantity};
use crate::explain::engine::fitting::edit::{is_shared_term, users_of};
use crate::explain::engine::fitting::fitted::{Fitted, TIE};
use crate::explain::engine::select::CHANCE;
use crate::explain::engine::thresholds::{LEFT, NEEDED, SURE};
use crate::explain::explanation::{
    Alternative, EffectFound, FitSteps, JointTest, OutputFit, ParameterChange, Quantity, Verdict,
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
        lines.extend(changes(told.parameters, self.origin));
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

const NOTHING_MISSING: &str = "nothing is missing in them.";

/// Whether a line of a summary says so.
pub(crate) fn says_that_nothing_is_missing(line: &str) -> bool {
    line.ends_with(NOTHING_MISSING)
}

/// What is said where no effect is found.
fn nothing_missing(told: &Told, at_bound: bool, hidden: bool) -> Vec<String> {
    let with = match told.differs {
        Differs::No => "the values of the text",
        Differs::Starts => "the parameters of the text and other initial states",
        Differs::Together(_) => "estimated parameters",
        Differs::Parameters => "other parameters",
    };
    let strays = told.strays > STRAYS;
    let best = told.alternatives.iter().map(|a| a.criterion_gain);
    let no_effect = match best.fold(0.0, f64::max) < NEEDED {
        true => "no effect of the library improves the fit significantly",
        false => "no effect of the library improves simulations of held-out blocks",
    };
    let mut lines = vec![if let Some(short) = &told.too_short {
        format!(
            "Effects were not searched for, because the recording is too short: with one more, {short}."
        )
    } else if told.p_value < LEFT {
        format!(
            "With {with}, {no_effect}, but the residual is not white ({}).",
            p_value(told.p_value)
        )
    } else if let Some(poor) = told.outputs.iter().find(|o| leaves_half(o)) {
        format!(
            "The recording does not refute the equations with {with}, but their free run explains less than half of the variance of \
             {}: it says little of what may be missing.",
            poor.output
        )
    } else if at_bound && !as_well(told) {
        format!("The equations follow the recording with {with} within their bounds; {no_effect}.")
    } else if strays {
        format!("The equations explain the recording with {with} and slow noise; {no_effect}.")
    } else if hidden {
        format!("The equations follow the recording with {with}; {no_effect}.")
    } else if told.verdict == Verdict::Consistent {
        format!("The equations explain the recording with {with}; residuals are white.")
    } else {
        format!("The equations explain the recording with {with}; {NOTHING_MISSING}")
    }];
    if let Differs::Together(test) = told.differs {
        let correlated = match test.largest_correlation {
            r if r > 0.0 => format!(": estimates are correlated, by up to {r:.3}"),
            _ => String::new(),
        };
        lines.push(format!(
            "No parameter differs significantly from the text by itself, but together they do (chi-square {}, {} degrees of \
             freedom, {}){correlated}.",
            number(test.chi_square),
            test.degrees_of_freedom,
            p_value(test.p_value)
        ));
    }
    if strays {
        lines.push(format!(
            "The free run leaves {:.1} times the error of one-step predictions: slow noise and missing physics cannot be told apart \
             in this recording.",
            told.strays
        ));
    }
    lines
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
fn changes(parameters: &[ParameterChange], origin: Origin) -> Option<String> {
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
    let which = match origin {
        Origin::Text => "Parameters that differ from the text",
        Origin::Structure => "Parameters of the equations",
    };
    (!each.is_empty()).then(|| format!("{which}: {}.", each.join("; ")))
}

/// Whether the parameters of the text fit as well as the estimates.
fn as_well(told: &Told) -> bool {
    told.verdict == Verdict::Consistent && matches!(told.differs, Differs::No | Differs::Starts)
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

/// Fits of the blocks left out, without and with the effects.
fn held_out(outputs: &[OutputFit]) -> Option<String> {
    let percent = |o: &OutputFit| {
        let fit = o.heldout.as_ref()?;
        let (without, with) = (fit.parameters_only, fit.augmented);
        Some([without.fit_percent, with.fit_percent])
    };
    let all: Option<Vec<[f64; 2]>> = outputs.iter().map(percent).collect();
    let said = listed(
        outputs,
        &all.filter(|all| !all.is_empty())?,
        &["without it", "with it"],
    );
    Some(format!(
        "Fitted without a third of the recording, and run freely over it: {said}."
    ))
}

/// Free runs of all outputs.
fn free_runs(outputs: &[OutputFit], with_effects: bool, origin: Origin) -> String {
    let words = [
        "with the values of the text",
        "with estimated parameters and initial states",
        "with what was found",
    ];
    let first = usize::from(origin == Origin::Structure);
    let last = if with_effects { 3 } else { 2 };
    let fits = |o: &OutputFit| {
        let t: &FitSteps = &o.train;
        let all = [t.simulation, t.parameters_only, t.augmented];
        all.map(|f| f.fit_percent)[first..last].to_vec()
    };
    let all: Vec<Vec<f64>> = outputs.iter().map(fits).collect();
    let said = listed(outputs, &all, &words[first..last]);
    match outputs {
        [one] => format!("Free run of {}: {said}.", one.output),
        _ => format!("Free run of each output, worst first: {said}."),
    }
}

/// A fit in percent; of a run that leaves the recording altogether only that it does.
fn percent(fit: f64) -> String {
    match fit < -1000.0 {
        true => "< -1000 %".to_owned(),
        false => format!("{fit:.1} %"),
    }
}

/// Fits of outputs; what each is, is said of the first.
fn listed<F: AsRef<[f64]>>(outputs: &[OutputFit], fits: &[F], words: &[&str]) -> String {
    let each = outputs.iter().zip(fits).enumerate();
    let each = each.map(|(i, (output, fits))| {
        let said = fits.as_ref().iter().zip(words).map(|(fit, word)| match i {
            0 => format!("{} {word}", percent(*fit)),
            _ => percent(*fit),
        });
        let said = said.collect::<Vec<_>>().join(", ");
        match outputs.len() {
            1 => said,
            _ => format!("{} {said}", output.output),
        }
    });
    each.collect::<Vec<_>>().join("; ")
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
pub(super) mod tests {
    use super::*;
    use crate::explain::explanation::{Evidence, FitFigure};
    use std::collections::BTreeMap;

    /// An effect with this gain.
    pub(in super::super) fn found(id: &str, criterion_gain: f64) -> EffectFound {
        EffectFound {
            effect: id.to_owned(),
            hypothesis: false,
            variant: String::new(),
            signal: "v".to_owned(),
            port: "process".to_owned(),
            equation: "m*der(v) = u - c*v".to_owned(),
            enters: Some("v".to_owned()),
            depends: vec!["v".to_owned()],
            law: None,
            parameters: BTreeMap::new(),
            evidence: Evidence {
                criterion_gain,
                criterion_needed: NEEDED,
                heldout_gain: None,
                halves_disagree: None,
            },
            sentence: format!("{id} enters the equation of v"),
        }
    }

    #[test]
    fn what_is_as_good_as_the_closest_is_listed() {
        let closest = &found("quadratic_drag", 40.0);
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

    fn output(name: &str, percent: [f64; 3], heldout: Option<[f64; 2]>) -> OutputFit {
        let figure = |fit_percent: f64| FitFigure {
            rmse: 1.0,
            fit_percent,
        };
        let train = FitSteps {
            simulation: figure(percent[0]),
            parameters_only: figure(percent[1]),
            augmented: figure(percent[2]),
            noise_floor: figure(99.0),
            improvement_95: None,
        };
        let heldout = heldout.map(|[without, with]| {
            let mut steps = train.clone();
            steps.parameters_only.fit_percent = without;
            steps.augmented.fit_percent = with;
            steps
        });
        OutputFit {
            output: name.to_owned(),
            train,
            heldout,
        }
    }

    const NOTHING: Told = Told {
        verdict: Verdict::Consistent,
        probability: 0.85,
        effects: &[],
        parameters: &[],
        differs: Differs::No,
        alternatives: &[],
        outputs: &[],
        p_value: 0.3,
        strays: 1.1,
        astray: None,
        refused: None,
        too_short: None,
    };

    #[test]
    fn all_outputs_are_told() {
        let one = [output("y", [10.0, 20.0, 30.0], Some([5.0, 25.0]))];
        assert_eq!(
            free_runs(&one, false, Origin::Text),
            "Free run of y: 10.0 % with the values of the text, 20.0 % with estimated parameters and initial states."
        );
        assert!(
            held_out(&one)
                .unwrap()
                .ends_with("it: 5.0 % without it, 25.0 % with it.")
        );
        let two = [
            output("T2", [10.0, 20.0, 30.0], Some([5.0, 25.0])),
            output("T1", [70.0, 80.0, 90.0], Some([60.0, 85.0])),
        ];
        assert_eq!(
            free_runs(&two, true, Origin::Text),
            "Free run of each output, worst first: T2 10.0 % with the values of the text, 20.0 % with estimated parameters and \
             initial states, 30.0 % with what was found; T1 70.0 %, 80.0 %, 90.0 %."
        );
        let said = held_out(&two).unwrap();
        assert!(
            said.ends_with("T2 5.0 % without it, 25.0 % with it; T1 60.0 %, 85.0 %."),
            "{said}"
        );
        assert_eq!(held_out(&[output("y", [1.0; 3], None)]), None);
    }

    #[test]
    fn a_residual_that_is_not_white_is_not_called_noise() {
        let hidden = nothing_missing(&NOTHING, false, true);
        assert!(!hidden[0].contains("white"), "{hidden:?}");
        let white = nothing_missing(&NOTHING, false, false);
        assert_eq!(
            white,
            [
                "The equations explain the recording with the values of the text; residuals are white."
            ]
        );
        let told = Told {
            p_value: 0.0027,
            strays: 6.3,
            astray: None,
            refused: None,
            too_short: None,
            ..NOTHING
        };
        let said = nothing_missing(&told, false, false);
        assert_eq!(
            said[0],
            "With the values of the text, no effect of the library improves the fit significantly, but the residual is not white \
             (p = 0.0027)."
        );
        assert!(said[1].contains("6.3 times"), "{said:?}");
        assert!(said[1].contains("cannot be told apart"), "{said:?}");
        let told = Told {
            strays: 6.3,
            astray: None,
            refused: None,
            too_short: None,
            ..NOTHING
        };
        assert!(!nothing_missing(&told, false, false)[0].contains("white"));
    }

    #[test]
    fn parameters_that_differ_together_are_not_called_those_of_the_text() {
        let test = JointTest {
            chi_square: 312.0,
            degrees_of_freedom: 4,
            p_value: 0.0,
            largest_correlation: 0.9871,
        };
        let told = Told {
            differs: Differs::Together(test),
            ..NOTHING
        };
        let said = nothing_missing(&told, false, false).join(" ");
        assert!(!said.contains("with the values of the text"), "{said}");
        assert!(
            said.contains("chi-square 312.0, 4 degrees of freedom, p < 1e-12"),
            "{said}"
        );
        assert!(said.contains("by up to 0.987"), "{said}");
    }

    #[test]
    fn a_bound_and_nothing_missing_do_not_stand_together() {
        let bounds = ["UA (min = 1.000)".to_owned()];
        let told = Told {
            verdict: Verdict::Parameters,
            differs: Differs::Parameters,
            ..NOTHING
        };
        assert!(nothing_missing(&told, false, false)[0].ends_with("nothing is missing in them."));
        assert!(!nothing_missing(&told, true, false)[0].contains("nothing is missing"));
        assert!(
            bounds_in_words(&bounds, &told)
                .unwrap()
                .contains("The bound is wrong")
        );
        let said = bounds_in_words(&bounds, &NOTHING).unwrap();
        assert!(!said.contains("The bound is wrong"), "{said}");
        assert_eq!(bounds_in_words(&[], &told), None);
    }

    #[test]
    fn structure_beside_a_name_is_told_with_its_probability() {
        assert!(structure(0.38).contains("no structure in the residuals (p = 0.38)"));
        assert!(structure(0.0063).ends_with("still find structure in the residuals (p = 0.0063)"));
        assert!(structure(1e-25).ends_with("(p < 1e-12): more is missing than this"));
    }

    #[test]
    fn the_closest_candidate_is_not_called_proven() {
        let said = closest(&found("quadratic_drag", 40.0));
        assert!(said.contains("not proven (quadratic_drag): "), "{said}");
    }
}
