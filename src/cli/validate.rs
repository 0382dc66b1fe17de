//! `innovant validate`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::flags::{RoleFlags, numbers, tell_reading};
use super::plant::{all_known, is_plant_file, load, read_recordings};
use super::terminal::{check_distinct, print, style};
use super::{Outcome, Verbosity};
use crate::identify::{Model, Recording};
use crate::log::{Log, Reading, RoleNeed, Source, check_same_sampling};
use crate::moments::Detrend;
use crate::physics::estimate::PlantRecording;
use crate::report::text::{plant_validation_text, validation_text};
use crate::report::{
    PLANT_VALIDATION_FORMAT, VALIDATION_FORMAT, ValidationDocument, judge_plant, read_model,
    text_alone, to_json,
};
use crate::validate::{Deviations, Relation, Zero, judge};

const EXAMPLE: &str = "Examples:
  innovant validate model.json fresh.csv && echo the model holds
  innovant validate model.json fresh.csv --detrend mean     another operating point
  innovant validate model.json fresh.csv --format json | jq .whiteness.p_value
  innovant validate plant.json fresh.csv                    a plant in equations: initial states are estimated

Exit codes: 0 accepted; 1 rejected; 2 an error.";

/// Validate a model on recordings: fit, tests of the residuals, bounds
///
/// Columns are found by the names in the model. On the recording that the model was estimated from (known by its SHA-256)
/// the tests allow for the degrees of freedom that the estimation has used, on a fresh one for the errors of the
/// parameters.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLE)]
pub(super) struct Flags {
    /// Model, as `innovant identify --output` writes it, or {"A":..,"B":..,"C":..,"dt":..}, or a plant in equations (.mo)
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// Recordings: CSV, also gzipped; `-` is standard input
    #[arg(value_name = "LOG", required = true)]
    logs: Vec<Source>,
    #[command(flatten)]
    roles: RoleFlags,
    /// What to subtract from each channel first [default: as for the model, or its operating point for a fresh recording]
    #[arg(long, value_enum)]
    detrend: Option<DetrendFlag>,
    /// Level of the tests: the probability that a correct model is rejected
    #[arg(long, default_value = "0.01", value_name = "P", value_parser = numbers::level)]
    level: f64,
    /// Format of the result
    #[arg(long, value_enum, default_value = "text")]
    format: Format,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum DetrendFlag {
    /// The operating point of the model
    Level,
    /// The mean of the recording
    Mean,
    /// The linear trend of the recording
    Linear,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Format {
    /// Tables
    Text,
    /// A JSON document
    Json,
}

pub(super) fn run(flags: Flags, say: Verbosity) -> anyhow::Result<Outcome> {
    let mut sources = flags.logs.clone();
    sources.insert(0, Source::from(flags.model.clone()));
    check_distinct(&sources)?;
    if is_plant_file(&flags.model) {
        if flags.detrend.is_some() {
            anyhow::bail!(
                "{}: --detrend belongs to linear models; a plant in equations is compared with the recording as it is",
                flags.model.display()
            );
        }
        return validate_plant(&flags, say);
    }
    let model = read_model(&flags.model)?.model;
    if model.inputs.is_empty() {
        anyhow::bail!(
            "{}: this model has no inputs; a recording of outputs alone cannot be compared with it yet",
            flags.model.display()
        );
    }
    let roles = flags.roles.of_model(&model.inputs, &model.outputs)?;
    let mut logs: Vec<Log> = Vec::with_capacity(flags.logs.len());
    let mut recordings = Vec::with_capacity(flags.logs.len());
    for source in &flags.logs {
        let reading = Reading::read(source, &roles, RoleNeed::Identify)?;
        tell_reading(&source.to_string(), reading.said.as_deref(), say);
        recordings.extend(
            reading
                .logs
                .iter()
                .map(|log| Recording::of_log(log, Some(&reading))),
        );
        for log in reading.logs {
            check_sampling(&flags.model.display().to_string(), &model, &log)?;
            if let Some(first) = logs.first() {
                // The columns are the same by construction; their units may differ.
                first.check_same_channels(&log)?;
            }
            logs.push(log);
        }
    }
    let relation = relation(&model, &logs);
    let zero = match (flags.detrend, relation) {
        (Some(DetrendFlag::Level), _) | (None, Relation::Fresh) => Zero::Levels,
        (Some(DetrendFlag::Mean), _) => Zero::Own(Detrend::Mean),
        (Some(DetrendFlag::Linear), _) => Zero::Own(Detrend::Linear),
        (None, Relation::Estimation) => Zero::of_estimation(&model),
    };
    let records: Vec<Deviations> = logs
        .iter()
        .map(|log| Deviations::of_log(log, &model, zero))
        .collect();
    let tests = judge(&model, &records, relation, Some(flags.level)).map_err(|reason| {
        let names: Vec<&str> = logs.iter().map(|log| log.name.as_str()).collect();
        anyhow::anyhow!("{}: {reason}", names.join(", "))
    })?;
    match flags.format {
        Format::Json => print(&to_json(&ValidationDocument {
            format: VALIDATION_FORMAT,
            model: flags.model.display().to_string(),
            recordings,
            validation: &tests,
        })?)?,
        Format::Text if say.quiet => {}
        Format::Text => print(&validation_text(&tests))?,
    }
    Ok(if tests.rejected {
        Outcome::Rejected
    } else {
        Outcome::Done
    })
}

/// A plant in equations: its parameters are held, the initial states of the recordings are estimated.
fn validate_plant(flags: &Flags, say: Verbosity) -> anyhow::Result<Outcome> {
    let name = flags.model.display().to_string();
    let loaded = load(&flags.model)?;
    let plant = &loaded.plant;
    let (logs, recordings) =
        read_recordings(plant, &flags.logs, &flags.roles, RoleNeed::Identify, say)?;
    let records: Vec<PlantRecording> = logs.iter().map(PlantRecording::from).collect();
    let held = match &loaded.document {
        None => text_alone(&loaded.point, loaded.hold),
        Some(document) => {
            for log in &logs {
                let expected = document.sample_time.unwrap_or(log.sample_time);
                check_same_sampling(&name, expected, &log.name, log.sample_time)?;
            }
            let own = all_known(&document.recordings, &logs);
            document.held(plant, &loaded.point, own)
        }
    };
    let (found, _) = judge_plant(plant, &records, &held, flags.level)
        .map_err(|e| anyhow::anyhow!("{name}: {e}"))?;
    match flags.format {
        Format::Json => print(&to_json(&ValidationDocument {
            format: PLANT_VALIDATION_FORMAT,
            model: name,
            recordings,
            validation: &found,
        })?)?,
        Format::Text if say.quiet => {}
        Format::Text => print(&plant_validation_text(&found, style()))?,
    }
    Ok(if found.rejected {
        Outcome::Rejected
    } else {
        Outcome::Done
    })
}

/// Whether the sampling of a recording is that of the model, to 0.1 %.
pub(super) fn check_sampling(name: &str, model: &Model, log: &Log) -> anyhow::Result<()> {
    let (expected, found) = (model.system.sample_time, log.sample_time);
    if check_same_sampling(name, expected, &log.name, found).is_err() {
        anyhow::bail!(
            "{}: the sample time is {found} s, but the model ({name}) has {expected} s; resample the recording to \
             {expected} s, or identify a model at {found} s (when only the time stamps are off, `--dt {expected}` \
             ignores them)",
            log.name
        );
    }
    Ok(())
}

/// The recordings are those of the estimation when all of them are.
fn relation(model: &Model, logs: &[Log]) -> Relation {
    if all_known(&model.recordings, logs) {
        Relation::Estimation
    } else {
        Relation::Fresh
    }
}
