//! `innovant explain`.

use std::path::{Path, PathBuf};

use clap::Args;

use super::align::aligned;
use super::flags::{RoleFlags, tell_reading};
use super::plant::{
    HoldFlag, channels, is_plant_file, load, read_recordings, tell_warnings, units_of_logs,
};
use super::terminal::{Output, check_distinct, note, paths, print};
use super::{Outcome, Verbosity};
use crate::explain::{
    Explanation, Hypothesis, Options, PlantOptions, Simulation, Verdict, explain, explain_plant,
};
use crate::log::{Channel, Log, LogError, Reading, RoleNeed, Roles, Source};
use crate::physics::ModelSpec;
use crate::report::text::explanation_text;
use crate::report::{explanation_page, read_model, to_json};

const EXAMPLE: &str = "Examples:
  innovant explain recording.csv --simulation simulated.csv --output explanation.json
  innovant explain recording.csv --simulation model.json --report page.html
  innovant simulate explanation.json new_input.csv --output prediction.csv
  innovant explain recording.csv --simulation plant.mo --hypothesis 'drag: m*der(v) += -c*v*abs(v), c > 0'

The simulation is one of:
  CSV   its outputs for the recorded inputs; one file per recording, in the same order, aligned by time;
        its grid may be finer
  JSON  a linear model, {\"A\":..,\"B\":..,\"C\":..,\"D\":..,\"dt\":..} or what `innovant identify` writes
  .mo   a plant in equations, whose parameters may differ within their bounds

Effects (for --without; `innovant effects` describes them, and lists those of plants in equations):
  coulomb_friction stribeck_friction quadratic_drag cubic_stiffness quadratic_stiffness end_stop hysteresis
  position_dependent_gain input_saturation input_dead_zone input_backlash input_rate_limit input_asymmetry input_delay
  actuator_lag sensor_saturation sensor_offset sensor_drift sensor_rectification sensor_quantization sensor_freeze
  sensor_dropout sensor_outliers sensor_wrap swapped_outputs clock_drift
  periodic_disturbance load_step extra_mode missing_input gain_change stiffness_change mass_change tank_outflow
  orifice_flow overflow radiation state_of_charge gravity_torque valve_stiction input_curve law;
  for drives also cogging direction_dependent_friction

Exit codes: 0 the simulation agrees with the recording; 1 it lacks something; 2 an error.
With --output or --report the exit code is 0 also if it lacks something, unless --exit-code is given.";

/// Say what a simulation leaves out: where it differs from the recording, which physics it lacks, and the evidence
#[derive(Debug, Args)]
#[command(after_help = EXAMPLE)]
pub(super) struct Flags {
    /// Recordings: CSV, also gzipped; `-` is standard input
    #[arg(value_name = "LOG", required = true)]
    logs: Vec<Source>,
    /// Simulated outputs (CSV, one file per recording), a linear model (JSON), or a plant in equations (.mo)
    #[arg(long, value_name = "FILE", required = true, num_args = 1..)]
    simulation: Vec<PathBuf>,
    #[command(flatten)]
    roles: RoleFlags,
    /// Names of simulated outputs that differ from the recorded ones: SIMULATED=RECORDED, comma-separated
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    map: Vec<String>,
    /// Inputs of a plant in equations between samples [default: zero, a zero-order hold]
    #[arg(long, value_enum)]
    hold: Option<HoldFlag>,
    /// Effects to remove from the library, comma-separated ids
    #[arg(long, value_name = "IDS", value_delimiter = ',')]
    without: Vec<String>,
    /// Effects to try, and no others, comma-separated ids; for plants in equations
    #[arg(long, value_name = "IDS", value_delimiter = ',')]
    only: Vec<String>,
    /// A term that a plant in equations may lack, or a file with one per line; can be repeated
    ///
    /// It is fitted beside the library and reported whether it wins or not. NAME: LEFT += EXPRESSION [, BOUND]...: LEFT is a
    /// left-hand side of the plant (`m*der(v)`), a variable, an input or a parameter; `-=` subtracts a term, `=` replaces
    /// the right-hand side. New names in the expression are parameters; bounds are `c > 0`, `0 < c < 3`, a start value is
    /// `c = 0.1`, a unit `c [N.s/m]`. `@FILE` is a file; `#` begins a comment in it.
    #[arg(long, value_name = "TEXT")]
    hypothesis: Vec<String>,
    /// Seed of the bootstrap
    #[arg(long, default_value = "0")]
    seed: u64,
    /// Write the explanation to this file, as JSON
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Write an HTML page with plots to this file
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Exit with 1 if the simulation lacks something, also with --output or --report
    #[arg(long)]
    exit_code: bool,
}

pub(super) fn run(flags: Flags, say: Verbosity) -> anyhow::Result<Outcome> {
    let mut sources = flags.logs.clone();
    sources.extend(flags.simulation.iter().cloned().map(Source::from));
    check_distinct(&sources)?;
    let read = paths(&sources);
    let (output, report) =
        Output::check_both(flags.output.as_deref(), flags.report.as_deref(), &read)?;
    if let Some(plant) = flags.simulation.iter().find(|f| is_plant_file(f)) {
        let explanation = of_plant(&flags, plant, say)?;
        return tell(&flags, &explanation, output.as_ref(), report.as_ref(), say);
    }
    if flags.hold.is_some() {
        anyhow::bail!(
            "--hold belongs to a plant in equations (a .mo text), and the simulation is none"
        );
    }
    if !flags.hypothesis.is_empty() {
        anyhow::bail!(
            "--hypothesis needs a plant in equations (a .mo text) as the simulation: a column of outputs or a linear model \
             has no equation that a term could enter"
        );
    }
    if !flags.only.is_empty() {
        anyhow::bail!(
            "--only belongs to a plant in equations (a .mo text), and the simulation is none; --without takes effects out"
        );
    }
    let roles = flags.roles.clone().roles();
    let mut readings: Vec<Reading> = Vec::with_capacity(flags.logs.len());
    // Columns may be those of a free decay; a linear model has inputs.
    let need = match flags.simulation.iter().any(|f| is_json(f)) {
        true => RoleNeed::Identify,
        false => RoleNeed::OutputsAndMaybeInputs,
    };
    for source in &flags.logs {
        let reading = Reading::read(source, &roles, need)?;
        tell_reading(&source.to_string(), reading.said.as_deref(), say);
        if let (Some(first), Some(log)) = (
            readings.first().and_then(|r| r.logs.first()),
            reading.logs.first(),
        ) {
            first.check_same_kind(log)?;
        }
        readings.push(reading);
    }
    let (logs, simulation) = simulation(&flags, readings, &roles, say)?;
    let options = Options {
        without: flags.without.clone(),
        seed: flags.seed,
    };
    let explanation = explain(&logs, &simulation, &options)?;
    tell(&flags, &explanation, output.as_ref(), report.as_ref(), say)
}

/// What a plant in equations leaves out.
fn of_plant(flags: &Flags, plant: &Path, say: Verbosity) -> anyhow::Result<Explanation> {
    if flags.simulation.len() > 1 {
        anyhow::bail!(
            "--simulation takes one plant in equations for all recordings; {} files are given",
            flags.simulation.len()
        );
    }
    if !flags.map.is_empty() {
        anyhow::bail!(
            "--map is not available with a plant in equations: name the columns of the recording as the text does"
        );
    }
    let mut loaded = load(plant)?;
    // The answer begins with what it says of units of time.
    let clock = loaded.clock.take();
    tell_warnings(&loaded, say);
    let at_values = loaded.plant.with_values(&loaded.point.parameters);
    let (logs, recordings) = read_recordings(
        &at_values,
        &flags.logs,
        &flags.roles,
        RoleNeed::Identify,
        say,
    )?;
    let options = PlantOptions {
        hold: flags.hold.map_or(loaded.hold, Into::into),
        only: flags.only.clone(),
        without: flags.without.clone(),
        hypotheses: hypotheses(&flags.hypothesis, &at_values.spec)?,
    };
    let mut explanation = explain_plant(&at_values, &logs, recordings, &options)
        .map_err(|e| anyhow::anyhow!("{}: {e}", plant.display()))?;
    // What may make the whole answer wrong comes first.
    let units = units_of_logs(&at_values.spec, &channels(&at_values), &logs)?;
    let doubts = clock.into_iter().chain(units);
    let doubts: Vec<String> = doubts.map(|d| format!("Warning: {d}.")).collect();
    explanation.summary.splice(0..0, doubts);
    Ok(explanation)
}

/// Reads hypotheses, given as they are or in files.
fn hypotheses(given: &[String], spec: &ModelSpec) -> anyhow::Result<Vec<Hypothesis>> {
    let mut all = Vec::new();
    for text in given {
        let file = text.strip_prefix('@').map(Path::new);
        let Some(file) = file.or_else(|| Some(Path::new(text)).filter(|p| p.is_file())) else {
            let read = Hypothesis::parse(text, spec);
            all.push(read.map_err(|e| anyhow::anyhow!(e.render("--hypothesis")))?);
            continue;
        };
        let name = file.display();
        let lines = std::fs::read_to_string(file)
            .map_err(|e| anyhow::anyhow!("--hypothesis {name}: cannot be read: {e}"))?;
        let before = all.len();
        for (i, line) in lines.lines().enumerate() {
            let line = line.split('#').next().unwrap_or("").trim_end();
            if line.trim().is_empty() {
                continue;
            }
            let read = Hypothesis::parse(line, spec);
            let origin = format!("{name}, line {}", i + 1);
            all.push(read.map_err(|e| anyhow::anyhow!(e.render(&origin)))?);
        }
        if all.len() == before {
            anyhow::bail!("--hypothesis {name}: the file has no hypothesis; write one a line");
        }
    }
    Ok(all)
}

/// Writes and prints the explanation.
fn tell(
    flags: &Flags,
    explanation: &Explanation,
    output: Option<&Output>,
    report: Option<&Output>,
    say: Verbosity,
) -> anyhow::Result<Outcome> {
    if let Some(output) = output {
        output.write(&to_json(explanation)?)?;
    }
    if let Some(report) = report {
        report.write(&explanation_page(explanation)?)?;
    }
    let to_stdout = [output, report]
        .into_iter()
        .flatten()
        .any(Output::is_stdout);
    if !say.quiet {
        let text = explanation_text(explanation);
        if to_stdout {
            note(&text);
        } else {
            print(&text)?;
        }
    }
    let asked = flags.exit_code || (flags.output.is_none() && flags.report.is_none());
    Ok(if asked && missing(explanation) {
        Outcome::Rejected
    } else {
        Outcome::Done
    })
}

fn is_json(path: &Path) -> bool {
    path.extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("json"))
}

