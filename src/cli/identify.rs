//! `innovant identify`.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;

use super::flags::{ModelFlags, RoleFlags, tell_reading};
use super::plant::{StructureFlags, identify_plant};
use super::simulator::{SimulatorFlags, identify_simulator};
use super::terminal::{Output, Progress, check_distinct, note, paths, print, style};
use super::{Outcome, Verbosity};
use crate::identify::{IdentifyError, Model, Options, Order, on_files};
use crate::log::{Roles, Source};
use crate::report::text::{ModelText, findings, model_text, verdict, wrapped};
use crate::report::{ModelDocument, Request, Watched, identification_page};
use crate::validate::{TestedModel, Validation, identify_and_test};

const EXAMPLE: &str = "Examples:
  innovant identify log.csv                        columns u* are inputs, y* outputs, t is time
  innovant identify log.csv.gz --inputs voltage --outputs speed,current --output model.json
  innovant identify log.csv --report page.html     plots, in one file that opens offline
  innovant identify first.csv second.csv           two experiments with one plant
  innovant identify log.csv --order 2..8           compare orders
  innovant identify log.csv --structure plant.mo --output plant.json    parameters of your own equations
  innovant identify log.csv --simulator 'python3 simulator.py {input} {output} {parameters}' \\
                    --simulator-parameters parameters.json              parameters of another program
  ssh plant cat log.csv | innovant identify - --dt 0.01 --output - | jq .warnings";

/// Identify a state-space model with its uncertainty from recordings
///
/// Order and windows are chosen from the recordings unless you give them. Recordings may be in closed loop. Several
/// recordings are experiments with one plant: same columns, same sampling.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLE)]
pub(super) struct Flags {
    /// Recordings: CSV, also gzipped; `-` is standard input
    #[arg(value_name = "LOG", required = true)]
    logs: Vec<Source>,
    #[command(flatten)]
    roles: RoleFlags,
    #[command(flatten)]
    model: ModelFlags,
    #[command(flatten)]
    plant: StructureFlags,
    #[command(flatten)]
    simulator: SimulatorFlags,
    /// Write the model to this file, as JSON; `-` is standard output (then without the table)
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Write an HTML page with plots to this file: verdict, order, frequency response, poles, step response, residuals and the
    /// recording (for a plant: parameters, recorded and simulated outputs, residuals, equations); `-` is standard output
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
}

/// What is to be done, checked.
struct Plan {
    sources: Vec<Source>,
    roles: Roles,
    options: Options,
    request: Request,
    output: Option<Output>,
    report: Option<Output>,
}

impl Plan {
    fn new(flags: Flags) -> anyhow::Result<Self> {
        check_distinct(&flags.logs)?;
        let read = paths(&flags.logs);
        let (output, report) =
            Output::check_both(flags.output.as_deref(), flags.report.as_deref(), &read)?;
        let (roles, options) = (flags.roles.roles(), flags.model.options());
        Ok(Self {
            sources: flags.logs,
            request: Request::new(&options, &roles),
            roles,
            options,
            output,
            report,
        })
    }
}

pub(super) fn run(flags: Flags, say: Verbosity) -> anyhow::Result<Outcome> {
    if flags.simulator.asked() {
        if flags.report.is_some() {
            anyhow::bail!("--report draws linear models; leave it out with --simulator");
        }
        return identify_simulator::run(
            &flags.simulator,
            &flags.plant,
            &flags.logs,
            &flags.roles,
            flags.output.as_ref(),
            say,
        );
    }
    if flags.plant.asked() {
        return identify_plant::run(
            &flags.plant,
            &flags.logs,
            &flags.roles,
            (flags.output.as_ref(), flags.report.as_ref()),
            say,
        );
    }
    let logs: Vec<String> = flags.logs.iter().map(ToString::to_string).collect();
    let plan = Plan::new(flags)?;
    let progress = Progress::over(&plan.sources, say.quiet);
    let started = Instant::now();
    let with_page = plan.report.is_some();
    let done = on_files(
        &plan.sources,
        &plan.roles,
        Some(progress.callback()),
        &mut |records| {
            // Pictures of the recording are gathered in passing, and only for a page.
            if with_page {
                let mut watched = Watched::new(records);
                let tested = identify_and_test(&mut watched, &plan.options)?;
                Ok((tested, Some(watched.overview())))
            } else {
                Ok((identify_and_test(records, &plan.options)?, None))
            }
        },
    );
    let ((TestedModel { model, tests }, overview), said) =
        done.map_err(|error| with_names(error, &logs))?;
    progress.finish();
    for (name, text) in &said {
        tell_reading(name, Some(text), say);
    }
    if say.verbose {
        for recording in &model.recordings {
            note(&format!(
                "read {}: {} samples from {} s, sha256 {}\n",
                recording.name,
                recording.samples,
                recording.start_time,
                recording.sha256.as_deref().unwrap_or("-")
            ));
        }
        note(&format!(
            "read, fitted and tested in {:.3} s\n",
            started.elapsed().as_secs_f64()
        ));
    }
    let table = |model: &Model, tests: Option<&Validation>| {
        let orders = match &plan.options.order {
            Order::Compare(orders) => orders.as_slice(),
            _ => &[],
        };
        model_text(&ModelText {
            model,
            tests,
            orders,
            style: style(),
        })
    };
    if let Some(output) = &plan.output {
        let document = ModelDocument::new(&model)?
            .with_residual_tests(tests.clone())
            .with_request(plan.request);
        output.write(&document.to_json()?)?;
    }
    if let Some(report) = &plan.report {
        report.write(&identification_page(
            &model,
            tests.as_ref(),
            overview.as_ref(),
        )?)?;
    }
    if say.quiet {
        return Ok(Outcome::Done);
    }
    let files = || [&plan.output, &plan.report].into_iter().flatten();
    if files().any(Output::is_stdout) {
        tell(&model, tests.as_ref());
        return Ok(Outcome::Done);
    }
    print(&table(&model, tests.as_ref()))?;
    for (index, output) in files().enumerate() {
        let gap = if index == 0 { "\n" } else { "" };
        print(&format!("{gap}written to {}\n", output.path().display()))?;
    }
    Ok(Outcome::Done)
}

/// What a person should know when the table goes nowhere.
fn tell(model: &Model, tests: Option<&Validation>) {
    note(&wrapped("", &verdict(model, tests)));
    for warning in model.summary.iter().flat_map(|s| &s.warnings) {
        note(&wrapped("warning: ", warning));
    }
    for finding in tests.iter().flat_map(|t| findings(t)) {
        note(&wrapped("finding: ", &finding));
    }
}

/// Errors of the log module name their file; the others are about the recordings as a whole.
fn with_names(error: IdentifyError, logs: &[String]) -> anyhow::Error {
    match error {
        IdentifyError::Log(error) => error.into(),
        error @ IdentifyError::SameRecording { .. } => error.into(),
        error => {
            let more = match logs.len() {
                0 | 1 => String::new(),
                count => format!(" (and {} more)", count - 1),
            };
            let first = logs.first().map_or("", String::as_str);
            anyhow::anyhow!("{first}{more}: {error}")
        }
    }
}
