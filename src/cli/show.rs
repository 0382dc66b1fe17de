//! `innovant show`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::numbers;
use super::output::print;
use super::plant::is_plant_file;
use super::show_plant::{self, PlantShowFlags};
use super::terminal::style;
use super::{Outcome, Verbosity};
use crate::covariance::{ResponsePoint, invariants};
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
    format: Format,
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

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Format {
    Text,
    Json,
    Csv,
    Modelica,
}

pub(super) fn run(flags: Flags, say: Verbosity) -> anyhow::Result<Outcome> {
    if is_plant_file(&flags.model) {
        return show_plant::run(&flags.model, &flags.plant, &flags.at, flags.format, say);
    }
    let name = flags.model.display();
    if flags.plant.given() || flags.format == Format::Modelica {
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
        Format::Text => print(&show_text(
            model,
            &described,
            read.document.residual_tests(),
            !flags.at.is_empty(),
            style(),
        ))?,
        Format::Json => print(&to_json(&described)?)?,
        // Refused above.
        Format::Modelica => {}
        Format::Csv => print(&table(
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

/// Frequency responses as CSV; the innovation of output y is the input `e(y)`.
pub(super) fn table<'a>(points: impl Iterator<Item = &'a ResponsePoint>) -> anyhow::Result<String> {
    let mut csv = csv::Writer::from_writer(Vec::new());
    csv.write_record([
        "rad_s",
        "hz",
        "output",
        "input",
        "real",
        "imag",
        "variance_real",
        "covariance_real_imag",
        "variance_imag",
        "magnitude",
        "magnitude_95_low",
        "magnitude_95_high",
        "magnitude_99_low",
        "magnitude_99_high",
        "phase_rad",
        "phase_95_low",
        "phase_95_high",
    ])?;
    for point in points {
        csv.write_record(record(point))?;
    }
    Ok(String::from_utf8(csv.into_inner()?)?)
}

fn record(point: &ResponsePoint) -> [String; 17] {
    let number = |value: Option<f64>| value.map_or(String::new(), |v| v.to_string());
    let end = |band: Option<[f64; 2]>, end: usize| number(band.map(|b| b[end]));
    let covariance = |i: usize, j: usize| number(point.covariance.map(|c| c[i][j]));
    [
        point.rad_s.to_string(),
        point.hz.to_string(),
        point.output.clone(),
        point.input.clone(),
        number(point.real),
        number(point.imag),
        covariance(0, 0),
        covariance(0, 1),
        covariance(1, 1),
        number(point.magnitude),
        end(point.magnitude_95, 0),
        end(point.magnitude_95, 1),
        end(point.magnitude_99, 0),
        end(point.magnitude_99, 1),
        number(point.phase_rad),
        end(point.phase_95, 0),
        end(point.phase_95, 1),
    ]
}
