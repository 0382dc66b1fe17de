//! Plants in equations on the command line: reading them, their columns, values given by name.

use std::path::Path;

use anyhow::Context;

use super::units_of_logs::{Channels, units_of_logs};
use crate::cli::Verbosity;
use crate::cli::flags::{RoleFlags, tell_reading};
use crate::cli::terminal::note;
use crate::explain::Explanation;
use crate::identify::{IdentifiedChannel, Recording};
use crate::log::{Channel, Log, LogError, Missing, Reading, RoleNeed, Roles, Source};
use crate::physics::{
    Hold, Plant, Point, VariableId, diagnose, other_clock, render_all, unknown_units,
};
use crate::report::{PlantDocument, is_explanation, is_plant, parse_explanation};

/// A plant from a file.
pub(crate) struct LoadedPlant {
    pub(crate) plant: Plant,
    /// Values of the text, or those that were estimated.
    pub(crate) point: Point,
    pub(crate) hold: Hold,
    /// What was estimated, where the file says so.
    pub(crate) document: Option<PlantDocument>,
    /// The explanation that it comes from.
    pub(crate) explanation: Option<Explanation>,
    /// What may be wrong with the text.
    pub(crate) warnings: Vec<String>,
    /// That of them which makes answers wrong: equations in hours or days.
    pub(crate) clock: Option<String>,
}

impl LoadedPlant {
    /// The equations with the values of the parameters.
    pub(crate) fn modelica(&self) -> String {
        self.plant.text_at(&self.point)
    }
}

/// Whether a file holds a plant: a text by its name, or a document by what it says; also what explains one.
pub(crate) fn is_plant_file(path: &Path) -> bool {
    is_text(path)
        || std::fs::read_to_string(path)
            .is_ok_and(|text| is_plant(&text) || explained(path, &text).is_some())
}

/// An explanation of a plant.
fn explained(path: &Path, text: &str) -> Option<Explanation> {
    let read = || parse_explanation(&path.display().to_string(), text);
    let explanation = is_explanation(text).then(read)?.ok()?;
    explanation.plant.is_some().then_some(explanation)
}

fn is_text(path: &Path) -> bool {
    path.extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("mo"))
}

/// Reads a plant.
pub(crate) fn load(path: &Path) -> anyhow::Result<LoadedPlant> {
    let name = path.display().to_string();
    let text = std::fs::read_to_string(path).map_err(|e| match e.kind() {
        std::io::ErrorKind::InvalidData => {
            anyhow::anyhow!("{name}: this is no plant: the file is not text in UTF-8")
        }
        _ => anyhow::anyhow!("{name}: cannot be read: {e}"),
    })?;
    if let Some(explanation) = explained(path, &text)
        && let Some(found) = &explanation.plant
    {
        let loaded = of_text(&name, &found.modelica)?;
        return Ok(LoadedPlant {
            hold: found.hold(),
            explanation: Some(explanation),
            ..loaded
        });
    }
    if !is_text(path) && text.trim_start().starts_with('{') {
        let document = PlantDocument::parse(&name, &text)?;
        let (plant, point) = document
            .plant()
            .map_err(|e| anyhow::anyhow!("{name}: {e}"))?;
        let plant = plant.with_values(&point.parameters);
        return Ok(LoadedPlant {
            plant,
            point,
            hold: document.hold(),
            document: Some(document),
            explanation: None,
            warnings: vec![],
            clock: None,
        });
    }
    of_text(&name, &text)
}

fn of_text(name: &str, text: &str) -> anyhow::Result<LoadedPlant> {
    let spec =
        diagnose(text).map_err(|errors| anyhow::anyhow!("{}", render_all(&errors, name, text)))?;
    let unknown = unknown_units(&spec).into_iter();
    let warnings: Vec<String> = unknown
        .map(|u| format!("{name}:{}:{}: {u}", u.line, u.column))
        .collect();
    let clock = other_clock(&spec).map(|c| format!("{name}:{}:{}: {c}", c.line, c.column));
    let plant = Plant::new(spec);
    let point = plant.nominal();
    Ok(LoadedPlant {
        plant,
        point,
        hold: Hold::Zero,
        document: None,
        explanation: None,
        warnings,
        clock,
    })
}

