//! Other plants than the simulation that was given, as equations that ship with the program.
//!
//! A linear model says nothing of what moves in a plant, and some plants are like no linear one: a mass that nothing holds drifts
//! away in free run, a tank empties through an orifice. Where a linear simulation leaves structure, the structure that follows the
//! recordings best is explained in its place, by the engine of plants in equations.
//!
//! A structure is a text with the marks of [`text`], and a line in [`STRUCTURES`].

mod start;
#[cfg(test)]
mod tests;
mod text;

use std::collections::BTreeMap;

use self::start::{Started, started};
use self::text::Marks;
use super::columns::logs_with_recordings;
use super::compare_explanations::{criterion_gain, follows};
use super::engine::terms::documentation::plant_effect;
use super::engine::thresholds::NEEDED;
use super::explanation::{EffectFound, Evidence, Explanation, ParameterChange, Quantity, Verdict};
use super::linear::check::Checked;
use super::linear::model::linear_plant::Plant as LinearPlant;
use super::plant_answer::{
    Origin, PlantOptions, explain_equations, says_that_nothing_is_missing, spoken,
};
use super::simulation::Simulation;
use crate::physics::Hold;
use crate::physics::estimate::PlantRecording;

/// A parameter that is so many standard deviations from 0 is determined.
const DETERMINED: f64 = 3.0;

/// A plant in equations with one input and one output.
struct Structure {
    equations: &'static str,
    /// The effect that a linear model of the plant leaves out; none where the equations are linear.
    lacks: Option<Lacks>,
}

impl Structure {
    fn states(&self) -> usize {
        self.equations.matches("der(").count()
    }
}

/// What equations have that no linear model has.
struct Lacks {
    effect: &'static str,
    /// As the document writes it, with the marks of [`text`].
    equation: &'static str,
    /// The parameters of the equations that belong to it.
    parameters: &'static [&'static str],
    /// Suffix of the states that it depends on, and whose equations it enters.
    states: &'static [&'static str],
}

const STRUCTURES: [Structure; 4] = [
    Structure {
        equations: include_str!("drive.mo"),
        lacks: None,
    },
    Structure {
        equations: include_str!("speed.mo"),
        lacks: None,
    },
    // A level is not negative.
    Structure {
        equations: include_str!("tanks.mo"),
        lacks: Some(Lacks {
            effect: "tank_outflow",
            equation: "der({output:_lower}) = upper_outflow*sqrt({output:_upper}) - lower_outflow*sqrt({output:_lower})",
            parameters: &["upper_outflow", "lower_outflow"],
            states: &["_upper", "_lower"],
        }),
    },
    Structure {
        equations: include_str!("tank.mo"),
        lacks: Some(Lacks {
            effect: "tank_outflow",
            equation: "der({output:_level}) = pump_gain*{input} + pump_offset - outflow*sqrt({output:_level})",
            parameters: &["outflow"],
            states: &["_level"],
        }),
    },
];

/// A structure is explained where the error of its free run is at most so many times that of the linear simulation with other
/// parameters: an effect beside it makes up for less.
const MOST_ERROR: f64 = 2.0;
/// ... and at most this part of the output's standard deviation: it explains three quarters of the variance.
const HOPELESS: f64 = 0.5;
/// Values below 0 that noise makes of a level, as a part of the largest.
const BELOW_ZERO: f64 = 0.1;

/// The explanation by a structure, that which follows the recordings closest of those that name an effect, else of all; none where no
/// structure follows them nearly as well as the linear explanation, where there is one.
pub(crate) fn explain_structure(
    checked: &Checked,
    without: &[String],
    linear: Option<(&Explanation, &LinearPlant)>,
) -> Option<Explanation> {
    let marks = Marks::of(&checked.recordings)?;
    let recordings: Vec<PlantRecording> = checked.recordings.iter().map(Into::into).collect();
    let level = is_level(&recordings);
    let most = linear.map_or(f64::INFINITY, |(l, _)| {
        MOST_ERROR * l.fit.train.parameters_only.rmse
    });
    let most = most.min(HOPELESS * marks.output_std());
    // Of a plant that is followed, only a curve may be another plant's. A linear structure of a higher order would take up what the
    // simulation lacks without a name, and a plant that oscillates is no tank; of two tanks a pair of poles may be identified that
    // turns, but has no peak.
    let followed = linear.is_some_and(|(answer, _)| follows(answer));
    let order = linear.map_or(usize::MAX, |(_, plant)| plant.states);
    let oscillates = linear.is_some_and(|(_, plant)| match checked.simulation {
        Simulation::Model(..) => plant.resonates(),
        Simulation::Outputs(_) => plant.oscillates(),
    });
    let offered = |s: &&Structure| match &s.lacks {
        Some(lacks) => level && !oscillates && !without.iter().any(|id| id == lacks.effect),
        None => !followed && s.states() <= order,
    };
    let started = STRUCTURES.iter().filter(offered).filter_map(|s| {
        let started = started(s.equations, &marks, &recordings, Hold::Zero)?;
        Some((s, started))
    });
    let (linear_ones, others): (Vec<_>, Vec<_>) = started
        .filter(|(_, started)| started.error <= most)
        .partition(|(s, _)| s.lacks.is_none());
    let likeliest = |of: Vec<(&'static Structure, Started)>| {
        of.into_iter()
            .min_by(|a, b| a.1.criterion.total_cmp(&b.1.criterion))
    };
    let both = [likeliest(linear_ones), likeliest(others)];
    let linear_error = linear.map_or(marks.output_std(), |(l, _)| l.fit.train.augmented.rmse);
    let explained = both.into_iter().flatten().filter_map(|(s, started)| {
        let mut explanation = explain(&started, checked, without)?;
        if let Some(lacks) = &s.lacks {
            if !lacks.are_determined(&explanation.parameters) {
                return None;
            }
            lacks.add_to(&mut explanation, &marks, linear_error);
        }
        Some(explanation)
    });
    let named = |e: &Explanation| matches!(e.verdict, Verdict::Named | Verdict::Family);
    let error = |e: &Explanation| e.fit.train.augmented.rmse;
    let mut best = explained.min_by(|a, b| {
        let order = named(b).cmp(&named(a));
        order.then(error(a).total_cmp(&error(b)))
    })?;
    let given = linear.map_or_else(
        || "the simulation, which is unstable".to_owned(),
        |(l, _)| {
            format!(
                "the linear simulation, with which {:.1} % is reached with other parameters",
                l.fit.train.parameters_only.fit_percent
            )
        },
    );
    if let Some(line) = best.summary.last_mut() {
        *line = format!("{line} All of this is about these equations in place of {given}.");
    }
    Some(best)
}