/// Whether the simulation lacks something.
fn missing(explanation: &Explanation) -> bool {
    !matches!(explanation.verdict, Verdict::Consistent)
}

/// The recordings, and the simulation on the samples that they have in common.
fn simulation(
    flags: &Flags,
    readings: Vec<Reading>,
    roles: &Roles,
    say: Verbosity,
) -> anyhow::Result<(Vec<Log>, Simulation)> {
    let files = &flags.simulation;
    if files.iter().any(|f| is_json(f)) {
        if let [file] = files.as_slice() {
            let model = read_model(file)?.model;
            let logs = readings.into_iter().flat_map(|r| r.logs).collect();
            let simulation = Simulation::Model(Box::new(model), file.display().to_string());
            return Ok((logs, simulation));
        }
        anyhow::bail!(
            "--simulation takes one model (JSON) for all recordings, or one CSV a recording; {} files are given, and one \
             of them is JSON",
            files.len()
        );
    }
    if files.len() != readings.len() {
        anyhow::bail!(
            "{} recordings and {} simulations: give one CSV of simulated outputs for each recording, in the same order",
            readings.len(),
            files.len()
        );
    }
    let (mut logs, mut outputs) = (Vec::new(), Vec::new());
    for (file, reading) in files.iter().zip(&readings) {
        let simulated = simulated(file, reading, roles, &flags.map)?;
        let (pairs, said) = aligned(reading, &simulated)?;
        let name = file.display().to_string();
        tell_reading(&name, simulated.said.as_deref(), say);
        tell_reading(&name, said.as_deref(), say);
        for (log, simulation) in pairs {
            logs.push(log);
            outputs.push(simulation);
        }
    }
    Ok((logs, Simulation::Outputs(outputs)))
}