/// Says on standard error what may be wrong with a plant that can be used.
pub(crate) fn tell_warnings(loaded: &LoadedPlant, say: Verbosity) {
    let all = loaded.warnings.iter().chain(&loaded.clock);
    for warning in all.filter(|_| !say.quiet) {
        note(&format!("warning: {warning}\n"));
    }
}

pub(super) fn named(name: &str) -> IdentifiedChannel {
    IdentifiedChannel {
        channel: Channel::new(name),
        level: 0.0,
        delay: 0,
    }
}

/// Channels of the plant's inputs and outputs.
pub(crate) fn channels(plant: &Plant) -> Channels {
    let channel = |v| named(plant.spec.variable(v).column());
    let spec = &plant.spec;
    (
        spec.inputs().into_iter().map(channel).collect(),
        spec.outputs().into_iter().map(channel).collect(),
    )
}

/// Reads recordings of a plant; one with gaps is several.
pub(crate) fn read_recordings(
    plant: &Plant,
    sources: &[Source],
    flags: &RoleFlags,
    need: RoleNeed,
    say: Verbosity,
) -> anyhow::Result<(Vec<Log>, Vec<Recording>)> {
    let channels = channels(plant);
    let read = read_channels(plant, (&channels, &channels), sources, flags, need, say)?;
    Ok((read.logs, read.known))
}

/// Reads these channels of a plant, in its units, by the names of columns; a recording with gaps is several.
pub(super) fn read_channels(
    plant: &Plant,
    (of_plant, (inputs, outputs)): (&Channels, &Channels),
    sources: &[Source],
    flags: &RoleFlags,
    need: RoleNeed,
    say: Verbosity,
) -> anyhow::Result<Recordings> {
    let roles = kept_missing(flags.clone().of_model(inputs, outputs)?);
    let need = if inputs.is_empty() {
        RoleNeed::OutputsOnly
    } else {
        need
    };
    let read =
        read_with(&roles, sources, need, say).map_err(|e| match e.downcast::<LogError>() {
            Ok(of_names) => other_names(of_names, inputs, outputs),
            Err(other) => other,
        })?;
    for said in units_of_logs(&plant.spec, of_plant, &read.logs)? {
        if !say.quiet {
            note(&format!("warning: {said}\n"));
        }
    }
    Ok(read)
}

/// Equations are compared where something was measured: outputs stay missing, unless it is asked for otherwise.
pub(crate) fn kept_missing(roles: Roles) -> Roles {
    let missing = match roles.missing {
        Missing::Auto => Missing::Keep,
        asked => asked,
    };
    Roles { missing, ..roles }
}

/// Recordings as they were read.
pub(crate) struct Recordings {
    pub(crate) logs: Vec<Log>,
    /// Where each is from.
    pub(crate) known: Vec<Recording>,
    /// Times of the rows of the only file, where the recording lies on another grid that was not asked for.
    pub(crate) rows: Option<Vec<f64>>,
}

/// Reads recordings with these columns; one with gaps is several. Where all have dates, time counts from the first of the first.
pub(crate) fn read_with(
    roles: &Roles,
    sources: &[Source],
    need: RoleNeed,
    say: Verbosity,
) -> anyhow::Result<Recordings> {
    let mut readings = Vec::new();
    for source in sources {
        let reading = Reading::read(source, roles, need)?;
        tell_reading(&source.to_string(), reading.said.as_deref(), say);
        readings.push(reading);
    }
    let first = readings.first().and_then(|r| r.origin);
    let first = first.filter(|_| readings.iter().all(|r| r.origin.is_some()));
    let rows = match &mut readings[..] {
        [only] => only.rows.take(),
        _ => None,
    };
    let (mut logs, mut known) = (Vec::new(), Vec::new());
    for mut reading in readings {
        if let (Some(origin), Some(first)) = (reading.origin, first) {
            let later = origin.since(&first);
            reading.logs.iter_mut().for_each(|l| l.start_time += later);
            reading.origin = Some(first);
        }
        for log in &reading.logs {
            known.push(Recording {
                name: log.name.clone(),
                sha256: log.sha256.clone(),
                samples: log.samples(),
                start_time: log.start_time,
                origin: reading.origin.as_ref().map(ToString::to_string),
                reading: reading.said.clone(),
            });
        }
        logs.extend(reading.logs);
    }
    Ok(Recordings { logs, known, rows })
}

