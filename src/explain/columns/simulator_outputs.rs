//! Simulated outputs as what sensors measure: `y = y_simulated`, a plant without states whose inputs are the simulated outputs.
//! Effects of sensors are found in it, whatever the simulator is.

use super::column::Column;
use super::columns_answer::logs_with_recordings;
use crate::explain::compare_explanations::leaves_slow_error;
use crate::explain::engine::terms::library::sensor_effects;
use crate::explain::explanation::{Explanation, Verdict};
use crate::explain::linear::check::Checked;
use crate::explain::plant_answer::{PlantOptions, explain_plant};
use crate::explain::simulation::Simulation;
use crate::log::Channel;
use crate::physics::{Hold, Plant, parse};

/// What follows the name of an output in that of its simulated values.
const SIMULATED: &str = "_simulated";

/// Other parameters of a simulator look like another scale of its sensor, and they are not known here.
const SCALE: &str = "sensor_scale";

/// Explains the recording by effects of the sensors; none where these have no name, or leave a slow error in an output: it is not the
/// sensors then that are wrong, or not alone.
pub(crate) fn explain_sensors(checked: &Checked, without: &[String]) -> Option<Explanation> {
    let Simulation::Outputs(simulated) = &checked.simulation else {
        return None;
    };
    let first = checked.recordings.first()?;
    let plant = Plant::new(parse(&text(&first.inputs, &first.outputs)).ok()?);
    let pairs = checked.recordings.iter().zip(simulated);
    let (logs, recordings) = logs_with_recordings(pairs.map(|(recorded, simulated)| {
        let mut log = recorded.clone();
        log.inputs.extend(simulated.outputs.iter().cloned());
        log.input_data.extend(simulated.output_data.iter().cloned());
        log
    }));
    let allowed = |id: &&str| *id != SCALE && !without.iter().any(|w| w == id);
    let options = PlantOptions {
        hold: Hold::Linear,
        only: sensor_effects()
            .filter(allowed)
            .map(str::to_owned)
            .collect(),
        ..PlantOptions::default()
    };
    if options.only.is_empty() {
        return None;
    }
    let mut explanation = explain_plant(&plant, &logs, recordings, &options).ok()?;
    let found = explanation.plant.as_mut()?;
    let inputs = plant.spec.inputs().into_iter().skip(first.inputs.len());
    found.simulated_inputs = inputs
        .map(|v| plant.spec.variable(v).column().to_owned())
        .collect();
    (explanation.verdict == Verdict::Named && !leaves_slow_error(&explanation))
        .then_some(explanation)
}

fn text(inputs: &[Channel], outputs: &[Channel]) -> String {
    let of = |channels: &[Channel]| channels.iter().cloned().map(Column).collect::<Vec<_>>();
    let (inputs, outputs) = (of(inputs), of(outputs));
    let mut text = String::from("model Simulation \"sensors of the simulated outputs\"\n");
    for input in &inputs {
        text += &format!("  input Real {}{};\n", input.name(), input.unit());
    }
    for output in &outputs {
        let simulated = output.suffixed(SIMULATED);
        text += &format!("  input Real {simulated}{};\n", output.unit());
        text += &format!("  output Real {}{};\n", output.name(), output.unit());
    }
    text += "equation\n";
    for output in &outputs {
        text += &format!("  {} = {};\n", output.name(), output.suffixed(SIMULATED));
    }
    text + "end Simulation;\n"
}
