//! `innovant identify --structure`: the parameters of a plant in equations.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::load_plant::{load, read_recordings, tell_warnings};
use crate::cli::flags::RoleFlags;
use crate::cli::terminal::{Output, check_distinct, paths, print, style};
use crate::cli::{Outcome, Verbosity};
use crate::log::{Log, RoleNeed, Source, check_same_sampling};
use crate::physics::estimate::{EstimateOptions, Form, PlantRecording, estimate, evaluate};
use crate::physics::{Hold, ModelSpec, Plant, Simulated};
use crate::report::text::plant_estimate_text;
use crate::report::{PlantDocument, plant_fits, plant_page};

/// A plant in equations.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Plant in equations")]
pub(crate) struct StructureFlags {
    /// Estimate the parameters of this plant (Modelica text), instead of a linear model
    #[arg(long, value_name = "PLANT", group = "plant")]
    structure: Option<PathBuf>,
    /// Parameters to keep at the value of the text (or of --simulator-parameters), comma-separated
    #[arg(
        long,
        value_name = "NAMES",
        value_delimiter = ',',
        requires = "plant",
        conflicts_with = "free"
    )]
    fix: Vec<String>,
    /// Parameters to estimate, and no others, comma-separated
    #[arg(long, value_name = "NAMES", value_delimiter = ',', requires = "plant")]
    free: Vec<String>,
    /// Inputs between samples
    #[arg(long, value_enum, requires = "structure", conflicts_with = "simulator")]
    hold: Option<HoldFlag>,
    /// Noise at the outputs (free-run: output error), or in the states (innovation: an observer predicts from sample to sample)
    /// [default: the one with the lower BIC]
    #[arg(long, value_enum, requires = "structure", conflicts_with = "simulator")]
    form: Option<FormFlag>,
    /// Fit the output error by least squares, as if it were white: the closest fit to the recording, but the standard deviations
    /// are too small if the output error is not white
    #[arg(long, requires = "plant", conflicts_with = "form")]
    least_squares: bool,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum HoldFlag {
    /// Constant until the next sample (zero-order hold) [default]
    Zero,
    /// Linearly interpolated to the next sample
    Linear,
}

impl From<HoldFlag> for Hold {
    fn from(flag: HoldFlag) -> Self {
        match flag {
            HoldFlag::Zero => Self::Zero,
            HoldFlag::Linear => Self::Linear,
        }
    }
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum FormFlag {
    FreeRun,
    Innovation,
}

impl StructureFlags {
    /// Whether a plant is to be estimated.
    pub(crate) fn asked(&self) -> bool {
        self.structure.is_some()
    }

    /// Whether noise is taken as white.
    pub(crate) fn least_squares(&self) -> bool {
        self.least_squares
    }

    /// Which parameters are free.
    pub(crate) fn free_parameters(&self, plant: &dyn Simulated) -> anyhow::Result<Vec<bool>> {
        free(plant.spec(), self)
    }
}

/// Estimates the plant of `--structure` from `logs`.
pub(crate) fn run(
    flags: &StructureFlags,
    logs: &[Source],
    roles: &RoleFlags,
    (output, report): (Option<&PathBuf>, Option<&PathBuf>),
    say: Verbosity,
) -> anyhow::Result<Outcome> {
    let Some(structure) = &flags.structure else {
        anyhow::bail!("--structure names no plant")
    };
    check_distinct(logs)?;
    let mut read = paths(logs);
    read.push(structure);
    let (output, report) = Output::check_both(
        output.map(PathBuf::as_path),
        report.map(PathBuf::as_path),
        &read,
    )?;
    let loaded = load(structure)?;
    tell_warnings(&loaded, say);
    let plant = &loaded.plant;
    let hold = flags.hold.map_or(loaded.hold, Hold::from);
    let options = EstimateOptions {
        free: flags.free_parameters(plant)?,
        hold,
        form: flags.form.map(|f| match f {
            FormFlag::FreeRun => Form::FreeRun,
            FormFlag::Innovation => Form::Innovation,
        }),
        least_squares: flags.least_squares,
    };
    let (logs, recordings) = read_recordings(plant, logs, roles, RoleNeed::Identify, say)?;
    for log in logs.iter().skip(1) {
        check_same_sampling(
            &logs[0].name,
            logs[0].sample_time,
            &log.name,
            log.sample_time,
        )?;
    }
    let records: Vec<PlantRecording> = logs.iter().map(PlantRecording::from).collect();
    let estimated = estimate(plant, &records, &options)
        .map_err(|e| anyhow::anyhow!("{}: {e}", structure.display()))?;
    let mut document = PlantDocument::new(plant, &estimated, hold);
    document.fit = plant_fits(plant, &records, &logs, &estimated, hold);
    document.sample_time = logs.first().map(|l| l.sample_time);
    document.recordings = recordings;
    let samples: usize = logs.iter().map(Log::samples).sum();
    let title = format!("{} from {samples} samples", plant.spec.name);
    let drawn = match &report {
        Some(report) => Some((report, page(plant, &document, &records)?)),
        None => None,
    };
    write_and_tell(&document, &title, output.as_ref(), drawn, say)?;
    Ok(Outcome::Done)
}

/// Writes the document and the page, and says what was estimated.
pub(crate) fn write_and_tell(
    document: &PlantDocument,
    title: &str,
    output: Option<&Output>,
    page: Option<(&Output, String)>,
    say: Verbosity,
) -> anyhow::Result<()> {
    if let Some(output) = output {
        output.write(&document.to_json()?)?;
    }
    if let Some((report, page)) = &page {
        report.write(page)?;
    }
    let files = || output.into_iter().chain(page.as_ref().map(|p| p.0));
    if say.quiet || files().any(Output::is_stdout) {
        return Ok(());
    }
    print(&plant_estimate_text(document, title, style()))?;
    for (index, output) in files().enumerate() {
        let gap = if index == 0 { "\n" } else { "" };
        print(&format!("{gap}written to {}\n", output.path().display()))?;
    }
    Ok(())
}

/// The page of an estimated plant.
fn page(
    plant: &Plant,
    document: &PlantDocument,
    records: &[PlantRecording],
) -> anyhow::Result<String> {
    let (_, point) = document.plant().map_err(anyhow::Error::msg)?;
    let found = evaluate(plant, records, &document.held_with_starts(plant, &point))?;
    Ok(plant_page(plant, document, records, &found)?)
}

/// Which parameters are free.
fn free(spec: &ModelSpec, flags: &StructureFlags) -> anyhow::Result<Vec<bool>> {
    let names: Vec<&str> = spec
        .parameters()
        .into_iter()
        .map(|v| spec.variable(v).name.as_str())
        .collect();
    for (flag, asked) in [("--fix", &flags.fix), ("--free", &flags.free)] {
        if let Some(name) = asked.iter().find(|n| !names.contains(&n.as_str())) {
            anyhow::bail!(
                "{flag}: the plant has no parameter `{name}` that may be estimated; it has {}",
                names.join(", ")
            );
        }
    }
    let named = |list: &[String], name: &str| list.iter().any(|n| n == name);
    Ok(names
        .iter()
        .map(|name| {
            if flags.free.is_empty() {
                !named(&flags.fix, name)
            } else {
                named(&flags.free, name)
            }
        })
        .collect())
}
