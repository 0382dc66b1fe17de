//! The question about a linear model or columns: the ways of answering it, and the choice between their answers.

use super::columns;
use super::compare_explanations::{
    agree, doubt, is_doubtful, is_sure, leaves_room, replaces, runs_close, stands_in, supersedes,
    unless_refuted,
};
use super::document::explain_error::ExplainError;
use super::effects::{self, Definition};
use super::engine::terms::documentation::plant_effect;
use super::explanation::{Explanation, Verdict};
use super::linear::answer::linear_answer::Answer;
use super::linear::answer::probability::is_unlikely;
use super::linear::check::Checked;
use super::linear::data::Data;
use super::linear::decision::averaged_decision::attempt;
use super::linear::decision::output_error_decision::{Finding, inquire};
use super::linear::fit::Fit;
use super::linear::known::Known;
use super::linear::known_simulation::{Simulator, check, know};
use super::linear::model::linear_plant::Plant;
use super::linear::nonlinear_simulator::NonlinearSimulator;
use super::linear::screening::output_adequacy::LEVEL;
use super::memory;
use super::simulation::Simulation;
use super::structures::explain_structure;
use crate::log::Log;
use crate::noise::{Mask, effective_samples};

/// What can be asked for.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// Effects that are taken out of the library: what would be said if nobody had thought of them?
    pub without: Vec<String>,
    /// Seed of the bootstrap.
    pub seed: u64,
}

/// A free-run fit of a drive whose errors add up must run through the half of the recording that it was not fitted to with an error
/// this many times that of the averaged equation to stand in its place: it follows its own half better always, and knows no mass.
const MUCH_BETTER: f64 = 0.5;

/// Share of a free run's errors that are independent from which on they are no drift.
const INDEPENDENT: f64 = 0.5;

/// What the averaged equation of a drive leaves is mostly noise below this share of structure.
const MOSTLY_NOISE: f64 = 0.5;

/// Compares `recordings` with `simulation` and says what the simulation leaves out.
///
/// # Errors
/// [`ExplainError`]: recordings and simulation do not fit together, are too short, or the simulation is unstable.
pub fn explain(
    recordings: &[Log],
    simulation: &Simulation,
    options: &Options,
) -> Result<Explanation, ExplainError> {
    for id in &options.without {
        if effects::library().all(|d| d.id != id) && plant_effect(id).is_none() {
            return Err(ExplainError::UnknownEffect { id: id.clone() });
        }
    }
    memory::check(recordings)?;
    let free = recordings.first().is_some_and(|r| r.inputs.is_empty());
    if free && matches!(simulation, Simulation::Outputs(_)) {
        return explain_free(recordings, simulation, options);
    }
    let allowed_id = |id: &str| !options.without.iter().any(|without| without == id);
    // A law of one unit is not tried on what no output is measured in.
    let outputs = &recordings.first().ok_or(ExplainError::NoRecording)?.outputs;
    let measured = |unit: &str| {
        outputs
            .iter()
            .any(|o| super::document::channel_units::is_in(o, unit))
    };
    let allowed = |d: &Definition| allowed_id(d.id) && d.unit_of_output().is_none_or(measured);
    // The data before the physics: from here on they are as repaired.
    let checked = Checked::new(recordings, simulation, &allowed_id);
    let simulator = match know(&checked) {
        Err(unstable @ ExplainError::Unstable { .. }) => {
            let structure = explain_structure(&checked, &options.without, None);
            return structure.filter(runs_close).ok_or(unstable);
        }
        simulator => simulator?,
    };
    match simulator {
        Simulator::Linear(known) => {
            let mut answer = explain_linear(*known, &checked, &allowed, options.seed)?;
            answer.explanation = unless_refuted(answer.explanation);
            Ok(second_opinion(answer, &checked, options))
        }
        Simulator::Nonlinear(simulator) => {
            let explanation = explain_nonlinear(&simulator, &checked, &allowed, options)?;
            Ok(unless_refuted(explanation))
        }
    }
}

/// Which effects may be named.
type Allowed<'a> = dyn Fn(&Definition) -> bool + Sync + 'a;

fn no_fit(checked: &Checked) -> ExplainError {
    let name = checked.recordings.first().map(|r| r.name.clone());
    ExplainError::NoFit {
        name: name.unwrap_or_default(),
    }
}

/// An answer relative to a linear plant.
struct LinearAnswer {
    explanation: Explanation,
    /// The plant of the simulation.
    given: Plant,
    /// Whether noise may stand for physics in it.
    absorbed: bool,
}