fn explain(started: &Started, checked: &Checked, without: &[String]) -> Option<Explanation> {
    let known = without.iter().filter(|id| plant_effect(id).is_some());
    let options = PlantOptions {
        hold: Hold::Zero,
        without: known.cloned().collect(),
        ..PlantOptions::default()
    };
    let (logs, recordings) = logs_with_recordings(checked.recordings.iter().cloned());
    let (plant, origin) = (&started.plant, Origin::Structure);
    let mut explanation = explain_equations(plant, &logs, recordings, &options, origin).ok()?;
    // The signals of a recording are its channels, not states that nobody has named.
    let log = logs.first()?;
    for effect in &mut explanation.effects {
        let channels = match effect.port.as_str() {
            "input" => &log.inputs,
            _ => &log.outputs,
        };
        effect.signal = channels.first()?.name.clone();
    }
    Some(explanation)
}

impl Lacks {
    /// Whether the recording determines its parameters: others would do as well, and with them another plant.
    fn are_determined(&self, parameters: &[ParameterChange]) -> bool {
        let mut own = parameters
            .iter()
            .filter(|p| self.parameters.contains(&p.name.as_str()));
        own.all(|p| {
            p.std
                .is_some_and(|std| p.recording.abs() > DETERMINED * std)
        })
    }

    /// What the equations have from the start is an effect beside a linear model, unless they leave something unexplained.
    fn add_to(&self, explanation: &mut Explanation, marks: &Marks, linear_error: f64) {
        if explanation.verdict == Verdict::Unexplained {
            return;
        }
        if !matches!(explanation.verdict, Verdict::Named | Verdict::Family) {
            // That nothing else is missing is said of these equations, not of the simulation.
            explanation.verdict = Verdict::Named;
            explanation
                .summary
                .retain(|line| !says_that_nothing_is_missing(line));
        }
        let of_it = |p: &&ParameterChange| self.parameters.contains(&p.name.as_str());
        let quantity = |p: &ParameterChange| Quantity {
            value: p.recording,
            std: p.std,
            unit: p.unit.clone(),
        };
        let parameters: BTreeMap<String, Quantity> = explanation
            .parameters
            .iter()
            .filter(of_it)
            .map(|p| (p.name.clone(), quantity(p)))
            .collect();
        let equation = marks.fill(self.equation, f64::NAN);
        let error = explanation.fit.train.augmented.rmse.max(f64::MIN_POSITIVE);
        let states: Vec<String> = self.states.iter().map(|s| marks.state(s)).collect();
        let lower = states.last().cloned().unwrap_or_default();
        let sentence = format!(
            "{} as a function of {}: {equation}",
            spoken(self.effect),
            states.join(" and ")
        );
        explanation.summary.insert(0, format!("{sentence}."));
        let effect = EffectFound {
            effect: self.effect.to_owned(),
            hypothesis: false,
            variant: String::new(),
            signal: marks.output_name(),
            port: "process".to_owned(),
            equation,
            enters: Some(lower),
            depends: states,
            law: None,
            evidence: Evidence {
                criterion_gain: criterion_gain(explanation, linear_error / error, parameters.len()),
                criterion_needed: NEEDED,
                heldout_gain: None,
                halves_disagree: None,
            },
            parameters,
            sentence,
        };
        explanation.effects.insert(0, effect);
    }
}

/// Whether the output is one that is not negative.
fn is_level(recordings: &[PlantRecording]) -> bool {
    let values = || recordings.iter().flat_map(|r| &r.outputs).flatten();
    let largest = values().copied().fold(0.0, f64::max);
    let below = |y: &f64| *y < -BELOW_ZERO * largest;
    largest > 0.0 && !values().any(below)
}
