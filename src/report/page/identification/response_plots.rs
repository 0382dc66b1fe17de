//! Frequency response and step response of every path, with 95 and 99 % bands.

use std::f64::consts::{PI, TAU};

use super::plot::{Axis, Drawing, Group, Plot, Series};
use super::typeset_number::{number, uncertain, with_unit};
use super::{folded, grid};
use crate::covariance::{Invariants, ResponsePoint, interval_quantile};
use crate::identify::Model;

/// Room below the smallest magnitude for bands that reach to zero, in decibels.
const BELOW: f64 = 12.0;

fn decibels(magnitude: f64) -> f64 {
    20.0 * magnitude.log10()
}

/// Magnitude and phase of every path.
pub(super) fn frequency(of: &Invariants) -> Vec<Group> {
    let mut paths: Vec<(&str, &str)> = Vec::new();
    for point in &of.frequency_response {
        let path = (point.input.as_str(), point.output.as_str());
        if !paths.contains(&path) {
            paths.push(path);
        }
    }
    let groups = paths.iter().enumerate().map(|(k, (input, output))| {
        let points: Vec<&ResponsePoint> = of
            .frequency_response
            .iter()
            .filter(|p| (p.input.as_str(), p.output.as_str()) == (*input, *output))
            .collect();
        Group {
            id: format!("path-{k}"),
            title: format!("From {input} to {output}"),
            caption: String::new(),
            plots: [magnitude(&points), phase(&points)]
                .into_iter()
                .flatten()
                .collect(),
            folded: false,
            linked: true,
            beside: false,
        }
    });
    folded(groups.filter(|group| !group.plots.is_empty()).collect())
}

fn at(point: &ResponsePoint) -> String {
    format!(
        "at {} Hz = {} rad/s",
        number(point.hz, 4),
        number(point.rad_s, 4)
    )
}

fn frequencies(points: &[&ResponsePoint]) -> Axis {
    Axis::new("frequency", "Hz")
        .logarithmic(true)
        .spanning(points.iter().map(|p| p.hz))
}

fn magnitude(points: &[&ResponsePoint]) -> Option<Plot> {
    let line: Vec<(&ResponsePoint, f64)> = points
        .iter()
        .filter_map(|p| Some((*p, decibels(p.magnitude.filter(|m| *m > 0.0)?))))
        .collect();
    let (peak, highest) = *line.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let lowest = line.iter().fold(f64::INFINITY, |m, p| m.min(p.1)) - BELOW;
    // Zero has no place on a logarithmic scale: the band reaches below the picture.
    let limits = |pick: fn(&ResponsePoint) -> Option<[f64; 2]>| {
        line.iter().filter_map(move |(p, _)| {
            let [low, high] = pick(p)?;
            Some((p.hz, decibels(low).max(lowest - BELOW), decibels(high)))
        })
    };
    let in_words = |band: [f64; 2]| {
        let low = match band[0] {
            low if low > 0.0 => number(decibels(low), 3),
            _ => "no bound below".to_owned(),
        };
        format!("{low} to {} dB", number(decibels(band[1]), 3))
    };
    let says = line.iter().map(|(p, v)| {
        let band = p
            .magnitude_95
            .map_or(String::new(), |b| format!(" (95 %: {})", in_words(b)));
        format!("{} dB{band} {}", number(*v, 3), at(p))
    });
    let known = peak.magnitude_95.map_or(String::new(), |band| {
        format!(", and with 95 % probability {}", in_words(band))
    });
    let upper = limits(|p| p.magnitude_95).map(|l| l.2);
    let lower = limits(|p| p.magnitude_95).map(|l| l.1.max(lowest));
    let y = Axis::new("magnitude", "dB").over(line.iter().map(|p| p.1).chain(upper).chain(lower));
    Some(Plot {
        title: "Magnitude".to_owned(),
        caption: format!("Largest {}: {} dB{known}.", at(peak), number(highest, 3)),
        height: "ordinary",
        drawing: Drawing {
            x: frequencies(points),
            y,
            series: vec![
                Series::line("model", "first", line.iter().map(|(p, v)| (p.hz, *v)))
                    .within("99 %", limits(|p| p.magnitude_99))
                    .within("95 %", limits(|p| p.magnitude_95))
                    .saying(says.collect()),
            ],
            ..Drawing::default()
        },
    })
}

