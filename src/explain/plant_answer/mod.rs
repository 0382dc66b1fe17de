//! The answer where the simulation is a plant in equations.

mod formula_in_numbers;
mod free_runs;
mod hypotheses;
mod judgement;
mod location;
mod nearest_to_text;
mod plant_effects;
mod plant_summary;
mod question;
mod simulate_explained;
mod where_to_look;
mod within_bounds;

pub(crate) use plant_effects::spoken;
pub(crate) use plant_summary::says_that_nothing_is_missing;
pub(crate) use question::Origin;
pub use question::{PlantOptions, PlantQuestionError};
pub use simulate_explained::{AugmentedPlantError, Original};

use nalgebra::DMatrix;

use self::judgement::doubt::{Doubt, doubt, is_safe};
use self::judgement::free_run::astray;
use self::judgement::joint_test::{LEVEL, joint_test};
use self::judgement::stated_probability::probability;
use self::nearest_to_text::nearest_to_text;
use self::plant_summary::{Differs, Told, as_good};
use self::where_to_look::experiment;
use self::within_bounds::within_bounds;

use super::engine::fitting::fitted::{Fitted, tie_with_curve};
use super::engine::fitting::initial_states::with_free_states;
use super::engine::holdout::{EXPLAINED, Estimator, all_free, as_given, blocks};
use super::engine::hypothesis::{Hypothesis, HypothesisError, HypothesisErrorKind};
use super::engine::scope::Scope;
use super::engine::search::Found;
use super::engine::select::{CHANCE, agreement, select};
use super::engine::shared_terms::with_shared_terms;
use super::engine::terms::term::{Needs, Port, Shape};
use super::engine::thresholds::{LEFT, SURE, THOROUGH, chance};
use super::explanation::{
    AugmentedPlant, EXPLANATION_FORMAT, EffectFound, EffectSize, Explanation, FitTable, JointTest,
    OutputFit, ParameterChange, Remaining, Verdict,
};
use crate::explain::engine::fitting::edit::driven_state;
use crate::identify::Recording;
use crate::log::{Channel, Log};
use crate::physics::estimate::{
    EstimateError, EstimateOptions, PlantRecording, Study, VALUES_A_NUMBER,
};
use crate::physics::{Hold, ModelSpec, Plant, Span, units_in_words};

/// A parameter is said to differ from the text where it does by so many standard deviations.
const DIFFERENT: f64 = 3.3;
/// Level at which the parameters of an effect differ from 0.
const SIGNIFICANT: f64 = 0.05;

/// Says what a plant in equations leaves out of recordings.
///
/// # Errors
/// Ids of effects that do not exist, and those of an estimation of its parameters.
pub fn explain_plant(
    plant: &Plant,
    logs: &[Log],
    known: Vec<Recording>,
    options: &PlantOptions,
) -> Result<Explanation, PlantQuestionError> {
    explain_equations(plant, logs, known, options, Origin::Text)
}

/// The same of equations from anywhere.
pub(crate) fn explain_equations(
    plant: &Plant,
    logs: &[Log],
    known: Vec<Recording>,
    options: &PlantOptions,
    origin: Origin,
) -> Result<Explanation, PlantQuestionError> {
    let scope = Scope {
        hypotheses: distinct(&options.hypotheses)?,
        ..Scope::new(&options.only, &options.without)?
    };
    let hold = options.hold;
    let shared = with_shared_terms(&plant.spec).map(Plant::new);
    let plant = shared.as_ref().unwrap_or(plant);
    let recordings: Vec<PlantRecording> = logs.iter().map(PlantRecording::from).collect();
    let mut found = select(plant, &recordings, hold, &scope)?;
    let base_options = EstimateOptions {
        free: vec![true; plant.spec.parameters().len()],
        ..found.options.clone()
    };
    let whole =
        Study::new(&found.plant, &recordings, &found.options)?.with_information(found.information);
    let base = Study::new(plant, &recordings, &base_options)?;
    let mut covariance = whole.covariance(&found.fit);
    let mut steps = found.steps.iter().take(found.accepted);
    if steps.any(|s| s.first().is_some_and(|f| f.lead.curve.is_some())) {
        let text = &base.nominal()[..base.parameters()];
        let before = base.covariance(&found.baseline);
        let slack = tie_with_curve(found.baseline.deviance - found.fit.deviance);
        if let Some(nearest) = nearest_to_text(&whole, &found.fit, text, &before, slack) {
            (found.fit, covariance) = nearest;
        }
    }
    let answer = Answer {
        plant,
        recordings: &recordings,
        base,
        within_bounds: within_bounds(&plant.spec, covariance.clone()),
        covariance,
        whole,
        hold,
        origin,
        found: &found,
        hypotheses: &scope.hypotheses,
        units: units_in_words(&found.plant.spec),
        inputs: logs.first().map_or_else(Vec::new, |log| log.inputs.clone()),
        channels: logs
            .first()
            .map_or_else(Vec::new, |log| log.outputs.clone()),
    };
    Ok(answer.explanation(known))
}

