//! `innovant identify --simulator`: the parameters of another program that simulates.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use clap::Args;

use super::simulator_command::SimulatorCommand;
use super::simulator_parameters;
use crate::cli::flags::{RoleFlags, numbers};
use crate::cli::plant::{StructureFlags, kept_missing, read_with, write_and_tell};
use crate::cli::terminal::{Output, Progress, check_distinct, note, paths};
use crate::cli::{Outcome, Verbosity};
use crate::log::{Channel, Log, RoleNeed, Source, check_same_sampling};
use crate::physics::estimate::{EstimateOptions, Form, PlantRecording, estimate};
use crate::physics::external::{ExternalPlant, ExternalSimulator, Failure};
use crate::physics::{Excitation, Hold};
use crate::report::{PlantDocument, SimulatorDocument, plant_fits};

/// Seconds that a run may take, unless given.
const TIME_LIMIT: f64 = 60.0;

/// An external simulator.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "External simulator")]
pub(crate) struct SimulatorFlags {
    /// Estimate the parameters of this program, which simulates the plant. It gets three files: `{input}`, CSV with time `t`
    /// and the inputs of the log; `{output}`, CSV to write, with a column for each output of the log and as many rows;
    /// `{parameters}`, a JSON object of values by name. It runs directly, without a shell, several at a time (--threads)
    #[arg(
        long,
        value_name = "COMMAND",
        group = "plant",
        requires = "simulator_parameters"
    )]
    simulator: Option<String>,
    /// Parameters of the program: a JSON file such as {"J": {"value": 0.01, "min": 0.001, "max": 0.1, "unit": "kg.m2"}, "d": 0.02}
    #[arg(long, value_name = "FILE", requires = "simulator")]
    simulator_parameters: Option<PathBuf>,
    /// Stop a run of the program after this time [default: 60]
    #[arg(long, value_name = "SECONDS", requires = "simulator", value_parser = numbers::seconds, allow_negative_numbers = true)]
    simulator_timeout: Option<f64>,
}

impl SimulatorFlags {
    /// Whether a simulator is given.
    pub(crate) fn asked(&self) -> bool {
        self.simulator.is_some()
    }
}

/// Counts the runs on the terminal.
struct Counted {
    command: SimulatorCommand,
    progress: Progress,
}

impl ExternalSimulator for Counted {
    fn simulate(
        &self,
        excitation: &Excitation,
        parameters: &[(String, f64)],
    ) -> Result<Vec<Vec<f64>>, Failure> {
        let answer = self.command.simulate(excitation, parameters);
        self.progress.one_more();
        answer
    }
}

/// Estimates the parameters of `--simulator` from `logs`.
pub(crate) fn run(
    flags: &SimulatorFlags,
    chosen: &StructureFlags,
    logs: &[Source],
    roles: &RoleFlags,
    output: Option<&PathBuf>,
    say: Verbosity,
) -> anyhow::Result<Outcome> {
    let (Some(command), Some(file)) = (&flags.simulator, &flags.simulator_parameters) else {
        anyhow::bail!("--simulator needs --simulator-parameters FILE")
    };
    check_distinct(logs)?;
    let mut read = paths(logs);
    read.push(file);
    let output = output.map(|o| Output::check(o, &read)).transpose()?;
    let parameters = simulator_parameters::read(file)?;
    let roles = kept_missing(roles.clone().roles());
    let read = read_with(&roles, logs, RoleNeed::Identify, say)?;
    let (logs, recordings) = (read.logs, read.known);
    let first = logs
        .first()
        .ok_or_else(|| anyhow::anyhow!("there is no recording"))?;
    for log in &logs[1..] {
        check_same_sampling(&first.name, first.sample_time, &log.name, log.sample_time)?;
        for (what, a, b) in [
            ("inputs", &first.inputs, &log.inputs),
            ("outputs", &first.outputs, &log.outputs),
        ] {
            if names(a) != names(b) {
                anyhow::bail!(
                    "{} has the {what} {}, and {} has {}: name the columns with --inputs and --outputs",
                    first.name,
                    names(a).join(", "),
                    log.name,
                    names(b).join(", ")
                );
            }
        }
    }
    let (inputs, outputs) = (names(&first.inputs), names(&first.outputs));
    let seconds = flags.simulator_timeout.unwrap_or(TIME_LIMIT);
    let command = SimulatorCommand::new(
        command,
        inputs.clone(),
        outputs.clone(),
        Duration::from_secs_f64(seconds),
    )?;
    let text = command.text.clone();
    let counted = Counted {
        command,
        progress: Progress::runs(say.quiet),
    };
    let plant = ExternalPlant::new(
        "Simulator",
        &inputs,
        &outputs,
        &parameters,
        Arc::new(counted),
    );
    let options = EstimateOptions {
        free: chosen.free_parameters(&plant)?,
        hold: Hold::Zero,
        form: Some(Form::FreeRun),
        least_squares: chosen.least_squares(),
    };
    let records: Vec<PlantRecording> = logs.iter().map(PlantRecording::from).collect();
    let estimated = estimate(&plant, &records, &options)?;
    let mut document = PlantDocument::new(&plant, &estimated, options.hold);
    document.fit = plant_fits(&plant, &records, &logs, &estimated, options.hold);
    let count = plant.count();
    document.simulator = Some(SimulatorDocument::new(Some(text), &plant, &estimated));
    document.sample_time = Some(first.sample_time);
    document.recordings = recordings;
    let samples: usize = logs.iter().map(Log::samples).sum();
    drop(plant);
    write_and_tell(
        &document,
        &format!("Simulator from {samples} samples"),
        output.as_ref(),
        None,
        say,
    )?;
    if let Some(error) = count.first_failure.filter(|_| !say.quiet) {
        note(&format!(
            "note: {} of {} runs gave no answer, and their values were not taken; the first: {error}\n",
            count.failed, count.runs
        ));
    }
    Ok(Outcome::Done)
}

fn names(channels: &[Channel]) -> Vec<String> {
    channels.iter().map(|c| c.name.clone()).collect()
}