fn explain_linear(
    known: Known,
    checked: &Checked,
    allowed: &Allowed,
    seed: u64,
) -> Result<LinearAnswer, ExplainError> {
    let drive = attempt(&checked.recordings, &known, allowed);
    // What a law in the averaged equation of a drive explains to noise needs no other way, and the rest little. Where no law
    // was found, the equation may be blind to what there is (effects of the sensor, another mode), and where a spring
    // brings the mass back or a speed is measured, a free run tells as well.
    let settled = drive.as_ref().is_some_and(|(_, finding, _)| {
        finding.augmented.is_some()
            && finding.weak.as_ref().is_some_and(|proof| proof.drifts())
            && finding
                .adequacy
                .is_none_or(|a| a.p_value > LEVEL || a.share < MOSTLY_NOISE)
    });
    let ordinary = (!settled)
        .then(|| inquire(&known, checked.mask(&known.data), allowed))
        .flatten();
    let (known, finding, mask) = match (drive, ordinary) {
        (Some((drive, averaged, counted)), Some((finding, mask)))
            if tells_more(
                (&finding, &known.data, &mask),
                (&averaged, &drive.data, &counted),
            ) =>
        {
            (known, finding, mask)
        }
        (Some(drive), _) => drive,
        (None, Some((finding, mask))) => (known, finding, mask),
        (None, None) => return Err(no_fit(checked)),
    };
    let absorbed = adds_up(&known, &finding, &mask);
    Ok(LinearAnswer {
        explanation: said(&known, checked, (finding, mask), seed),
        given: known.structure.coordinates.given.clone(),
        absorbed,
    })
}

/// Whether noise may stand for physics: a plant that integrates adds up what acts on it, and a noise model with a slow root takes that up.
fn adds_up(known: &Known, finding: &Finding, mask: &Mask) -> bool {
    let Fit {
        noise, residual, ..
    } = &finding.model;
    (known.structure.coordinates.given).integrates(known.data.samples())
        && noise.absorbs(residual, mask)
}

/// An answer that is not sure is compared with that of the equations that reproduce the simulated outputs, and one that leaves
/// structure with that of another plant.
fn second_opinion(answer: LinearAnswer, checked: &Checked, options: &Options) -> Explanation {
    let LinearAnswer {
        explanation,
        given,
        absorbed,
    } = answer;
    let mut outputs = checked.recordings.iter().flat_map(|r| &r.outputs);
    let has_units = outputs.all(|o| o.unit.is_some());
    if !checked.troubles.is_empty() {
        return explanation;
    }
    let by_equations = || {
        let equations = columns::equations(checked)?;
        if equations.misfit > columns::REPRODUCED {
            return None;
        }
        columns::explain_equations(&equations, checked, &options.without)
    };
    let nothing = matches!(
        explanation.verdict,
        Verdict::Consistent | Verdict::Parameters
    );
    let unsure = absorbed && nothing || !is_sure(&explanation, has_units);
    let other = unsure.then(by_equations).flatten();
    let explanation = match other.filter(|other| replaces(other, &explanation)) {
        Some(other) => other,
        None => explanation,
    };
    if !leaves_room(&explanation) {
        return explanation;
    }
    let other = explain_structure(checked, &options.without, Some((&explanation, &given)));
    let other = other.filter(|other| supersedes(other, &explanation));
    other.unwrap_or(explanation)
}

/// A free decay: no linear model has states that its inputs do not reach, so that equations are the only way.
fn explain_free(
    recordings: &[Log],
    simulation: &Simulation,
    options: &Options,
) -> Result<Explanation, ExplainError> {
    check(recordings, simulation)?;
    let checked = Checked {
        recordings: recordings.to_vec(),
        simulation: simulation.clone(),
        troubles: Vec::new(),
        interpolated: false,
    };
    let sensors = || columns::explain_sensors(&checked, &options.without);
    let by_equations = || {
        let equations = columns::equations(&checked)?;
        let mut explanation = columns::explain_equations(&equations, &checked, &options.without)?;
        if equations.misfit > columns::REPRODUCED {
            columns::doubt_rough(&mut explanation, &equations, &checked);
        }
        Some(unless_closer(explanation, sensors()))
    };
    let found = by_equations().or_else(sensors);
    let name = || match simulation {
        Simulation::Outputs(logs) => logs.first().map(|log| log.name.clone()),
        Simulation::Model(_, name) => Some(name.clone()),
    };
    found.ok_or_else(|| ExplainError::NoEquations {
        name: name().unwrap_or_default(),
    })
}

