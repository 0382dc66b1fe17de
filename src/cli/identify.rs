//! `innovant identify`.

use std::path::PathBuf;
use std::time::Instant;

use clap::{Args, ValueEnum};

use super::deviations::{Deviations, judge};
use super::numbers::{self, Window};
use super::output::{Output, check_distinct, note, paths, print};
use super::progress::Progress;
use super::roles::RoleFlags;
use super::terminal::style;
use super::{Outcome, Verbosity};
use crate::identify::{
    CovarianceKind, FileRecords, IdentifyError, Method, Model, Options, Order, Polish, Records,
    Stochastic, Weight, identify_records,
};
use crate::log::{Roles, Source};
use crate::moments::Detrend;
use crate::report::text::{ModelText, findings, model_text, verdict, wrapped};
use crate::report::{ModelDocument, Watched, identification_page};
use crate::validate::{Relation, Validation};

const EXAMPLE: &str = "Examples:
  innovant identify log.csv                        columns u* are inputs, y* outputs, t is time
  innovant identify log.csv.gz --inputs voltage --outputs speed,current --output model.json
  innovant identify log.csv --report page.html     pictures, in one file that opens offline
  innovant identify first.csv second.csv           two experiments of one plant
  innovant identify log.csv --order 2..8           compare orders
  ssh plant cat log.csv | innovant identify - --dt 0.01 --output - | jq .warnings";

