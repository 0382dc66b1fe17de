//! `innovant show` of a plant in equations: its parameters, and the plant linearised at an operating point.

use std::path::Path;

use clap::Args;

use super::load_plant::{LoadedPlant, assignments, load, place, read_recordings};
use crate::cli::flags::{RoleFlags, ShowFormat};
use crate::cli::response_csv::response_csv;
use crate::cli::terminal::{check_distinct, note, print, style};
use crate::cli::{Outcome, Verbosity};
use crate::covariance::invariants;
use crate::identify::{Options, channel_names, identify};
use crate::log::{Log, RoleNeed, Source};
use crate::physics::{OperatingPoint, OperatingPointError};
use crate::report::text::{linearisation_text, plant_estimate_text, plant_text};
use crate::report::{
    IdentifiedDocument, LinearisationDocument, Uncertain, frequency_grid, logarithmic, to_json,
};

/// Frequencies at which plant and linear model are compared.
const COMPARED: usize = 6;
/// From this part of the Nyquist frequency ...
const LOWEST: f64 = 0.01;
/// ... to this one: nearer to it a model is mostly noise.
const HIGHEST: f64 = 0.6;

/// Where a plant in equations is linearised.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Plant in equations")]
pub(crate) struct PlantShowFlags {
    /// State to linearise at: equilibrium; start (the start values of the text); values by name, as `w=3,phi=0.1`, the others at
    /// their start values [default: equilibrium]
    #[arg(long, value_name = "equilibrium|start|NAME=VALUE")]
    state: Option<String>,
    /// Inputs to linearise at, as `u=0.5` [default: 0]
    #[arg(long, value_name = "NAME=VALUE")]
    input: Option<String>,
    /// Linearise at the means of this recording, and show the linear model that `innovant identify` finds in it
    #[arg(long, value_name = "LOG", conflicts_with_all = ["state", "input"])]
    along: Option<Source>,
    #[command(flatten)]
    roles: RoleFlags,
}

impl PlantShowFlags {
    /// Whether something is asked for that only plants in equations have.
    pub(crate) fn given(&self) -> bool {
        self.state.is_some() || self.input.is_some() || self.along.is_some()
    }
}

/// Inputs, state, and what that is in words.
struct Operating {
    inputs: Vec<f64>,
    at: OperatingPoint,
    words: String,
}

pub(crate) fn run(
    path: &Path,
    flags: &PlantShowFlags,
    frequencies: &[f64],
    format: ShowFormat,
    say: Verbosity,
) -> anyhow::Result<Outcome> {
    let loaded = load(path)?;
    if format == ShowFormat::Modelica {
        print(&loaded.modelica())?;
        return Ok(Outcome::Done);
    }
    let description = describe(&loaded);
    let logs = match &flags.along {
        Some(log) => {
            check_distinct(&[log.clone(), Source::from(path.to_path_buf())])?;
            let source = std::slice::from_ref(log);
            read_recordings(&loaded.plant, source, &flags.roles, RoleNeed::Identify, say)?.0
        }
        None => Vec::new(),
    };
    let name = path.display();
    let operating = match logs.as_slice() {
        [] => asked(&loaded, flags)?,
        logs => means(&loaded, logs).map_err(|e| anyhow::anyhow!("{name}: {e}"))?,
    };
    let linearised = linearise(&loaded, &operating, frequencies, &logs);
    let document = match linearised {
        Ok(document) => document,
        // Not asked for: the rest is shown without it.
        Err(Unfit::OperatingPoint(e)) if !flags.given() && format == ShowFormat::Text => {
            print(&description)?;
            note(&format!(
                "not linearised: {e}; give --input or --state for an operating point\n"
            ));
            return Ok(Outcome::Done);
        }
        Err(Unfit::OperatingPoint(e)) => anyhow::bail!(
            "{name}: {e}; give another operating point (--input u=1, --state start, or --state with values)"
        ),
        Err(Unfit::Other(e)) => anyhow::bail!("{name}: {e}"),
    };
    match format {
        ShowFormat::Json => print(&to_json(&document)?)?,
        ShowFormat::Csv => print(&response_csv(document.frequency_response.iter())?)?,
        ShowFormat::Text | ShowFormat::Modelica => {
            let every = !frequencies.is_empty();
            let text = linearisation_text(&document, &loaded.plant, every, style());
            print(&(description + &text))?;
        }
    }
    Ok(Outcome::Done)
}

/// What was estimated, or what was read.
fn describe(loaded: &LoadedPlant) -> String {
    let Some(document) = &loaded.document else {
        return plant_text(&loaded.plant);
    };
    let samples: usize = document.recordings.iter().map(|r| r.samples).sum();
    let title = match samples {
        0 => loaded.plant.spec.name.clone(),
        samples => format!("{} from {samples} samples", loaded.plant.spec.name),
    };
    plant_estimate_text(document, &title, style())
}

