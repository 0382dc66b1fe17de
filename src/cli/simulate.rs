//! `innovant simulate`.

use std::path::{Path, PathBuf};

use clap::Args;
use nalgebra::DVector;

use super::flags::{RoleFlags, tell_reading};
use super::plant::{HoldFlag, PlantRun, Start, is_plant_file, simulate_plant};
use super::terminal::{Output, check_distinct, note, paths};
use super::validate::check_sampling;
use super::{Outcome, Verbosity};
use crate::explain::Explanation;
use crate::identify::{IdentifiedChannel, Model};
use crate::log::{
    Channel, Log, Reading, RoleNeed, Roles, Source, check_same_sampling, write_simulation,
};
use crate::report::{is_explanation, parse_explanation, read_model};

/// Samples of a simulation that each state of its start is estimated from.
const SAMPLES_A_STATE: usize = 4;

const EXAMPLE: &str = "Examples:
  innovant simulate model.json input.csv > output.csv
  innovant simulate model.json log.csv --initial-state estimate --output output.csv.gz
  innovant simulate plant.mo input.csv --parameters J=0.02 --output output.csv";

/// Simulate a model on an input, in the units of the recording
///
/// Input columns are found by the names in the model. The outputs are simulated from the inputs alone:
/// y = level + model(u - level), with known delays.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLE)]
pub(super) struct Flags {
    /// Model, as `innovant identify --output` or `innovant explain --output` writes it, or
    /// {"A":..,"B":..,"C":..,"dt":..}, or a plant in equations (.mo)
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// Input: CSV, also gzipped; `-` is standard input
    #[arg(value_name = "INPUT")]
    input: Source,
    #[command(flatten)]
    roles: RoleFlags,
    /// State at the first sample: zero is the operating point; estimate fits it to the recorded outputs, which the input file
    /// must then contain; for a plant in equations also start (the start values of its text) or values by name, as
    /// `w=3,phi=0.1` [default: zero, or where the file of --simulation starts; for a plant in equations start]
    #[arg(long, value_name = "zero|estimate|start|NAME=VALUE")]
    initial_state: Option<String>,
    /// Parameters of a plant in equations: `J=0.02,d=0.1`, or a file that `innovant identify --structure` wrote
    #[arg(long, value_name = "NAME=VALUE|FILE")]
    parameters: Option<String>,
    /// Inputs of a plant in equations between samples [default: zero]
    #[arg(long, value_enum)]
    hold: Option<HoldFlag>,
    /// Output of the original simulator for this input: where it starts, and what an explanation of a simulator that is not
    /// linear adds to
    #[arg(long, value_name = "FILE")]
    simulation: Option<PathBuf>,
    /// Write the outputs to this file, as CSV; `-` is standard output
    #[arg(short, long, value_name = "FILE", default_value = "-")]
    output: PathBuf,
}

impl Flags {
    /// Whether the initial state of a linear model is to be estimated.
    fn estimate(&self) -> anyhow::Result<bool> {
        match self.initial_state.as_deref() {
            None | Some("zero") => Ok(false),
            Some("estimate") => Ok(true),
            Some(other) => anyhow::bail!(
                "--initial-state: `{other}` is for plants in equations; a linear model starts from zero or estimate"
            ),
        }
    }

    /// Where a plant in equations starts.
    fn start(&self) -> Start {
        match self.initial_state.as_deref() {
            None | Some("start") => Start::Text,
            Some("zero") => Start::Zero,
            Some("estimate") => Start::Estimate,
            Some(given) => Start::Given(given.to_owned()),
        }
    }
}

