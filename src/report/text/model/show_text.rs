//! What is known of a model.

use super::model_text::dynamics;
use super::roots::{shortened, zeros};
use super::verdict_text::verdict;
use crate::covariance::{Invariants, ResponsePoint};
use crate::identify::Model;
use crate::report::text::number::{significant, with_std};
use crate::report::text::table::Table;
use crate::report::text::{Style, wrapped};
use crate::validate::Validation;

/// Frequencies of a path that are listed.
const FREQUENCIES_SHOWN: usize = 12;

/// Channels, poles, zeros, gains, and frequency responses with their bands.
pub fn show_text(
    model: &Model,
    described: &Invariants,
    tests: Option<&Validation>,
    every_frequency: bool,
    style: Style,
) -> String {
    let mut out = wrapped("", &verdict(model, tests));
    out.push_str(&channels(model));
    out.push_str(&dynamics(model, described, usize::MAX, style));
    out.push_str(&zeros("Zeros (z plane)", &described.zeros, style));
    if let Some(armax) = &described.armax {
        out.push_str("\nPolynomials, a(q) y = b(q) u + c(q) e, from lag 0\n");
        for (name, coefficients) in [("a", &armax.a), ("b", &armax.b), ("c", &armax.c)] {
            let list: Vec<String> = coefficients.iter().map(|v| significant(*v, 6)).collect();
            out.push_str(&wrapped(&format!("  {name} = "), &list.join(" ")));
        }
    }
    out.push_str(&noise(model, style));
    out.push_str(&responses(&described.frequency_response, every_frequency));
    if let Some(summary) = &model.summary {
        for (index, warning) in summary.warnings.iter().enumerate() {
            if index == 0 {
                out.push('\n');
            }
            out.push_str(&wrapped("warning: ", warning));
        }
    }
    out
}

fn channels(model: &Model) -> String {
    let mut table = Table::new([
        "channel",
        "unit",
        "role",
        "operating point",
        "delay [samples]",
    ])
    .flush_left(1)
    .flush_left(2);
    for (role, channels) in [("input", &model.inputs), ("output", &model.outputs)] {
        for channel in channels {
            table.row([
                shortened(&channel.channel.name),
                shortened(channel.channel.unit.as_deref().unwrap_or_default()),
                role.to_owned(),
                significant(channel.level, 6),
                if channel.delay > 0 {
                    channel.delay.to_string()
                } else {
                    String::new()
                },
            ]);
        }
    }
    format!("\nChannels\n{}", table.lines())
}

fn noise(model: &Model, style: Style) -> String {
    let Some(covariance) = &model.innovation_covariance else {
        return String::new();
    };
    let freedom = model.summary.as_ref().map(|s| s.degrees_of_freedom);
    let mut table = Table::new(["output", "standard deviation"]);
    for (index, output) in model.outputs.iter().enumerate() {
        let std = covariance[(index, index)].max(0.0).sqrt();
        // std of s is s / sqrt(2 nu).
        let spread = freedom.map(|nu| std / (2.0 * nu as f64).sqrt());
        table.row([
            shortened(&output.channel.name),
            with_std(Some(std), spread, style),
        ]);
    }
    format!(
        "\nInnovations (what one step ahead cannot foresee)\n{}",
        table.lines()
    )
}

/// Frequency responses path by path, some of the frequencies or every one.
pub(crate) fn responses(points: &[ResponsePoint], every_frequency: bool) -> String {
    let mut out = String::new();
    let mut paths: Vec<(&str, &str)> = Vec::new();
    for point in points {
        let path = (point.input.as_str(), point.output.as_str());
        if !paths.contains(&path) {
            paths.push(path);
        }
    }
    for (input, output) in paths {
        let along: Vec<&ResponsePoint> = points
            .iter()
            .filter(|p| p.input == input && p.output == output)
            .collect();
        let step = if every_frequency {
            1
        } else {
            along.len().div_ceil(FREQUENCIES_SHOWN).max(1)
        };
        let mut table = Table::new([
            "rad/s",
            "Hz",
            "magnitude",
            "95 % band",
            "phase [deg]",
            "95 % band",
        ]);
        // Counted from the end, so that the Nyquist frequency is among them.
        let shown: Vec<&&ResponsePoint> = along.iter().rev().step_by(step).collect();
        for point in shown.into_iter().rev() {
            let magnitude = |value: f64| significant(value, 4);
            // Rounded first, and zero added, so that a rounding error does not print as -0.0.
            let degrees =
                |value: f64| format!("{:.1}", (value.to_degrees() * 10.0).round() / 10.0 + 0.0);
            let band = |band: Option<[f64; 2]>, text: &dyn Fn(f64) -> String| {
                band.map_or("-".to_owned(), |[low, high]| {
                    format!("{} .. {}", text(low), text(high))
                })
            };
            table.row([
                significant(point.rad_s, 4),
                significant(point.hz, 4),
                point.magnitude.map_or("-".to_owned(), magnitude),
                band(point.magnitude_95, &magnitude),
                point.phase_rad.map_or("-".to_owned(), degrees),
                band(point.phase_95, &degrees),
            ]);
        }
        out.push_str(&wrapped(
            "\n",
            &format!("Frequency response from {input} to {output}"),
        ));
        out.push_str(&table.lines());
    }
    out
}
