//! `innovant simulate` of a plant in equations.

use std::path::Path;

use super::load_plant::{
    LoadedPlant, OtherNames, all_known, assignments, channels, load, named, read_channels,
    read_with, set_parameters, set_start, tell_warnings,
};
use super::units_of_logs::Channels;
use crate::cli::flags::RoleFlags;
use crate::cli::terminal::note;
use crate::cli::{Outcome, Verbosity};
use crate::explain::{AugmentedPlant, EffectFound};
use crate::identify::Recording;
use crate::log::{Channel, Log, Origin, RoleNeed, Roles, Source, write_simulation};
use crate::physics::estimate::{PlantRecording, start_by_least_squares};
use crate::physics::{Hold, Plant, Point, Trajectory, VariableId};
use crate::report::{PlantDocument, is_plant, significant};

/// Noise takes a variable beyond what it was before in this part of the samples.
const RARELY: f64 = 0.01;

/// Where the states start.
#[derive(Debug, Clone)]
pub(crate) enum Start {
    /// Values of the text.
    Text,
    /// All zero.
    Zero,
    /// Those that fit the recorded outputs best.
    Estimate,
    /// Some of them by name.
    Given(String),
}

/// What is asked of a plant.
pub(crate) struct PlantRun<'a> {
    pub(crate) plant: &'a Path,
    pub(crate) input: &'a Source,
    pub(crate) roles: &'a RoleFlags,
    pub(crate) parameters: Option<&'a str>,
    pub(crate) start: Start,
    pub(crate) hold: Option<Hold>,
    /// Answer of the original simulator to this input.
    pub(crate) simulation: Option<&'a Path>,
    pub(crate) output: &'a Path,
}