pub(super) fn run(flags: Flags, say: Verbosity) -> anyhow::Result<Outcome> {
    let mut sources = vec![flags.input.clone(), Source::from(flags.model.clone())];
    sources.extend(flags.simulation.iter().cloned().map(Source::from));
    check_distinct(&sources)?;
    let output = Output::check(&flags.output, &paths(&sources))?;
    let name = flags.model.display().to_string();
    if is_plant_file(&flags.model) {
        return simulate_plant::run(
            &PlantRun {
                plant: &flags.model,
                input: &flags.input,
                roles: &flags.roles,
                parameters: flags.parameters.as_deref(),
                start: flags.start(),
                hold: flags.hold.map(Into::into),
                simulation: flags.simulation.as_deref(),
                output: output.path(),
            },
            say,
        );
    }
    if flags.parameters.is_some() || flags.hold.is_some() {
        anyhow::bail!(
            "{name}: --parameters and --hold belong to a plant in equations (a .mo text), and this is none"
        );
    }
    if let Some(explanation) = explanation(&flags.model)? {
        return simulate_explanation(flags, &output, &explanation, say);
    }
    if flags.simulation.is_some() {
        anyhow::bail!(
            "{name}: --simulation belongs to an explanation, and this is a model; leave it out"
        );
    }
    let model = read_model(&flags.model)?.model;
    if model.inputs.is_empty() {
        anyhow::bail!("{name}: this model has no inputs, so there is nothing to simulate");
    }
    let estimate = flags.estimate()?;
    let roles = flags.roles.of_model(&model.inputs, &model.outputs)?;
    let (input, beginning) = read_inputs(&flags.input, &roles, estimate, say)?;
    let log = &input.log;
    check_sampling(&name, &model, log)?;
    if log.input_data.len() != model.inputs.len() {
        // Roles that need not be there are left out when they are not.
        let wanted: Vec<String> = model.inputs.iter().map(|c| c.channel.to_string()).collect();
        anyhow::bail!(
            "{}: the model needs the inputs {}, and not all of them are columns of this file; name them with --inputs",
            log.name,
            wanted.join(", ")
        );
    }
    let inputs: Vec<&[f64]> = log.input_data.iter().map(Vec::as_slice).collect();
    let start = if let Some(beginning) = &beginning {
        Some(initial_state(&model, beginning)?)
    } else {
        None
    };
    if say.verbose {
        let from = start
            .as_ref()
            .map_or("zero".to_owned(), |x0| format!("{:?}", x0.as_slice()));
        note(&format!(
            "{}: {} samples of {} s; initial state {from}\n",
            log.name,
            log.samples(),
            log.sample_time
        ));
    }
    let outputs = model.simulate(&inputs, start.as_ref())?;
    model.check_finite(&outputs, log.start_time)?;
    let columns: Vec<(&Channel, &[f64])> = model
        .outputs
        .iter()
        .map(|c| &c.channel)
        .zip(outputs.iter().map(Vec::as_slice))
        .collect();
    input.write(output.path(), &columns)?;
    Ok(Outcome::Done)
}

/// A recording without gaps; what was recognised in it is said.
fn read(source: &Source, roles: &Roles, need: RoleNeed, say: Verbosity) -> anyhow::Result<Input> {
    let mut reading = Reading::read(source, roles, need)?;
    tell_reading(&source.to_string(), reading.said.as_deref(), say);
    let rows = reading.rows.take();
    Ok(Input {
        log: reading.whole()?,
        rows,
    })
}

/// A recording without gaps, and the times of the rows of its file, where it lies on another grid.
struct Input {
    log: Log,
    rows: Option<Vec<f64>>,
}

impl Input {
    fn write(&self, path: &Path, columns: &[(&Channel, &[f64])]) -> anyhow::Result<()> {
        let grid = (self.log.sample_time, self.log.start_time);
        Ok(write_simulation(path, grid, self.rows.as_deref(), columns)?)
    }
}

/// Inputs without gaps, and where the initial state is to be estimated, the beginning of the recording with its outputs, which may be
/// missing later on.
fn read_inputs(
    source: &Source,
    roles: &Roles,
    estimate: bool,
    say: Verbosity,
) -> anyhow::Result<(Input, Option<Log>)> {
    if !estimate {
        return Ok((read(source, roles, RoleNeed::InputsOnly, say)?, None));
    }
    if !source.can_be_reopened() {
        let input = read(source, roles, RoleNeed::InputsAndMaybeOutputs, say)?;
        let beginning = input.log.clone();
        return Ok((input, Some(beginning)));
    }
    let input = read(source, roles, RoleNeed::InputsOnly, say)?;
    let log = &input.log;
    let parts = Reading::read(source, roles, RoleNeed::InputsAndMaybeOutputs)?;
    let part = parts.logs.into_iter().next();
    let beginning = part.filter(|p| (p.start_time - log.start_time).abs() < 0.5 * log.sample_time);
    let Some(beginning) = beginning else {
        anyhow::bail!(
            "{}: --initial-state estimate needs the outputs of the first rows, and they are missing; cut these rows, or start from \
             --initial-state zero",
            log.name
        );
    };
    if beginning.samples() < log.samples() && !say.quiet {
        note(&format!(
            "{}: the initial state is estimated from the {} samples up to the first one without outputs; all {} are simulated\n",
            log.name,
            beginning.samples(),
            log.samples()
        ));
    }
    Ok((input, Some(beginning)))
}

/// The explanation in `path`, if that is one; `-` and unreadable files are left to the reader of models.
fn explanation(path: &Path) -> anyhow::Result<Option<Explanation>> {
    match std::fs::read_to_string(path) {
        Ok(text) if is_explanation(&text) => {
            Ok(Some(parse_explanation(&path.display().to_string(), &text)?))
        }
        _ => Ok(None),
    }
}

