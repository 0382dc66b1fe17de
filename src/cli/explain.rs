//! `innovant explain`.

use std::path::{Path, PathBuf};

use clap::Args;

use super::output::{Output, check_distinct, note, paths, print};
use super::roles::RoleFlags;
use super::{Outcome, Verbosity};
use crate::explain::{Explanation, Options, Simulation, Verdict, explain};
use crate::log::{Log, RoleNeed, Roles, Source};
use crate::report::text::explanation_text;
use crate::report::{explanation_page, read_model, to_json};

const EXAMPLE: &str = "Examples:
  innovant explain recording.csv --simulation simulated.csv --output explanation.json
  innovant explain recording.csv --simulation model.json --report page.html
  innovant simulate explanation.json new_input.csv --output prediction.csv

The simulation is a CSV of its outputs on the recorded inputs (one file a recording, in the same order), or one linear
model as JSON ({\"A\":..,\"B\":..,\"C\":..,\"D\":..,\"dt\":..}, or what `innovant identify` writes).

Effects (for --without):
  coulomb_friction stribeck_friction quadratic_drag cubic_stiffness quadratic_stiffness end_stop hysteresis
  position_dependent_gain input_saturation input_dead_zone input_backlash input_rate_limit input_asymmetry input_delay
  actuator_lag sensor_saturation sensor_offset sensor_drift sensor_rectification sensor_quantization sensor_freeze
  sensor_dropout sensor_outliers sensor_wrap swapped_outputs clock_drift
  periodic_disturbance load_step extra_mode missing_input gain_change stiffness_change tank_outflow overflow;
  of drives also cogging direction_dependent_friction

Exit codes: 0 the simulation agrees with the recording; 1 something is missing in it; 2 an error.
With --output or --report the exit code is 0 whatever was found, unless --exit-code is given.";

/// Say what a simulation leaves out: where it differs from the recording, which physics is missing, and the proof
#[derive(Debug, Args)]
#[command(after_help = EXAMPLE)]
pub(super) struct Flags {
    /// Recordings: CSV, also gzipped; `-` is standard input
    #[arg(value_name = "LOG", required = true)]
    logs: Vec<Source>,
    /// Simulated outputs (CSV, one file a recording) or a linear model (JSON)
    #[arg(long, value_name = "FILE", required = true, num_args = 1..)]
    simulation: Vec<PathBuf>,
    #[command(flatten)]
    roles: RoleFlags,
    /// Leave effects out of the library, comma-separated ids
    #[arg(long, value_name = "IDS", value_delimiter = ',')]
    without: Vec<String>,
    /// Seed of the bootstrap
    #[arg(long, default_value = "0")]
    seed: u64,
    /// Write the explanation to this file, as JSON
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Write a page with pictures to this file, as HTML
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Exit with 1 when something is missing in the simulation, also with --output or --report
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
    let roles = flags.roles.roles();
    let mut logs: Vec<Log> = Vec::with_capacity(flags.logs.len());
    for source in &flags.logs {
        let log = Log::read(source, &roles)?;
        if let Some(first) = logs.first() {
            first.check_same_kind(&log)?;
        }
        logs.push(log);
    }
    let simulation = simulation(&flags.simulation, &logs, &roles)?;
    let options = Options {
        without: flags.without.clone(),
        seed: flags.seed,
    };
    let explanation = explain(&logs, &simulation, &options)?;
    if let Some(output) = &output {
        output.write(&to_json(&explanation)?)?;
    }
    if let Some(report) = &report {
        report.write(&explanation_page(&explanation)?)?;
    }
    let to_stdout = [&output, &report]
        .into_iter()
        .flatten()
        .any(Output::is_stdout);
    if !say.quiet {
        let text = explanation_text(&explanation);
        if to_stdout {
            note(&text);
        } else {
            print(&text)?;
        }
    }
    let asked = flags.exit_code || (flags.output.is_none() && flags.report.is_none());
    Ok(if asked && missing(&explanation) {
        Outcome::Rejected
    } else {
        Outcome::Done
    })
}

/// Whether the simulation lacks something.
fn missing(explanation: &Explanation) -> bool {
    !matches!(explanation.verdict, Verdict::Consistent)
}

fn simulation(files: &[PathBuf], logs: &[Log], roles: &Roles) -> anyhow::Result<Simulation> {
    let is_json = |path: &Path| {
        path.extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("json"))
    };
    if files.iter().any(|f| is_json(f)) {
        if let [file] = files {
            let model = read_model(file)?.model;
            return Ok(Simulation::Model(
                Box::new(model),
                file.display().to_string(),
            ));
        }
        anyhow::bail!(
            "--simulation takes one model (JSON) for all recordings, or one CSV a recording; {} files are given, and one \
             of them is JSON",
            files.len()
        );
    }
    if files.len() != logs.len() {
        anyhow::bail!(
            "{} recordings and {} simulations: give one CSV of simulated outputs for each recording, in the same order",
            logs.len(),
            files.len()
        );
    }
    files
        .iter()
        .zip(logs)
        .map(|(file, log)| simulated(file, log, roles))
        .collect::<anyhow::Result<Vec<Log>>>()
        .map(Simulation::Outputs)
}

/// Simulated outputs: by the recording's names where the file has them, else by its own headers.
pub(super) fn simulated(file: &Path, log: &Log, roles: &Roles) -> anyhow::Result<Log> {
    let source = Source::from(file.to_owned());
    let named = Roles {
        inputs: None,
        outputs: Some(log.outputs.iter().map(|c| c.name.clone()).collect()),
        ..roles.clone()
    };
    match Log::read_with(&source, &named, RoleNeed::OutputsOnly) {
        Ok(found) => Ok(found),
        Err(first) => {
            let own = Roles {
                outputs: None,
                inputs: None,
                ..roles.clone()
            };
            Log::read_with(&source, &own, RoleNeed::OutputsOnly).map_err(|_| first.into())
        }
    }
}