pub(crate) fn run(asked: &PlantRun, say: Verbosity) -> anyhow::Result<Outcome> {
    let loaded = load(asked.plant)?;
    tell_warnings(&loaded, say);
    let LoadedPlant {
        plant,
        mut point,
        hold,
        document,
        explanation,
        ..
    } = loaded;
    let hold = asked.hold.unwrap_or(hold);
    if let Some(text) = asked.parameters {
        parameters(&plant, &mut point, text)?;
        tell_out_of_bounds(&plant, &point, say);
    }
    let need = match asked.start {
        Start::Estimate => RoleNeed::Identify,
        _ => RoleNeed::InputsOnly,
    };
    let found = explanation.as_ref().and_then(|e| e.plant.as_ref());
    let mut columns = channels(&plant);
    columns
        .0
        .retain(|i| found.is_none_or(|f| !f.simulated_inputs.contains(&i.channel.name)));
    let remembered = found.and_then(|f| remembered(f, &columns));
    let source = std::slice::from_ref(asked.input);
    let with = |roles: &RoleFlags| {
        let of =
            |names: &Channels| read_channels(&plant, (&columns, names), source, roles, need, say);
        match (&remembered, of(&columns)) {
            (Some(names), Err(error)) if error.is::<OtherNames>() && !roles.names_columns() => {
                of(names).map_err(|other| match other.is::<OtherNames>() {
                    true => error,
                    false => other,
                })
            }
            (_, by_plant) => by_plant,
        }
    };
    let mut read = with(asked.roles)?;
    // A simulation goes on over a gap; what the inputs did there is said.
    if read.logs.len() > 1
        && asked.input.can_be_reopened()
        && let Some(bridged) = asked.roles.bridged()
    {
        read = with(&bridged)?;
    }
    let (mut logs, rows) = (read.logs, read.rows);
    if logs.len() != 1 {
        anyhow::bail!(
            "{}: samples are missing in the middle; a simulation needs one without gaps (--missing interpolate)",
            asked.input
        );
    }
    let mut log = logs.remove(0);
    let start_time = log.start_time;
    let known = match (&document, &explanation) {
        (Some(document), _) => &document.recordings[..],
        (_, Some(explanation)) => &explanation.recordings[..],
        _ => &[],
    };
    log.start_time += later(known, &read.known).unwrap_or(0.0);
    let simulated = match (asked.simulation, found) {
        (Some(file), Some(found)) => Some(simulated(found, file, asked.roles, say)?),
        _ => None,
    };
    let original = found
        .map(|found| found.original(&log, simulated.as_deref(), hold))
        .transpose()
        .map_err(|e| anyhow::anyhow!("{}: {e}", asked.simulation.unwrap_or(asked.plant).display()))?
        .flatten();
    if asked.simulation.is_some() && original.is_none() {
        anyhow::bail!(
            "{}: --simulation belongs to an explanation of simulated columns, and this plant was given as equations; leave it out",
            asked.plant.display()
        );
    }
    let original = original.unwrap_or_default();
    log.input_data.extend(original.inputs.iter().cloned());
    if let Some(explanation) = &explanation
        && let Some(found) = &explanation.plant
        && !all_known(&explanation.recordings, std::slice::from_ref(&log))
    {
        let before = log.start_time - log.sample_time;
        let times = found.times_of_change.iter();
        let changed: Vec<(String, f64)> = times.map(|name| (name.clone(), before)).collect();
        set_parameters(&plant, &mut point, &changed)?;
    }
    match &asked.start {
        Start::Text => {
            // On a recording that it was estimated from, a plant starts where that was found to start.
            let known = document
                .iter()
                .flat_map(|d| d.recordings.iter().zip(&d.initial_states));
            for (_, states) in known.filter(|(r, _)| {
                r.sha256.is_some() && r.sha256 == log.sha256 && r.start_time == log.start_time
            }) {
                let values: Vec<(String, f64)> =
                    states.iter().map(|s| (s.name.clone(), s.value)).collect();
                set_start(&plant, &mut point, &values)?;
            }
        }
        Start::Zero => point.start.fill(Some(0.0)),
        Start::Given(text) => {
            set_start(&plant, &mut point, &assignments("--initial-state", text)?)?
        }
        Start::Estimate => {
            let at_values = plant.with_values(&point.parameters);
            let recording = PlantRecording::from(&log);
            tell_missing(&log, &recording, say);
            point.start = start_by_least_squares(&at_values, &recording, hold)?;
        }
    }
    if matches!(asked.start, Start::Text) {
        set_start(&plant, &mut point, &original.start)?;
    }
    let run = plant
        .run(&log, &point, hold)
        .map_err(|e| anyhow::anyhow!("{}: {e}", asked.plant.display()))?;
    if !say.quiet {
        let effects = explanation.iter().flat_map(|e| &e.effects);
        effects.for_each(|effect| tell_extrapolation(effect, &plant, &log, &run));
    }
    let mut outputs = run.outputs;
    original.add_remainder(&mut outputs);
    let declared = plant.spec.outputs().into_iter().map(|v| Channel {
        name: plant.spec.variable(v).column().to_owned(),
        unit: plant.spec.variable(v).unit_text.clone(),
    });
    let found = explanation.and_then(|e| e.plant);
    let outputs_of: Vec<Channel> = found.map_or_else(|| declared.collect(), |p| p.outputs);
    let columns: Vec<(&Channel, &[f64])> = outputs_of
        .iter()
        .zip(outputs.iter().map(Vec::as_slice))
        .collect();
    let grid = (log.sample_time, start_time);
    write_simulation(asked.output, grid, rows.as_deref(), &columns)?;
    Ok(Outcome::Done)
}

/// Seconds by which time zero of a recording is later than that of those that a plant was fitted to; none where not all have dates. What
/// repeats every day, or has changed, depends on the date.
fn later(fitted: &[Recording], read: &[Recording]) -> Option<f64> {
    let origin = |of: &[Recording]| Origin::parse(of.first()?.origin.as_ref()?);
    Some(origin(read)?.since(&origin(fitted)?))
}

/// The names of the columns that were explained, for those of the plant; none where they are the same.
fn remembered(found: &AugmentedPlant, columns: &Channels) -> Option<Channels> {
    let of = |all: &[Channel]| all.iter().map(|c| named(&c.name)).collect::<Vec<_>>();
    let mut inputs = of(&found.inputs);
    // The last ones are those of the simulator.
    inputs.truncate(columns.0.len());
    let names = (inputs, of(&found.outputs));
    let fits = names.0.len() == columns.0.len() && names.1.len() == columns.1.len();
    (fits && names != *columns).then_some(names)
}