fn simulate_explanation(
    flags: Flags,
    output: &Output,
    explanation: &Explanation,
    say: Verbosity,
) -> anyhow::Result<Outcome> {
    let name = flags.model.display().to_string();
    let Some(model) = &explanation.model else {
        anyhow::bail!("{name}: `model` and `plant` are both missing; explain the recording again");
    };
    let channel = |c: &Channel| IdentifiedChannel {
        channel: c.clone(),
        level: 0.0,
        delay: 0,
    };
    let inputs: Vec<IdentifiedChannel> = model.inputs.iter().map(channel).collect();
    let outputs: Vec<IdentifiedChannel> = model.outputs.iter().map(channel).collect();
    let estimate = flags.estimate()?;
    let roles = flags.roles.of_model(&inputs, &outputs)?;
    let (input, beginning) = read_inputs(&flags.input, &roles, estimate, say)?;
    let log = &input.log;
    check_same_sampling(&name, model.sample_time, &log.name, log.sample_time)?;
    let columns: Vec<&[f64]> = log.input_data.iter().map(Vec::as_slice).collect();
    let start = if let Some(beginning) = &beginning {
        if beginning.output_data.len() != model.outputs.len() {
            anyhow::bail!(
                "{}: --initial-state estimate needs the recorded outputs in this file; name them with --outputs, or start \
                 from --initial-state zero",
                log.name
            );
        }
        let inputs: Vec<&[f64]> = beginning.input_data.iter().map(Vec::as_slice).collect();
        let recorded: Vec<&[f64]> = beginning.output_data.iter().map(Vec::as_slice).collect();
        Some(model.estimate_initial_state(&inputs, &recorded)?)
    } else {
        None
    };
    let simulated = match &flags.simulation {
        Some(file) => {
            let named = Roles {
                outputs: Some(model.outputs.iter().map(|c| c.name.clone()).collect()),
                inputs: None,
                time: None,
                ..roles.clone()
            };
            Some(
                read(
                    &Source::from(file.clone()),
                    &named,
                    RoleNeed::OutputsOnly,
                    say,
                )?
                .log,
            )
        }
        None => None,
    };
    if let Some(simulated) = &simulated
        && simulated.samples() != log.samples()
    {
        anyhow::bail!(
            "{}: {} samples, and {} has {}; simulate exactly this input",
            simulated.name,
            simulated.samples(),
            log.name,
            log.samples()
        );
    }
    // A model of the plant starts where the simulation does; one of the difference between the two starts from zero.
    let start = match (start, &simulated) {
        (None, Some(simulated)) if flags.initial_state.is_none() && model.reference.is_none() => {
            // A simulation has no noise, and goes its own way later.
            let count = log.samples().min(SAMPLES_A_STATE * (model.a.0.nrows() + 1));
            let inputs: Vec<&[f64]> = log.input_data.iter().map(|u| &u[..count]).collect();
            let outputs: Vec<&[f64]> = (simulated.output_data.iter())
                .map(|y| &y[..count])
                .collect();
            Some(model.estimate_initial_state(&inputs, &outputs)?)
        }
        (start, _) => start,
    };
    let correction: Option<Vec<&[f64]>> = simulated
        .as_ref()
        .map(|s| s.output_data.iter().map(Vec::as_slice).collect());
    let outputs = model
        .simulate(&columns, start.as_deref(), correction.as_deref())
        .map_err(|error| anyhow::anyhow!("{name}: {error}"))?;
    let table: Vec<(&Channel, &[f64])> = model
        .outputs
        .iter()
        .zip(outputs.iter().map(Vec::as_slice))
        .collect();
    input.write(output.path(), &table)?;
    Ok(Outcome::Done)
}

fn initial_state(model: &Model, log: &Log) -> anyhow::Result<DVector<f64>> {
    if log.output_data.len() != model.outputs.len() {
        let wanted: Vec<String> = model
            .outputs
            .iter()
            .map(|c| c.channel.to_string())
            .collect();
        anyhow::bail!(
            "{}: --initial-state estimate needs the recorded outputs {} in this file, and they are not all there; \
             name them with --outputs, or start from --initial-state zero",
            log.name,
            wanted.join(", ")
        );
    }
    let inputs: Vec<&[f64]> = log.input_data.iter().map(Vec::as_slice).collect();
    let outputs: Vec<&[f64]> = log.output_data.iter().map(Vec::as_slice).collect();
    Ok(model.initial_state_of(&inputs, &outputs)?)
}