/// Simulated outputs, by the names that the recording has for them or that `map` (simulated=recorded) gives them.
fn simulated(
    file: &Path,
    recording: &Reading,
    roles: &Roles,
    map: &[String],
) -> anyhow::Result<Reading> {
    let source = Source::from(file.to_owned());
    let recorded: Vec<Channel> = recording
        .logs
        .first()
        .map_or_else(Vec::new, |log| log.outputs.clone());
    let mut wanted: Vec<String> = recorded.iter().map(|c| c.name.clone()).collect();
    for pair in map {
        let Some((from, to)) = pair.split_once('=') else {
            anyhow::bail!("--map {pair}: write it as SIMULATED=RECORDED, such as `--map y9=y1`");
        };
        let to = Channel::parse(to);
        let Some(at) = recorded.iter().position(|c| c.name == to.name) else {
            let names: Vec<String> = recorded.iter().map(|c| format!("`{c}`")).collect();
            anyhow::bail!(
                "--map {pair}: the recording has no output `{to}`; its outputs are {}",
                names.join(", ")
            );
        };
        wanted[at] = from.trim().to_owned();
    }
    let named = |time: Option<String>| Roles {
        inputs: None,
        outputs: Some(wanted.clone()),
        time,
        ..roles.clone()
    };
    let read = |time: Option<String>| Reading::read(&source, &named(time), RoleNeed::OutputsOnly);
    let mut found = read(roles.time.clone());
    // The time column of a simulator may have a name of its own.
    if let Err(LogError::UnknownColumn { column, .. }) = &found
        && Some(column) == roles.time.as_ref()
    {
        found = read(None);
    }
    match found {
        Err(LogError::UnknownColumn {
            name,
            headers,
            column,
            ..
        }) if wanted.contains(&column) => {
            let names: Vec<String> = recorded.iter().map(|c| format!("`{c}`")).collect();
            let missing = wanted.iter().position(|w| *w == column);
            let missing = missing
                .and_then(|at| recorded.get(at))
                .map_or("y1", |c| c.name.as_str());
            anyhow::bail!(
                "{name}: no simulated output `{column}`: the recording's outputs are {}, and the columns of the simulation \
                 are {headers}; rename one, or say which is which: `--map 'SIMULATED={missing}'`",
                names.join(", ")
            )
        }
        found => Ok(found?),
    }
}