/// Says how often a law is used beyond the values of its variable that it was found at.
fn tell_extrapolation(effect: &EffectFound, plant: &Plant, log: &Log, run: &Trajectory) {
    let column = |name: &String| -> Option<&[f64]> {
        let is = |v: &VariableId| plant.spec.variable(*v).name == *name;
        let state = plant.spec.states().iter().position(is);
        let input = plant.spec.inputs().iter().position(is);
        let state = state.and_then(|i| run.states.get(i));
        let found = state.or_else(|| log.input_data.get(input?));
        found.map(Vec::as_slice)
    };
    let Some(law) = &effect.law else { return };
    let columns: Option<Vec<&[f64]>> = effect.depends.iter().map(column).collect();
    let values: Vec<f64> = match columns.as_deref() {
        Some(&[one]) if law.variable == effect.depends[0] => one.to_vec(),
        Some(&[a, b])
            if law.variable == format!("({} - {})", effect.depends[0], effect.depends[1]) =>
        {
            a.iter().zip(b).map(|(a, b)| a - b).collect()
        }
        _ => return,
    };
    let range = || law.at.iter().copied();
    let (least, most) = (
        range().fold(f64::INFINITY, f64::min),
        range().fold(f64::NEG_INFINITY, f64::max),
    );
    let outside = values.iter().filter(|v| !(least..=most).contains(*v));
    let share = outside.count() as f64 / values.len().max(1) as f64;
    if share > RARELY {
        note(&format!(
            "warning: {} is outside {} to {} in {:.0} % of the samples; {} was found there and is extrapolated\n",
            law.variable,
            significant(least, 4),
            significant(most, 4),
            100.0 * share,
            effect.effect.replace('_', " "),
        ));
    }
}

/// Says how many samples the initial state is estimated from, where that is not all.
fn tell_missing(log: &Log, recording: &PlantRecording, say: Verbosity) {
    let known = |k: usize| recording.outputs.iter().all(|y| y[k].is_finite());
    let count = (0..log.samples()).filter(|&k| known(k)).count();
    if count < log.samples() && !say.quiet {
        note(&format!(
            "{}: the initial state is estimated from the {count} samples that have outputs; all {} are simulated\n",
            log.name,
            log.samples()
        ));
    }
}

/// The simulator's answer to one input.
fn simulated(
    found: &AugmentedPlant,
    file: &Path,
    roles: &RoleFlags,
    say: Verbosity,
) -> anyhow::Result<Vec<Vec<f64>>> {
    let outputs: Vec<String> = found.outputs.iter().map(|c| c.name.clone()).collect();
    let roles = Roles {
        inputs: None,
        outputs: Some(outputs),
        ..roles.clone().roles()
    };
    let source = Source::from(file.to_owned());
    let mut logs = read_with(&roles, &[source], RoleNeed::OutputsOnly, say)?.logs;
    if logs.len() != 1 {
        anyhow::bail!(
            "{}: samples are missing in the middle; give the simulator's answer without gaps",
            file.display()
        );
    }
    Ok(logs.remove(0).output_data)
}

/// Says on standard error which values are outside the bounds of the text: a simulation may use them.
fn tell_out_of_bounds(plant: &crate::physics::Plant, point: &Point, say: Verbosity) {
    for (&v, value) in plant.spec.parameters().iter().zip(&point.parameters) {
        let v = plant.spec.variable(v);
        if !(v.min..=v.max).contains(value) && !say.quiet {
            let name = v.column();
            note(&format!(
                "warning: --parameters: {name} = {value} is outside its bounds in the text, {} to {}; it is used all the same\n",
                v.min, v.max
            ));
        }
    }
}

/// Values by name, or those of a plant that was estimated.
fn parameters(plant: &crate::physics::Plant, point: &mut Point, text: &str) -> anyhow::Result<()> {
    if text.contains('=') {
        return set_parameters(plant, point, &assignments("--parameters", text)?);
    }
    let document = std::fs::read_to_string(text).map_err(|e| {
        anyhow::anyhow!(
            "--parameters: {text} is neither `name=value` nor a file that can be read: {e}"
        )
    })?;
    if !is_plant(&document) {
        anyhow::bail!("--parameters: {text} is not what `innovant identify --structure` writes");
    }
    let values: Vec<(String, f64)> = PlantDocument::parse(text, &document)?
        .parameters
        .into_iter()
        .map(|p| (p.name, p.value))
        .collect();
    set_parameters(plant, point, &values)
}