/// The explanation, or another one whose run follows the recording closer.
fn unless_closer(explanation: Explanation, other: Option<Explanation>) -> Explanation {
    let closer = other.filter(|o| stands_in(o, &explanation));
    closer.unwrap_or(explanation)
}

fn explain_nonlinear(
    simulator: &NonlinearSimulator,
    checked: &Checked,
    allowed: &Allowed,
    options: &Options,
) -> Result<Explanation, ExplainError> {
    // Equations that reproduce columns make the simulator's own parameters and variables known, which the difference to columns
    // does not. Data that were repaired are left to the search that knows how.
    let sound = checked.troubles.is_empty();
    let equations = sound.then(|| columns::equations(checked)).flatten();
    let by_equations =
        || columns::explain_equations(equations.as_ref()?, checked, &options.without);
    let sensors = || {
        sound
            .then(|| columns::explain_sensors(checked, &options.without))
            .flatten()
    };
    if equations
        .as_ref()
        .is_some_and(|e| e.misfit <= columns::REPRODUCED)
        && let Some(explanation) = by_equations()
    {
        // Equations with many numbers may reproduce columns that were made by others. A sensor that explains the recording as
        // closely leaves the simulator as it is.
        return Ok(unless_closer(explanation, sensors()));
    }
    let known = simulator.learn(checked)?;
    let found = inquire(&known, checked.mask(&known.data), allowed);
    let found = found.ok_or_else(|| no_fit(checked))?;
    let mut explanation = said(&known, checked, found, options.seed);
    explanation.summary.push(
        "Neither a linear plant nor equations were found that reproduce the simulated columns closely: this answer is relative to the columns."
            .to_owned(),
    );
    // A doubtful answer relative to the columns stands against effects of the sensors, which need no equations, and against
    // equations that reproduce the columns roughly. The one whose run follows the recording closer is given.
    if !is_doubtful(&explanation) {
        return Ok(explanation);
    }
    if let Some(sensors) = sensors().filter(|s| stands_in(s, &explanation)) {
        return Ok(sensors);
    }
    Ok(match (by_equations(), &equations) {
        (Some(mut other), Some(found)) if stands_in(&other, &explanation) => {
            columns::doubt_rough(&mut other, found, checked);
            other
        }
        (Some(other), _) if agree(&other, &explanation) => explanation,
        _ => {
            doubt(&mut explanation);
            explanation
        }
    })
}

fn said(
    known: &Known,
    checked: &Checked,
    (mut finding, mask): (Finding, Mask),
    seed: u64,
) -> Explanation {
    if is_unlikely(&finding) {
        finding.verdict = Verdict::Unexplained;
    }
    finding.add(checked.troubles.clone());
    Answer {
        recordings: &checked.recordings,
        known,
        finding: &finding,
        mask,
        seed,
    }
    .say()
}

/// Whether a free-run fit tells more of a drive than its averaged equation, which leaves structure.
fn tells_more(
    (free_run, fitted, mask): (&Finding, &Data, &Mask),
    (equation, whole, counted): (&Finding, &Data, &Mask),
) -> bool {
    // Where a free run drifts, a trend stands for whatever it misses.
    let trend = free_run.model.structure.new_effects().iter().any(|e| {
        matches!(
            e.definition.id,
            "sensor_drift" | "sensor_offset" | "load_step" | "periodic_disturbance"
        )
    });
    let drifts = equation.weak.as_ref().is_some_and(|proof| proof.drifts());
    if trend && drifts {
        return false;
    }
    match equation.verdict {
        Verdict::Named => {}
        // Where neither has a name, the free run tells what the recording would have shown; but the structure that a drifting
        // one leaves may be its drift, and the equation knows the mass. What leaves white noise does not drift.
        Verdict::Parameters | Verdict::Consistent => {
            let white = || {
                let values = mask.iter().flatten().filter(|counts| **counts).count();
                let independent = effective_samples(&free_run.model.residual, mask);
                independent > INDEPENDENT * values as f64
            };
            return match free_run.verdict {
                Verdict::Named | Verdict::Family => true,
                Verdict::Parameters => !drifts || white(),
                _ => !drifts,
            };
        }
        Verdict::Family | Verdict::Unexplained => return true,
    }
    if free_run.verdict == Verdict::Unexplained {
        return false;
    }
    match (
        free_run.error_across_halves(fitted, mask),
        equation.error_across_halves(whole, counted),
    ) {
        (Some(free), Some(averaged)) if drifts => free < MUCH_BETTER * averaged,
        (Some(free), Some(averaged)) => free < averaged,
        // What a half does not determine has nothing to say of the other.
        (free, None) => free.is_some(),
        (None, Some(_)) => false,
    }
}
