//! The answer where a simulation is known by its outputs, and equations reproduce them.

use super::{Question, Reproduced, USEFUL, reproduce};
use crate::explain::compare_explanations::{doubt, take_back};
use crate::explain::engine::terms::documentation::plant_effect;
use crate::explain::explanation::{Explanation, FitSteps, Verdict};
use crate::explain::linear::check::Checked;
use crate::explain::plant_answer::{PlantOptions, explain_plant};
use crate::explain::simulation::Simulation;
use crate::identify::Recording;
use crate::log::{Log, counted};
use crate::physics::estimate::PlantRecording;

/// Equations in place of the simulated columns; none where no equations reproduce them.
pub(crate) fn equations(checked: &Checked) -> Option<Reproduced> {
    let Simulation::Outputs(simulated) = &checked.simulation else {
        return None;
    };
    let first = checked.recordings.first()?;
    let known = checked.recordings.iter().zip(simulated);
    let columns: Vec<PlantRecording> = known
        .map(|(recorded, simulated)| PlantRecording {
            outputs: simulated.output_data.clone(),
            ..PlantRecording::from(recorded)
        })
        .collect();
    let difference: Vec<f64> = (0..first.outputs.len())
        .map(|j| difference(&checked.recordings, simulated, j))
        .collect();
    let question = Question {
        inputs: &first.inputs,
        outputs: &first.outputs,
        difference: &difference,
    };
    reproduce(&columns, &question).filter(|f| f.misfit <= USEFUL)
}

/// Explains with equations in place of the simulated columns.
pub(crate) fn explain_equations(
    found: &Reproduced,
    checked: &Checked,
    without: &[String],
) -> Option<Explanation> {
    let outputs = checked.recordings.first()?.outputs.len();
    let mut logs = checked.recordings.clone();
    for (r, log) in logs.iter_mut().enumerate() {
        for (j, y) in log.output_data.iter_mut().enumerate() {
            let rest = &found.remainder[r * outputs + j];
            y.iter_mut().zip(rest).for_each(|(y, rest)| *y -= rest);
        }
    }
    let (logs, recordings) = logs_with_recordings(logs.into_iter());
    let options = PlantOptions {
        hold: found.hold,
        // Effects that only linear simulators have are not tried here.
        without: without
            .iter()
            .filter(|id| plant_effect(id).is_some())
            .cloned()
            .collect(),
        ..PlantOptions::default()
    };
    let mut explanation = explain_plant(&found.plant, &logs, recordings, &options).ok()?;
    // Nobody has written a text of these equations.
    for line in &mut explanation.summary {
        *line = line.replace("the text", "the simulation");
    }
    explanation.summary.push(format!(
        "The simulated outputs follow equations with {}, to {:.2} % of what the recording differs by; this answer is about these equations.",
        counted(found.plant.spec.states().len(), "state"),
        100.0 * found.misfit
    ));
    doubt_below_remainder(&mut explanation, found, checked);
    if let Some(plant) = &mut explanation.plant {
        plant.simulation = Some(found.plant.spec.text.clone());
    }
    Some(explanation)
}

/// Takes a name back that explains less of every output than the equations miss of it: what they miss of the simulation, they may lack
/// in the recording too. Nothing is missing surely where what other parameters leave is less than that.
pub(super) fn doubt_below_remainder(
    explanation: &mut Explanation,
    found: &Reproduced,
    checked: &Checked,
) {
    let left = |steps: &FitSteps| steps.parameters_only.rmse.powi(2);
    let explained = |steps: &FitSteps| left(steps) - steps.augmented.rmse.powi(2);
    if explanation.verdict != Verdict::Named || found.exceeded(explanation, checked, &explained) {
        return;
    }
    if found.exceeded(explanation, checked, &left) {
        take_back(
            explanation,
            Verdict::Unexplained,
            "The following is not sure: it explains less of the recording than the equations miss of the simulated outputs.",
        );
    } else {
        take_back(
            explanation,
            Verdict::Parameters,
            "Nothing is surely left out: other parameters leave less of the recording than the equations miss of the simulated outputs.",
        );
    }
}

/// What equations leave that reproduce the columns roughly may be their own error, and a name beside it stand for that: unless it is less
/// than they miss.
pub(crate) fn doubt_rough(explanation: &mut Explanation, found: &Reproduced, checked: &Checked) {
    let left = |steps: &FitSteps| steps.augmented.rmse.powi(2);
    if !explanation.remaining.adequate && found.exceeded(explanation, checked, &left) {
        doubt(explanation);
    }
}

impl Reproduced {
    /// Whether this mean square is, in some output, larger than that of what the equations miss.
    fn exceeded(
        &self,
        explanation: &Explanation,
        checked: &Checked,
        square: &dyn Fn(&FitSteps) -> f64,
    ) -> bool {
        let outputs = checked.recordings.first().map_or(&[][..], |r| &r.outputs);
        let fit = &explanation.fit;
        let several = fit.outputs.iter().map(|o| (&o.output, &o.train));
        let mut each = several.collect::<Vec<_>>();
        if each.is_empty() {
            each.push((&fit.output, &fit.train));
        }
        each.into_iter().any(|(name, steps)| {
            let place = outputs.iter().position(|output| output.name == *name);
            let rest = place.map(|j| self.remainder.iter().skip(j).step_by(outputs.len()));
            rest.is_none_or(|rest| square(steps) > rms(rest.flatten().copied()).powi(2))
        })
    }
}

/// Logs, and how a document refers to them.
pub(crate) fn logs_with_recordings(logs: impl Iterator<Item = Log>) -> (Vec<Log>, Vec<Recording>) {
    logs.map(|log| {
        let recording = Recording::of_log(&log, None);
        (log, recording)
    })
    .unzip()
}

/// Root mean square of recorded less simulated.
fn difference(recorded: &[Log], simulated: &[Log], output: usize) -> f64 {
    let pairs = recorded.iter().zip(simulated).flat_map(|(r, s)| {
        let ours = r.output_data[output].iter();
        ours.zip(&s.output_data[output])
    });
    rms(pairs.map(|(y, s)| y - s))
}

/// Root mean square of what is known.
fn rms(errors: impl Iterator<Item = f64>) -> f64 {
    let known = errors.filter(|e| e.is_finite());
    let (sum, count) = known.fold((0.0, 0), |(sum, n), e| (sum + e * e, n + 1));
    (sum / f64::from(count.max(1))).sqrt()
}