fn asked(loaded: &LoadedPlant, flags: &PlantShowFlags) -> anyhow::Result<Operating> {
    let plant = &loaded.plant;
    let mut inputs = vec![0.0; plant.spec.inputs().len()];
    if let Some(text) = &flags.input {
        for (name, value) in assignments("--input", text)? {
            inputs[place(plant, plant.spec.inputs(), ("--input", "input"), &name)?] = value;
        }
    }
    let start = plant.start(&loaded.point);
    let (at, words) = match flags.state.as_deref() {
        None | Some("equilibrium") => (OperatingPoint::Equilibrium(start), "the equilibrium"),
        Some("start") => (OperatingPoint::Start, "the start values"),
        Some(text) => {
            let mut state = start;
            for (name, value) in assignments("--state", text)? {
                state[place(plant, plant.spec.states(), ("--state", "state"), &name)?] = value;
            }
            (OperatingPoint::State(state), "the given state")
        }
    };
    Ok(Operating {
        inputs,
        at,
        words: words.to_owned(),
    })
}

fn mean(columns: &[&[f64]]) -> f64 {
    let values = || {
        columns
            .iter()
            .flat_map(|c| c.iter())
            .filter(|v| v.is_finite())
    };
    values().sum::<f64>() / values().count().max(1) as f64
}

/// The equilibrium at the mean inputs, searched for from the mean of the simulated states; that mean where there is none.
fn means(loaded: &LoadedPlant, logs: &[Log]) -> anyhow::Result<Operating> {
    let plant = &loaded.plant;
    let inputs: Vec<f64> = (0..plant.spec.inputs().len())
        .map(|i| {
            mean(
                &logs
                    .iter()
                    .map(|l| l.input_data[i].as_slice())
                    .collect::<Vec<_>>(),
            )
        })
        .collect();
    let runs: Vec<Vec<Vec<f64>>> = logs
        .iter()
        .filter_map(|log| {
            let run = plant.run(log, &loaded.point, loaded.hold).ok()?;
            Some(run.states)
        })
        .collect();
    let start = plant.start(&loaded.point);
    let state: Vec<f64> = match runs.is_empty() {
        true => start,
        false => (0..start.len())
            .map(|i| mean(&runs.iter().map(|r| r[i].as_slice()).collect::<Vec<_>>()))
            .collect(),
    };
    let at = OperatingPoint::Equilibrium(state.clone());
    let found = plant.at_operating_point(&loaded.point, &inputs, &at, &[]);
    let (at, words) = match found {
        Ok(_) => (at, "the equilibrium at the mean inputs of the recording"),
        Err(_) => (
            OperatingPoint::State(state),
            "the means of the inputs and of the simulated states (no equilibrium was found)",
        ),
    };
    Ok(Operating {
        inputs,
        at,
        words: words.to_owned(),
    })
}

/// Why there is no linearisation.
enum Unfit {
    OperatingPoint(OperatingPointError),
    Other(anyhow::Error),
}

impl<E: Into<anyhow::Error>> From<E> for Unfit {
    fn from(error: E) -> Self {
        let error: anyhow::Error = error.into();
        match error.downcast::<OperatingPointError>() {
            Ok(error) => Self::OperatingPoint(error),
            Err(error) => Self::Other(error),
        }
    }
}

fn linearise(
    loaded: &LoadedPlant,
    operating: &Operating,
    frequencies: &[f64],
    logs: &[Log],
) -> Result<LinearisationDocument, Unfit> {
    let plant = &loaded.plant;
    let document = loaded.document.as_ref();
    let uncertainty = document.and_then(|d| d.uncertainty(plant));
    let uncertain = uncertainty.as_ref().map_or(&[][..], |(places, _)| places);
    let at =
        plant.at_operating_point(&loaded.point, &operating.inputs, &operating.at, uncertain)?;
    let of = Uncertain {
        plant,
        operating: &at,
        covariance: uncertainty.as_ref().map(|(_, covariance)| *covariance),
    };
    let grid = match frequencies {
        [] => frequency_grid(&at, document.and_then(|d| d.sample_time))?,
        given => given.to_vec(),
    };
    let mut found = LinearisationDocument::new(&of, operating.words.clone(), &grid)?;
    if !logs.is_empty() {
        found.identified = Some(identified(&of, logs, frequencies)?);
    }
    Ok(found)
}

/// The linear model of the same recordings, and the plant as it would see it.
fn identified(
    of: &Uncertain,
    logs: &[Log],
    frequencies: &[f64],
) -> anyhow::Result<IdentifiedDocument> {
    let model = identify(logs, &Options::default())?;
    let nyquist = model.system.nyquist();
    let frequencies = match frequencies {
        [] => logarithmic(LOWEST * nyquist, HIGHEST * nyquist, COMPARED),
        given => given.to_vec(),
    };
    let described = invariants(
        &model.system,
        model.covariance.as_ref(),
        &channel_names(&model.outputs),
        &channel_names(&model.inputs),
        &frequencies,
        model.summary.as_ref().map_or(0, |s| s.options.seed),
    )?;
    Ok(IdentifiedDocument {
        order: model.system.states(),
        sample_time: model.system.sample_time,
        poles: described.poles,
        frequency_response: described.frequency_response,
        plant_response: of.responses(&frequencies, Some(model.system.sample_time)),
    })
}
