//! `innovant show`.

use std::path::PathBuf;

use clap::Args;

use super::flags::{ShowFormat, numbers};
use super::plant::{PlantShowFlags, is_plant_file, show_plant};
use super::response_csv::response_csv;
use super::terminal::{print, style};
use super::{Outcome, Verbosity};
use crate::covariance::invariants;
use crate::identify::{Model, channel_names};
use crate::report::text::show_text;
use crate::report::{read_model, to_json};

/// Frequencies of the default grid.
const FREQUENCIES: usize = 60;

const EXAMPLE: &str = "Examples:
  innovant show model.json
  innovant show model.json --format json --at 0.1,0.3 | jq '.frequency_response[0].magnitude_95'
  innovant show model.json --format csv > frequency_response.csv
  innovant show plant.json --input 'u=0.5'            poles at the equilibrium with this input
  innovant show plant.json --along log.csv            beside what `identify` finds in the same recording
  innovant show plant.json --format modelica > calibrated.mo";

/// Show a model: poles, zeros, gains, frequency response with bands
///
/// A plant in equations is shown with its parameters and linearised at an operating point; the uncertainty follows from
/// that of the parameters.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLE)]
pub(super) struct Flags {
    /// Model, as `innovant identify --output` writes it, or {"A":..,"B":..,"C":..,"dt":..}, or a plant in equations (.mo);
    /// `-` is standard input
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// text: tables; json: everything (for a plant in equations: its linearisation); csv: the frequency response; modelica:
    /// the equations with the estimated values
    #[arg(long, value_enum, default_value = "text")]
    format: ShowFormat,
    /// Frequencies in rad/s [default: a logarithmic grid up to Nyquist]
    #[arg(
        long,
        value_name = "RAD_S",
        value_delimiter = ',',
        value_parser = numbers::frequency,
        allow_negative_numbers = true
    )]
    at: Vec<f64>,
    #[command(flatten)]
    plant: PlantShowFlags,
}

pub(super) fn run(flags: Flags, say: Verbosity) -> anyhow::Result<Outcome> {
    if is_plant_file(&flags.model) {
        return show_plant::run(&flags.model, &flags.plant, &flags.at, flags.format, say);
    }
    let name = flags.model.display();
    if flags.plant.given() || flags.format == ShowFormat::Modelica {
        anyhow::bail!(
            "{name}: --state, --input, --along and --format modelica belong to a plant in equations, and this is none"
        );
    }
    let read = read_model(&flags.model)?;
    let model = &read.model;
    let frequencies = frequencies(&flags.at, model)?;
    let described = invariants(
        &model.system,
        model.covariance.as_ref(),
        &channel_names(&model.outputs),
        &channel_names(&model.inputs),
        &frequencies,
        model.summary.as_ref().map_or(0, |s| s.options.seed),
    )?;
    match flags.format {
        ShowFormat::Text => print(&show_text(
            model,
            &described,
            read.document.residual_tests(),
            !flags.at.is_empty(),
            style(),
        ))?,
        ShowFormat::Json => print(&to_json(&described)?)?,
        // Refused above.
        ShowFormat::Modelica => {}
        ShowFormat::Csv => print(&response_csv(
            described
                .frequency_response
                .iter()
                .chain(&described.noise_response),
        )?)?,
    }
    Ok(Outcome::Done)
}

fn frequencies(asked: &[f64], model: &Model) -> anyhow::Result<Vec<f64>> {
    if asked.is_empty() {
        return Ok(model.system.default_frequencies(FREQUENCIES)?);
    }
    let nyquist = model.system.nyquist();
    // A Nyquist frequency that was typed is rounded.
    if let Some(beyond) = asked.iter().find(|w| **w > nyquist * (1.0 + 1e-3)) {
        anyhow::bail!(
            "--at {beyond}: beyond the Nyquist frequency of this model, {nyquist:.6} rad/s, there is nothing to see"
        );
    }
    Ok(asked.to_vec())
}