struct Answer<'a> {
    plant: &'a Plant,
    recordings: &'a [PlantRecording],
    base: Study<'a>,
    whole: Study<'a>,
    hold: Hold,
    origin: Origin,
    found: &'a Found,
    hypotheses: &'a [Hypothesis],
    inputs: Vec<Channel>,
    channels: Vec<Channel>,
    /// Of every variable of the plant with its effects.
    units: Vec<Option<String>>,
    /// Covariance of the free numbers of the final fit.
    covariance: DMatrix<f64>,
    /// The same with what the bounds of the text say of its parameters.
    within_bounds: DMatrix<f64>,
}

/// Hypotheses are told apart by their names.
fn distinct(all: &[Hypothesis]) -> Result<Vec<Hypothesis>, HypothesisError> {
    for (i, hypothesis) in all.iter().enumerate() {
        let name = hypothesis.name();
        if all[..i].iter().any(|h| h.name() == name) {
            let span = Span {
                start: 0,
                end: name.len(),
            };
            let kind = HypothesisErrorKind::SameName(name.to_owned());
            return Err(HypothesisError::new(hypothesis.text(), span, kind));
        }
    }
    Ok(all.to_vec())
}

impl Answer<'_> {
    fn effects(&self) -> impl Iterator<Item = &Fitted> {
        let steps = self.found.steps.iter().take(self.found.accepted);
        steps.filter_map(|s| s.first())
    }

    /// Whether an effect is a function of an input that reacts to disturbances.
    fn depends_on_feedback(&self) -> bool {
        let spec = &self.plant.spec;
        let name = |i: &usize| Some(spec.variable(*spec.inputs().get(*i)?).column());
        let reacting: Vec<&str> = self.found.reacting.iter().filter_map(name).collect();
        let depends = |f: &Fitted| f.depends.iter().any(|d| reacting.contains(&d.as_str()));
        self.effects().any(depends)
    }

    fn spec_before(&self, step: usize) -> &ModelSpec {
        match step.checked_sub(1) {
            None => &self.plant.spec,
            Some(before) => &self.found.steps[before][0].candidate.plant.spec,
        }
    }

    fn explanation(&self, recordings: Vec<Recording>) -> Explanation {
        let best = self.found.steps.first().and_then(|s| s.first());
        // Of two effects each is needed beside the other, or it would have been dropped: what both gain proves them.
        let gain = self.found.gain();
        let parameters = self.parameters();
        let (statistic, tests) = self.found.left();
        let p_value = (tests as f64 * chance(statistic)).min(1.0);
        let adequate = p_value >= CHANCE;
        // Of a plant that follows worse than the mean most terms take half the error: what is found must follow. A plant that
        // does not run freely has no blocks that say so, and they prove no function of an input that reacts to disturbances.
        let feedback = self.depends_on_feedback();
        let (follows, explains, better) = match &self.found.held_out {
            None => (true, false, true),
            Some([without, with]) => {
                let closely = with.follows_closely();
                let removes = with.removed(without) >= EXPLAINED;
                let better = removes || with.surely_smaller(without);
                match feedback {
                    true => (true, false, better),
                    false => (without.follows() || closely, removes && closely, better),
                }
            }
        };
        let effects: Vec<EffectFound> = self
            .effects()
            .enumerate()
            .filter_map(|(i, fitted)| self.effect(i, fitted))
            .collect();
        let in_time = |f: &Fitted| f.lead.term.needs == Needs::Time && f.lead.term.id != "periodic";
        // A change at an instant that leaves structure may stand for several, unless it leaves next to nothing of the free run.
        let close = (self.found.held_out.as_ref()).is_none_or(|[_, with]| with.is_close());
        let single = p_value >= LEFT || close || !self.effects().any(in_time);
        // A name must take half of the mean square off blocks left out, or more off them than chance does. Where much structure is left,
        // it is given only to what does the first, and leaves little: a curve may follow what enters elsewhere; a term with a name of
        // its own claims more.
        let curves = effects.iter().any(|e| e.effect == "law");
        // Blocks alone prove a name only where no test finds structure beside it.
        let proved = p_value >= LEFT && best.is_some_and(|b| b.proved);
        let sure = (gain >= SURE || proved)
            && follows
            && self.effects().all(|fitted| self.is_significant(fitted))
            && self.effects().all(|fitted| self.doubt(fitted).is_none())
            && better
            && single
            && (adequate || explains && !curves);
        let runs = self.free_runs();
        let l = self.base.outputs();
        let steps = |o: usize| self.steps(&runs, o, p_value);
        let shows = (0..l)
            .max_by(|&a, &b| {
                let gain = |o: usize| {
                    let s = steps(o);
                    s.augmented.fit_percent - s.parameters_only.fit_percent
                };
                gain(a).total_cmp(&gain(b))
            })
            .unwrap_or(0);
        let outputs: Vec<String> = self.outputs().iter().map(|(n, _)| n.clone()).collect();
        let train = steps(shows);
        let removed = 1.0
            - (train.augmented.rmse / train.parameters_only.rmse.max(f64::MIN_POSITIVE)).powi(2);
        let left = 1.0 - 0.01 * train.parameters_only.fit_percent;
        let held_out = self.held_out(shows, &train);
        let heldout_gain = held_out
            .as_ref()
            .map_or(0.0, |h| h.parameters_only.rmse - h.augmented.rmse);
        let mut each: Vec<OutputFit> = (0..l)
            .map(|o| {
                let train = steps(o);
                OutputFit {
                    output: outputs[o].clone(),
                    heldout: self.held_out(o, &train),
                    train,
                }
            })
            .collect();
        let percent = |o: &OutputFit| o.train.augmented.fit_percent;
        each.sort_by(|a, b| percent(a).total_cmp(&percent(b)));
        let strays = self.strays(&each);
        let asked = effects.is_empty() && !self.found.misled;
        let baseline = (&self.base, &self.found.baseline);
        let astray = asked
            .then(|| {
                let as_in_text = parameters.is_empty();
                astray(
                    &each,
                    strays,
                    self.plant,
                    baseline,
                    self.recordings,
                    as_in_text,
                )
            })
            .flatten();
        let (differs, together) = match effects.is_empty() && parameters.is_empty() {
            true => self.differs(),
            false => (Differs::Parameters, None),
        };
        let alternatives = self.alternatives();
        // What the criterion is sure of, and blocks left out refuse, may be beyond what they span.
        let refused = (alternatives.iter())
            .filter(|a| effects.is_empty() && a.criterion_gain >= SURE)
            .max_by(|a, b| a.criterion_gain.total_cmp(&b.criterion_gain));
        let verdict = if self.found.accepted > 0 && sure {
            Verdict::Named
        } else if self.found.accepted > 0
            || p_value < CHANCE
            || astray.is_some()
            || refused.is_some()
        {
            Verdict::Unexplained
        } else if matches!(differs, Differs::Parameters | Differs::Together(_)) {
            Verdict::Parameters
        } else {
            Verdict::Consistent
        };
        let probability = probability(verdict, effects.len(), p_value, self.found.values);
        let mut summary = self.summary(&Told {
            verdict,
            probability,
            effects: &effects,
            parameters: &parameters,
            differs,
            alternatives: &alternatives,
            outputs: &each,
            p_value,
            strays,
            astray,
            refused,
            too_short: self.too_short(1),
        });
        // What is not sure predicts a fresh recording only where it makes blocks left out better, as a name must. Blocks between others
        // say nothing of what a load or a parameter does later.
        let later = self.effects().any(in_time);
        let doubted = self.effects().any(|fitted| self.doubt(fitted).is_some());
        let safe = self.effects().enumerate().all(|(i, fitted)| {
            let state = driven_state(self.spec_before(i), fitted.lead.place);
            self.law(fitted).is_none_or(|law| is_safe(&law, state))
        });
        let relied_on = verdict != Verdict::Unexplained
            || effects.is_empty()
            || better && !later && !doubted && safe;
        if !relied_on {
            summary.push(
                "It is not sure enough to predict with: `simulate` uses the equations without it."
                    .to_owned(),
            );
        }
        if !runs.given_runs {
            summary.push(
                "The equations cannot be simulated over the recording with the values of the text; the mean of the recording stands for them."
                    .to_owned(),
            );
        }
        let first = effects.first();
        let equals = first.and_then(|e| as_good(e, &alternatives));
        let unsure = verdict == Verdict::Unexplained || equals.is_some();
        summary.extend(equals);
        let separating_experiment =
            (first.filter(|_| unsure)).and_then(|e| experiment(e, &alternatives));
        if let Some(experiment) = &separating_experiment {
            summary.push(format!("To settle it: {experiment}."));
        }
        Explanation {
            format: EXPLANATION_FORMAT.to_owned(),
            verdict,
            probability,
            summary,
            alternatives,
            hypotheses: self.hypotheses(&runs.recorded, &runs.only, shows),
            location: self.location(verdict, &runs.recorded, &runs.only, shows),
            fit: FitTable {
                output: outputs[shows].clone(),
                train: train.clone(),
                heldout: held_out,
                heldout_blocks: match self.found.held_out {
                    Some(_) => blocks(self.recordings),
                    None => vec![],
                },
                outputs: if l > 1 { each } else { vec![] },
            },
            parameters,
            parameters_together: together,
            remaining: Remaining {
                adequate: p_value >= LEFT,
                p_value,
                share: statistic / self.found.values.max(1) as f64,
                share_of_removed: None,
                features: tests,
                sentence: if p_value >= LEFT {
                    format!("None of {tests} score tests finds structure in the residuals.")
                } else {
                    format!(
                        "The strongest of {tests} score tests still takes {:.1} % off the residuals.",
                        100.0 * statistic / self.found.values.max(1) as f64
                    )
                },
            },
            separating_experiment,
            effect_size: EffectSize {
                linear_share: (1.0 - left * left).clamp(0.0, 1.0),
                removed_share: removed.clamp(0.0, 1.0),
                heldout_gain,
            },
            detectable: vec![],
            noise: self.noise(),
            curve: None,
            model: None,
            plant: Some(AugmentedPlant {
                modelica: self.text(relied_on),
                inputs: self.inputs.clone(),
                outputs: self.channels.clone(),
                simulation: None,
                simulated_inputs: vec![],
                times_of_change: match relied_on {
                    true => self.times_of_change(),
                    false => vec![],
                },
                hold: if self.hold == Hold::Zero {
                    "zero"
                } else {
                    "linear"
                }
                .to_owned(),
            }),
            signals: self.signals(&runs),
            effects,
            recordings,
            version: env!("CARGO_PKG_VERSION").to_owned(),
        }
    }

    /// Whether the recording tells the parameters of an effect from 0, all together: a strength and the level it acts from may be
    /// known together only. An instant and a place on the axis of a variable are not told from 0. So is an effect without other
    /// parameters, and one whose covariance is not known.
    fn is_significant(&self, fitted: &Fitted) -> bool {
        let shapes = fitted.lead.term.shapes;
        // Where a share of something is coupled to the rest, it is that share which is told from 0, not the time that the coupling takes.
        let share = shapes.iter().any(Shape::is_share);
        let place = |i: usize| {
            let shape = shapes.get(i);
            shape.is_some_and(|s| s.is_place() || share && s.is_duration())
        };
        let parameters = self.parameters_of(fitted).enumerate();
        let places: Vec<usize> = parameters
            .filter(|(i, _)| !place(*i))
            .map(|(_, (_, at))| at)
            .collect();
        let values: Vec<f64> = places.iter().map(|&p| self.found.fit.point[p]).collect();
        let covariance = self
            .within_bounds
            .select_rows(&places)
            .select_columns(&places);
        let test = joint_test(&values, &covariance);
        fitted.hypothesis.is_some()
            || test.is_none_or(|t| t.p_value < SIGNIFICANT)
            || self.is_needed(fitted)
    }

    /// The same by the likelihood ratio of its strength: a stop that is at least so stiff has a large deviation, and is not 0.
    fn is_needed(&self, fitted: &Fitted) -> bool {
        let mut parameters = self.parameters_of(fitted);
        let strength = parameters.nth(fitted.lead.term.shapes.len());
        let Some((_, at)) = strength.filter(|_| fitted.lead.term.free_strength) else {
            return false;
        };
        let mut without = self.found.fit.clone();
        without.point[at] = 0.0;
        let held = self.whole.holding(&without, &[at], THOROUGH);
        held.is_some_and(|held| {
            let rises = held.deviance - self.found.fit.deviance;
            chance(self.whole.information() * rises) < SIGNIFICANT
        })
    }

    /// What else an effect may be.
    fn doubt(&self, fitted: &Fitted) -> Option<Doubt> {
        if fitted.hypothesis.is_some() {
            return None;
        }
        let shapes = fitted.lead.term.shapes.iter();
        let mut with_places = shapes.zip(self.parameters_of(fitted));
        let at = with_places.find(|(shape, _)| shape.is_instant());
        let instant = at.map(|(_, (_, at))| {
            let variance = self.within_bounds[(at, at)];
            (self.found.fit.point[at], variance.max(0.0).sqrt())
        });
        doubt(fitted, instant, &self.plant.spec, self.recordings)
    }

    /// The plant as it ran over the first recording, with what was found where that may be relied on. A fresh recording starts elsewhere:
    /// no start is certain.
    fn text(&self, relied_on: bool) -> String {
        if !relied_on {
            return (self.plant).text_at(&self.base.points(&self.found.baseline)[0]);
        }
        let point = &self.whole.points(&self.found.fit)[0];
        let free = with_free_states(&self.found.plant);
        free.as_ref().unwrap_or(&self.found.plant).text_at(point)
    }

    fn outputs(&self) -> Vec<(String, String)> {
        let spec = &self.plant.spec;
        let of = |v| {
            let v = spec.variable(v);
            (
                v.column().to_owned(),
                v.unit_text.clone().unwrap_or_default(),
            )
        };
        spec.outputs().into_iter().map(of).collect()
    }

    fn port(&self) -> Option<String> {
        let first = self.effects().next()?;
        Some(
            match first.lead.term.port {
                Port::Input => "input",
                Port::Sensor => "output",
                Port::Equation | Port::Parameter => "inside",
            }
            .to_owned(),
        )
    }

    fn times_of_change(&self) -> Vec<String> {
        let of = |fitted: &Fitted| -> Vec<String> {
            let shapes = fitted.lead.term.shapes.iter().zip(&fitted.candidate.names);
            shapes
                .filter(|(s, _)| s.is_instant())
                .map(|(_, name)| name.clone())
                .collect()
        };
        self.effects().flat_map(of).collect()
    }

    /// Parameters of the text that the recording contradicts, or all of a structure, estimated beside what was found.
    fn parameters(&self) -> Vec<ParameterChange> {
        let covariance = &self.covariance;
        let nominal = self.plant.nominal().parameters;
        let spec = &self.plant.spec;
        let each = spec.parameters().into_iter().enumerate();
        each.filter_map(|(i, v)| {
            let (value, std) = (self.found.fit.point[i], covariance[(i, i)].max(0.0).sqrt());
            let differs = std.is_finite() && (value - nominal[i]).abs() > DIFFERENT * std;
            let variable = spec.variable(v);
            (differs || self.origin == Origin::Structure).then(|| ParameterChange {
                name: variable.column().to_owned(),
                simulation: nominal[i],
                recording: value,
                std: std.is_finite().then_some(std),
                unit: variable.unit_text.clone().unwrap_or_default(),
            })
        })
        .collect()
    }

    /// How the estimates differ from the text as a whole where no parameter does alone, and the test of the parameters.
    fn differs(&self) -> (Differs, Option<JointTest>) {
        let shift: Vec<f64> = self
            .whole
            .nominal()
            .iter()
            .zip(&self.found.fit.point)
            .map(|(text, estimate)| estimate - text)
            .collect();
        let parameters = self.plant.spec.parameters().len().min(shift.len());
        let together = joint_test(&shift[..parameters], &self.covariance);
        let starts = || joint_test(&shift, &self.covariance).is_some_and(|t| t.rejects());
        let differs = match together {
            Some(test) if test.rejects() => Differs::Together(test),
            // Where estimates stop at bounds, the covariance says nothing of them.
            _ if self.refutes_text() => Differs::Parameters,
            _ if starts() => Differs::Starts,
            _ => Differs::No,
        };
        (differs, together)
    }

    /// Why a term with so many parameters cannot be fitted, where the recordings have too few values.
    fn too_short(&self, more: usize) -> Option<EstimateError> {
        let (free, samples) = (self.base.nominal().len() + more, self.base.count());
        (samples <= VALUES_A_NUMBER * free).then_some(EstimateError::TooShort { free, samples })
    }

    /// Whether the recording refutes the values of the text, with initial states of their own, in free run.
    fn refutes_text(&self) -> bool {
        let p_value = || {
            let given = as_given(self.plant, self.recordings, self.hold)?;
            let options = all_free(self.plant, self.hold, Estimator::FreeRun);
            let study = Study::new(self.plant, self.recordings, &options).ok()?;
            let fit = study.least_squares(&given.point)?;
            agreement(&study, &fit, &given.point)
        };
        p_value().is_some_and(|p| p < LEVEL)
    }
}
