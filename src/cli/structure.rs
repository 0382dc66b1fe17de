//! `innovant identify --structure`: the parameters of a plant in equations.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::output::{Output, check_distinct, paths, print};
use super::plant::{load, read_recordings, recording};
use super::roles::RoleFlags;
use super::terminal::style;
use super::{Outcome, Verbosity};
use crate::identify::{Options, identify};
use crate::log::{Log, RoleNeed, Source, check_same_sampling};
use crate::physics::estimate::{EstimateOptions, Form, PlantEstimate, PlantRecording, estimate};
use crate::physics::{Excitation, Hold, Plant};
use crate::report::text::plant_estimate_text;
use crate::report::{FitDocument, PlantDocument};

/// A plant in equations.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Plant in equations")]
pub(super) struct StructureFlags {
    /// Estimate the parameters of this plant (Modelica text) instead of a linear model
    #[arg(long, value_name = "PLANT")]
    structure: Option<PathBuf>,
    /// Parameters that keep the value of the text, comma-separated
    #[arg(
        long,
        value_name = "NAMES",
        value_delimiter = ',',
        requires = "structure",
        conflicts_with = "free"
    )]
    fix: Vec<String>,
    /// Only these parameters are estimated
    #[arg(
        long,
        value_name = "NAMES",
        value_delimiter = ',',
        requires = "structure"
    )]
    free: Vec<String>,
    /// Inputs between samples
    #[arg(long, value_enum, requires = "structure")]
    hold: Option<HoldFlag>,
    /// Noise at the outputs (free-run), or in the states (innovation: an observer predicts from sample to sample) [default: the
    /// likelier]
    #[arg(long, value_enum, requires = "structure")]
    form: Option<FormFlag>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum HoldFlag {
    /// Constant until the next sample [default]
    Zero,
    /// On a straight line to the next sample
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
    pub fn asked(&self) -> bool {
        self.structure.is_some()
    }
}

/// Estimates the plant of `--structure` from `logs`.
pub(super) fn run(
    flags: &StructureFlags,
    logs: &[Source],
    roles: &RoleFlags,
    output: Option<&PathBuf>,
    say: Verbosity,
) -> anyhow::Result<Outcome> {
    let Some(structure) = &flags.structure else {
        anyhow::bail!("--structure names no plant")
    };
    check_distinct(logs)?;
    let mut read = paths(logs);
    read.push(structure);
    let output = output.map(|o| Output::check(o, &read)).transpose()?;
    let loaded = load(structure)?;
    let plant = &loaded.plant;
    let hold = flags.hold.map_or(loaded.hold, Hold::from);
    let options = EstimateOptions {
        free: free(plant, flags)?,
        hold,
        form: flags.form.map(|f| match f {
            FormFlag::FreeRun => Form::FreeRun,
            FormFlag::Innovation => Form::Innovation,
        }),
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
    let records: Vec<PlantRecording> = logs.iter().map(recording).collect();
    let estimated = estimate(plant, &records, &options)
        .map_err(|e| anyhow::anyhow!("{}: {e}", structure.display()))?;
    let mut document = PlantDocument::new(plant, &estimated, hold);
    document.fit = fits(plant, &records, &logs, &estimated, hold);
    document.sample_time = logs.first().map(|l| l.sample_time);
    document.recordings = recordings;
    if let Some(output) = &output {
        output.write(&document.to_json()?)?;
    }
    if say.quiet || output.as_ref().is_some_and(Output::is_stdout) {
        return Ok(Outcome::Done);
    }
    let samples: usize = logs.iter().map(Log::samples).sum();
    let title = format!("{} from {samples} samples", plant.spec.name);
    print(&plant_estimate_text(&document, &title, style()))?;
    if let Some(output) = &output {
        print(&format!("\nwritten to {}\n", output.path().display()))?;
    }
    Ok(Outcome::Done)
}

/// Which parameters are free.
fn free(plant: &Plant, flags: &StructureFlags) -> anyhow::Result<Vec<bool>> {
    let names: Vec<&str> = plant
        .spec
        .parameters()
        .into_iter()
        .map(|v| plant.spec.variable(v).name.as_str())
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

/// `100 (1 - |y - s| / |y - mean y|)` over several recordings, and the root mean square of the error.
fn fit(pairs: &[(&[f64], &[f64])]) -> (f64, f64) {
    let (mut error, mut spread, mut count) = (0.0, 0.0, 0.0);
    for (y, s) in pairs {
        let mean = y.iter().sum::<f64>() / y.len().max(1) as f64;
        error += y.iter().zip(*s).map(|(y, s)| (y - s).powi(2)).sum::<f64>();
        spread += y.iter().map(|y| (y - mean).powi(2)).sum::<f64>();
        count += y.len() as f64;
    }
    (
        100.0 * (1.0 - (error / spread).sqrt()),
        (error / count).sqrt(),
    )
}

/// Fits in free run of the estimate, of the values of the text, and of the best linear model.
fn fits(
    plant: &Plant,
    records: &[PlantRecording],
    logs: &[Log],
    estimate: &PlantEstimate,
    hold: Hold,
) -> Vec<FitDocument> {
    let outputs = plant.spec.outputs();
    let l = outputs.len();
    let text: Vec<Option<Vec<Vec<f64>>>> = records
        .iter()
        .map(|r| {
            let inputs: Vec<&[f64]> = r.inputs.iter().map(Vec::as_slice).collect();
            let excitation = Excitation {
                inputs: &inputs,
                length: r.outputs[0].len(),
                sample_time: r.sample_time,
                start_time: r.start_time,
                hold,
            };
            plant
                .simulate(&plant.nominal(), &excitation, None)
                .ok()
                .map(|t| t.outputs)
        })
        .collect();
    let linear = linear_model(logs);
    let measured = |o: usize| records.iter().map(move |r| r.outputs[o].as_slice());
    (0..l)
        .map(|o| {
            let simulated = estimate
                .simulated
                .iter()
                .skip(o)
                .step_by(l)
                .map(Vec::as_slice);
            let (percent, rms) = fit(&measured(o).zip(simulated).collect::<Vec<_>>());
            let of_text: Option<Vec<&[f64]>> = text
                .iter()
                .map(|t| t.as_ref().map(|t| t[o].as_slice()))
                .collect();
            let of_linear = linear
                .as_ref()
                .map(|(_, runs)| runs.iter().map(|r| r[o].as_slice()));
            FitDocument {
                output: plant.spec.variable(outputs[o]).column().to_owned(),
                free_run_percent: percent,
                rms_error: rms,
                text_percent: of_text.map(|t| fit(&measured(o).zip(t).collect::<Vec<_>>()).0),
                linear_model_percent: of_linear
                    .map(|t| fit(&measured(o).zip(t).collect::<Vec<_>>()).0),
                linear_model_order: linear.as_ref().map(|(order, _)| *order),
            }
        })
        .collect()
}

/// Order and free runs of the linear model that is identified from the same recordings.
fn linear_model(logs: &[Log]) -> Option<(usize, Vec<Vec<Vec<f64>>>)> {
    let model = identify(logs, &Options::default()).ok()?;
    let runs: Option<Vec<_>> = logs
        .iter()
        .map(|log| {
            let inputs: Vec<&[f64]> = log.input_data.iter().map(Vec::as_slice).collect();
            let outputs: Vec<&[f64]> = log.output_data.iter().map(Vec::as_slice).collect();
            let start = model.initial_state_of(&inputs, &outputs).ok()?;
            model.simulate(&inputs, Some(&start)).ok()
        })
        .collect();
    Some((model.system.states(), runs?))
}