/// A phase without jumps, and its bands.
fn phase(points: &[&ResponsePoint]) -> Option<Plot> {
    let mut last: Option<f64> = None;
    let line: Vec<(&ResponsePoint, f64)> = points
        .iter()
        .filter_map(|p| {
            let turn = p.phase_rad?;
            let here = last.map_or(turn, |last| turn + TAU * ((last - turn) / TAU).round());
            last = Some(here);
            Some((*p, here))
        })
        .collect();
    let turned = |band: [f64; 2], p: &ResponsePoint, here: f64| {
        let shift = here - p.phase_rad.unwrap_or(here);
        band.map(|v| (v + shift).to_degrees())
    };
    let limits = |pick: fn(&ResponsePoint) -> Option<[f64; 2]>| {
        line.iter().filter_map(move |(p, here)| {
            let [low, high] = turned(pick(p)?, p, *here);
            Some((p.hz, low, high))
        })
    };
    let says = line.iter().map(|(p, here)| {
        let band = p.phase_95.map_or(String::new(), |band| {
            let [low, high] = turned(band, p, *here);
            format!(" (95 %: {} to {}°)", number(low, 3), number(high, 3))
        });
        format!("{}°{band} {}", number(here.to_degrees(), 3), at(p))
    });
    let mut widths: Vec<f64> = line
        .iter()
        .filter_map(|(p, _)| p.phase_95.map(|[low, high]| (high - low) / 2.0))
        .collect();
    widths.sort_by(f64::total_cmp);
    let open = widths.last().is_some_and(|w| *w > 0.99 * PI);
    let mut caption = match widths.get(widths.len() / 2) {
        None => "Phase of the output against the input.".to_owned(),
        Some(middle) => format!(
            "At half of the frequencies known to ± {}° or better (95 %).",
            number(middle.to_degrees(), 2)
        ),
    };
    if open {
        caption
            .push_str(" Where the band opens to a full turn, the recording does not determine it.");
    }
    let heights = line.iter().map(|p| p.1.to_degrees());
    let y = Axis::new("phase", "°").over(
        heights
            .clone()
            .chain(limits(|p| p.phase_95).flat_map(|l| [l.1, l.2])),
    );
    (!line.is_empty()).then(|| Plot {
        title: "Phase".to_owned(),
        caption,
        height: "low",
        drawing: Drawing {
            x: frequencies(points),
            y,
            series: vec![
                Series::line(
                    "model",
                    "first",
                    line.iter().map(|(p, v)| (p.hz, v.to_degrees())),
                )
                .within("99 %", limits(|p| p.phase_99))
                .within("95 %", limits(|p| p.phase_95))
                .saying(says.collect()),
            ],
            ..Drawing::default()
        },
    })
}

/// Step responses of every path.
pub(super) fn steps(of: &Invariants, model: &Model) -> Vec<Group> {
    let freedom = model.covariance.as_ref().and_then(|c| c.degrees_of_freedom);
    let plots = of.step_response.iter().map(|step| {
        let unit = model
            .outputs
            .iter()
            .find(|c| c.channel.name == step.output)
            .and_then(|c| c.channel.unit.clone())
            .unwrap_or_default();
        let line: Vec<(f64, f64)> = step
            .time_s
            .iter()
            .zip(&step.value)
            .map(|(t, v)| (*t, v.unwrap_or(f64::NAN)))
            .collect();
        let limits = |level: f64| -> Vec<(f64, f64, f64)> {
            let half = interval_quantile(level, freedom);
            let spread = step.standard_deviation.iter().flatten();
            line.iter()
                .zip(spread)
                .filter_map(|((t, v), std)| Some((*t, v - half * (*std)?, v + half * (*std)?)))
                .collect()
        };
        let gain = of
            .static_gain
            .iter()
            .find(|g| (&g.input, &g.output) == (&step.input, &step.output));
        let caption = match gain.and_then(|g| Some((g.value?, g.standard_deviation))) {
            Some((value, std)) => format!(
                "In the end {} (± one standard deviation), the static gain.",
                with_unit(&uncertain(value, std), &unit)
            ),
            None => "It does not settle: the model integrates.".to_owned(),
        };
        let mut series = Series::line("model", "first", line.clone());
        for (name, level) in [("99 %", 0.99), ("95 %", 0.95)] {
            series = series.within(name, limits(level));
        }
        let heights = line.iter().map(|p| p.1);
        Plot {
            title: format!("From {} to {}", step.input, step.output),
            caption,
            height: "ordinary",
            drawing: Drawing {
                x: Axis::new("time", "s").spanning(step.time_s.iter().copied()),
                y: Axis::new(&step.output, unit)
                    .over(heights.chain(limits(0.95).into_iter().flat_map(|l| [l.1, l.2]))),
                series: vec![series],
                ..Drawing::default()
            },
        }
    });
    grid("steps", "", plots.collect())
}