/// An error of reading, with the way to read a recording that has other names than the plant.
fn other_names(
    error: LogError,
    inputs: &[IdentifiedChannel],
    outputs: &[IdentifiedChannel],
) -> anyhow::Error {
    if !matches!(error, LogError::UnknownColumn { .. }) {
        return error.into();
    }
    let flag = |flag: &str, channels: &[IdentifiedChannel]| {
        let names: Vec<&str> = channels.iter().map(|c| c.channel.name.as_str()).collect();
        (!names.is_empty()).then(|| format!("`{flag}` for {}", names.join(", ")))
    };
    let flags = [flag("--inputs", inputs), flag("--outputs", outputs)];
    let flags: Vec<String> = flags.into_iter().flatten().collect();
    let said = format!(
        "{error}; where the file has other names than the plant, list its columns with {}, in this order",
        flags.join(" and with ")
    );
    OtherNames(said).into()
}

/// A recording that has other names than the plant.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(super) struct OtherNames(String);

/// `name=value` pairs, separated by commas.
pub(super) fn assignments(flag: &str, text: &str) -> anyhow::Result<Vec<(String, f64)>> {
    text.split(',')
        .map(|pair| {
            let (name, value) = pair
                .split_once('=')
                .with_context(|| format!("{flag}: `{pair}` is no `name=value`"))?;
            let value: f64 = value
                .trim()
                .parse()
                .ok()
                .filter(|v: &f64| v.is_finite())
                .with_context(|| format!("{flag}: `{}` is no number", value.trim()))?;
            Ok((name.trim().to_owned(), value))
        })
        .collect()
}

/// Sets parameters by name.
pub(super) fn set_parameters(
    plant: &Plant,
    point: &mut Point,
    values: &[(String, f64)],
) -> anyhow::Result<()> {
    let parameters = plant.spec.parameters();
    for (name, value) in values {
        let at = parameters.iter().position(|&v| plant.spec.variable(v).name == *name).with_context(|| {
            let known: Vec<&str> = parameters.iter().map(|&v| plant.spec.variable(v).name.as_str()).collect();
            match plant.spec.find(name) {
                Some(_) => format!("--parameters: `{name}` is not a parameter that may be changed; these are: {}", known.join(", ")),
                None => format!("--parameters: the plant has no parameter `{name}`; it has {}", known.join(", ")),
            }
        })?;
        point.parameters[at] = *value;
    }
    Ok(())
}

/// Sets initial states by name.
pub(super) fn set_start(
    plant: &Plant,
    point: &mut Point,
    values: &[(String, f64)],
) -> anyhow::Result<()> {
    for (name, value) in values {
        let at = place(
            plant,
            plant.spec.states(),
            ("--initial-state", "state"),
            name,
        )?;
        point.start[at] = Some(*value);
    }
    Ok(())
}

/// Place of the variable called `name` among variables of one kind; the message names the flag.
pub(crate) fn place(
    plant: &Plant,
    variables: Vec<VariableId>,
    (flag, kind): (&str, &str),
    name: &str,
) -> anyhow::Result<usize> {
    let names: Vec<&str> = variables
        .iter()
        .map(|&v| plant.spec.variable(v).name.as_str())
        .collect();
    names.iter().position(|n| *n == name).with_context(|| {
        format!(
            "{flag}: the plant has no {kind} `{name}`; it has {}",
            names.join(", ")
        )
    })
}

/// Whether every log is one of the recordings, by its SHA-256.
pub(crate) fn all_known(recordings: &[Recording], logs: &[Log]) -> bool {
    logs.iter().all(|log| {
        recordings
            .iter()
            .any(|r| r.sha256.is_some() && r.sha256 == log.sha256)
    })
}