/// Identify a state-space model with its uncertainty from recordings
///
/// Order and windows are chosen from the recordings unless given. Recordings may be in closed loop. Several are
/// experiments of one plant: same columns, same sampling.
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
    /// Threads [default: as many as there are cores]
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
    /// Write the model to this file, as JSON; `-` is standard output (then without the table)
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Write a page to this file, as HTML: verdict, order, frequency response, poles, step response, residuals and the
    /// recording, with pictures; `-` is standard output
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Model")]
struct ModelFlags {
    /// Order: auto, N, or several to compare: 2,4,6 or 2..8 (8 included)
    #[arg(long, default_value = "auto", value_parser = numbers::order, allow_negative_numbers = true)]
    order: Order,
    /// Past window in samples: auto or P
    #[arg(long, default_value = "auto", value_parser = numbers::window, allow_negative_numbers = true)]
    past: Window,
    /// Future window in samples (for pbsid-opt at most the past one): auto or F
    #[arg(long, default_value = "auto", value_parser = numbers::window, allow_negative_numbers = true)]
    future: Window,
    /// Algorithm
    #[arg(long, value_enum, default_value = "pbsid-opt")]
    method: Method,
    /// Step that estimates K in the place of the method's own
    #[arg(long, value_enum)]
    stochastic: Option<Stochastic>,
    /// Weight of the singular value decomposition [default: what suits the method]
    #[arg(long, value_enum)]
    weight: Option<WeightFlag>,
    /// Polish to maximum likelihood: auto does for pbsid-opt, when the past window is long enough for it
    #[arg(long, value_enum, default_value = "auto")]
    polish: PolishFlag,
    /// Covariance: from the model, or robust against a model that is not right (from blocks of the data)
    #[arg(long, value_enum, default_value = "model")]
    covariance: CovarianceFlag,
    /// What is taken out of each channel first
    #[arg(long, value_enum, default_value = "mean")]
    detrend: DetrendFlag,
    /// Estimate D: an input acts on an output in the same sample
    #[arg(long)]
    feedthrough: bool,
    /// Known delay of the inputs in samples: one for all, or one for each
    #[arg(
        long,
        value_name = "D[,D..]",
        value_delimiter = ',',
        allow_negative_numbers = true
    )]
    delay: Vec<u32>,
    /// A stable model, guaranteed; the summary says what it cost
    #[arg(long)]
    stable: bool,
    /// Seed of random draws
    #[arg(long, default_value_t = 0)]
    seed: u64,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum WeightFlag {
    Identity,
    Cva,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum PolishFlag {
    Auto,
    Always,
    Never,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum CovarianceFlag {
    Model,
    Robust,
}

/// What is taken out of each channel.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum DetrendFlag {
    Mean,
    Linear,
    None,
}

impl ModelFlags {
    fn options(self) -> Options {
        Options {
            method: self.method,
            stochastic: self.stochastic,
            order: self.order,
            past: self.past.0,
            future: self.future.0,
            weight: self.weight.map(|weight| match weight {
                WeightFlag::Identity => Weight::Identity,
                WeightFlag::Cva => Weight::Cva,
            }),
            polish: match self.polish {
                PolishFlag::Auto => Polish::Auto,
                PolishFlag::Always => Polish::Always,
                PolishFlag::Never => Polish::Never,
            },
            covariance: match self.covariance {
                CovarianceFlag::Model => CovarianceKind::Model,
                CovarianceFlag::Robust => CovarianceKind::Robust,
            },
            detrend: match self.detrend {
                DetrendFlag::Mean => Detrend::Mean,
                DetrendFlag::Linear => Detrend::Linear,
                DetrendFlag::None => Detrend::None,
            },
            feedthrough: self.feedthrough,
            input_delay: self.delay.iter().map(|d| *d as usize).collect(),
            stable: self.stable,
            seed: self.seed,
        }
    }
}

/// What is to be done, checked.
struct Plan {
    sources: Vec<Source>,
    roles: Roles,
    options: Options,
    output: Option<Output>,
    report: Option<Output>,
}

impl Plan {
    fn new(flags: Flags) -> anyhow::Result<Self> {
        check_distinct(&flags.logs)?;
        let read = paths(&flags.logs);
        let (output, report) =
            Output::check_both(flags.output.as_deref(), flags.report.as_deref(), &read)?;
        if let Some(threads) = flags.threads {
            rayon::ThreadPoolBuilder::new()
                .num_threads(threads.into())
                .build_global()?;
        }
        Ok(Self {
            sources: flags.logs,
            roles: flags.roles.roles(),
            options: flags.model.options(),
            output,
            report,
        })
    }
}

pub(super) fn run(flags: Flags, say: Verbosity) -> anyhow::Result<Outcome> {
    let logs: Vec<String> = flags.logs.iter().map(ToString::to_string).collect();
    let plan = Plan::new(flags)?;
    let progress = Progress::over(&plan.sources, say.quiet);
    let started = Instant::now();
    let mut records =
        FileRecords::open(plan.sources, plan.roles)?.with_progress(progress.callback());
    // Pictures of the recording are gathered in passing, and only for a page.
    let mut watched = match &plan.report {
        Some(_) => Reading::Watched(Watched::new(&mut records)),
        None => Reading::Plain(&mut records),
    };
    let mut model = identify_records(watched.records(), &plan.options)
        .map_err(|error| with_names(error, &logs))?;
    check_recorded_once(&model)?;
    let fitted = started.elapsed();
    let tests = test(watched.records(), &mut model)?;
    progress.finish();
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
            "read and fitted in {:.3} s, residuals tested in {:.3} s\n",
            fitted.as_secs_f64(),
            (started.elapsed() - fitted).as_secs_f64()
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
        let document = ModelDocument::new(&model)?.with_residual_tests(tests.clone());
        output.write(&document.to_json()?)?;
    }
    if let (Some(report), Reading::Watched(watched)) = (&plan.report, &watched) {
        let overview = watched.overview();
        report.write(&identification_page(
            &model,
            tests.as_ref(),
            Some(&overview),
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

/// Recordings, watched for a page or not.
enum Reading<'a> {
    Plain(&'a mut dyn Records),
    Watched(Watched<'a>),
}

impl Reading<'_> {
    fn records(&mut self) -> &mut dyn Records {
        match self {
            Self::Plain(records) => *records,
            Self::Watched(watched) => watched,
        }
    }
}

/// The residual tests; what they say against the model as a whole becomes one of its warnings.
fn test(records: &mut dyn Records, model: &mut Model) -> anyhow::Result<Option<Validation>> {
    let deviations = Deviations::of_records(records, model)?;
    match judge(model, &deviations, Relation::Estimation, None) {
        Ok(tests) => {
            let feedback = tests.feedback.as_ref();
            if let Some(summary) = &mut model.summary
                && summary.options.feedthrough
                && feedback.is_some_and(|test| test.p_value < tests.level)
            {
                summary.warnings.push(
                    "the recording was taken in closed loop: D is only right when the controller acts with a \
                     delay; leave out --feedthrough when it does not"
                        .to_owned(),
                );
            }
            Ok(Some(tests))
        }
        Err(reason) => {
            if let Some(summary) = &mut model.summary {
                summary
                    .warnings
                    .push(format!("the residuals were not tested: {reason}"));
            }
            Ok(None)
        }
    }
}

/// Two files may be copies of one.
fn check_recorded_once(model: &Model) -> anyhow::Result<()> {
    for (index, recording) in model.recordings.iter().enumerate() {
        let copy = model.recordings[..index]
            .iter()
            .find(|other| other.sha256.is_some() && other.sha256 == recording.sha256);
        if let Some(copy) = copy {
            anyhow::bail!(
                "{} and {} hold the same bytes: their noise would count as twice the information; name each \
                 recording once",
                copy.name,
                recording.name
            );
        }
    }
    Ok(())
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
