//! Outputs, inputs and residuals over time, and the autocorrelations of the residuals.

use super::plot::{Axis, Drawing, Group, Kind, Plot, Series};
use super::typeset_number::number;
use crate::covariance::interval_quantile;
use crate::physics::estimate::{Evaluation, PlantRecording};
use crate::physics::{Plant, VariableId};
use crate::report::PlantDocument;

/// Recordings that are shown before the rest is folded away.
const SHOWN: usize = 2;
/// Lags of an autocorrelation.
const LAGS: usize = 25;
/// Level of the bounds of an autocorrelation.
const BOUND: f64 = 0.99;

/// Name, style and points.
type Line<'a> = (&'a str, &'static str, Vec<(f64, f64)>);

/// A recording as a picture needs it.
struct Drawn<'a> {
    plant: &'a Plant,
    record: &'a PlantRecording,
    origin: Option<&'a str>,
}

impl Drawn<'_> {
    fn points(&self, values: &[f64]) -> Vec<(f64, f64)> {
        let time = |k: usize| self.record.start_time + k as f64 * self.record.sample_time;
        values
            .iter()
            .enumerate()
            .map(|(k, &v)| (time(k), v))
            .collect()
    }

    fn plot(
        &self,
        of: VariableId,
        (title, caption): (String, String),
        lines: &[(&str, &'static str, &[f64])],
    ) -> Plot {
        let v = self.plant.spec.variable(of);
        let lines: Vec<Line> = lines
            .iter()
            .map(|(name, style, values)| (*name, *style, self.points(values)))
            .collect();
        let all = || lines.iter().flat_map(|l| l.2.iter().copied());
        Plot {
            title,
            caption,
            height: "low",
            drawing: Drawing {
                x: Axis::new("time", "s")
                    .spanning(all().map(|p| p.0))
                    .since(self.origin),
                y: Axis::new(v.column(), v.unit_text.clone().unwrap_or_default())
                    .over(all().map(|p| p.1)),
                series: lines
                    .iter()
                    .map(|(name, style, points)| Series::line(*name, style, points.iter().copied()))
                    .collect(),
                ..Drawing::default()
            },
        }
    }
}

/// A group of pictures for each recording; `None` leaves one out.
fn each<'a>(
    plant: &'a Plant,
    document: &'a PlantDocument,
    records: &'a [PlantRecording],
    (id, title): (&str, &str),
    plots: impl Fn(usize, &Drawn<'a>) -> Vec<Plot>,
) -> Vec<Group> {
    let mut groups = Vec::new();
    for (k, record) in records.iter().enumerate() {
        let about = document.recordings.get(k);
        let drawn = Drawn {
            plant,
            record,
            origin: about.and_then(|r| r.origin.as_deref()),
        };
        let name = about.map_or(format!("recording {}", k + 1), |r| r.name.clone());
        groups.push(Group {
            id: format!("{id}-{k}"),
            title: match (records.len() > 1, title) {
                (false, title) => title.to_owned(),
                (true, "") => name,
                (true, title) => format!("{title}: {name}"),
            },
            caption: String::new(),
            plots: plots(k, &drawn),
            folded: k >= SHOWN,
            linked: true,
            beside: false,
        });
    }
    groups
}

fn size(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values
        .filter(|v| v.is_finite())
        .fold((0.0, 0.0), |(s, n), v| (s + v * v, n + 1.0));
    (sum / f64::max(count, 1.0)).sqrt()
}

/// Each output as recorded and simulated, the inputs below.
pub(super) fn recordings(
    plant: &Plant,
    document: &PlantDocument,
    records: &[PlantRecording],
    found: &Evaluation,
) -> Vec<Group> {
    let (inputs, outputs) = (plant.spec.inputs(), plant.spec.outputs());
    let l = outputs.len();
    let in_free_run = document.form != "innovation";
    each(plant, document, records, ("recording", ""), |k, drawn| {
        let of_output = |(o, &v): (usize, &VariableId)| {
            let recorded = drawn.record.outputs[o].as_slice();
            let mut lines: Vec<(&str, &'static str, &[f64])> =
                vec![("recorded", "recorded", recorded)];
            let simulated = found.simulated.as_ref().map(|s| s[k * l + o].as_slice());
            let predicted = found.predicted[k * l + o].as_slice();
            if let Some(simulated) = simulated {
                lines.push(("free run", "augmented", simulated));
            }
            if !in_free_run || simulated.is_none() {
                lines.push(("one step ahead", "between", predicted));
            }
            let unit = plant.spec.variable(v).unit_text.clone().unwrap_or_default();
            let error = |of: &[f64]| number(size(recorded.iter().zip(of).map(|(y, s)| y - s)), 3);
            let caption = match simulated {
                Some(simulated) => format!(
                    "Root mean square of the error in free run: {} {unit}.",
                    error(simulated)
                ),
                None => format!(
                    "Root mean square of the error one step ahead: {} {unit}.",
                    error(predicted)
                ),
            };
            let title = format!("{} (output)", plant.spec.variable(v).column());
            drawn.plot(v, (title, caption), &lines)
        };
        let of_input = |(i, &v): (usize, &VariableId)| {
            let name = plant.spec.variable(v).column();
            let caption = plant.spec.variable(v).description.clone();
            let caption = match caption.is_empty() {
                true => "As recorded.".to_owned(),
                false => format!("As recorded: {caption}."),
            };
            let values = drawn.record.inputs[i].as_slice();
            drawn.plot(
                v,
                (format!("{name} (input)"), caption),
                &[(name, "input", values)],
            )
        };
        let outputs = outputs.iter().enumerate().map(of_output);
        outputs
            .chain(inputs.iter().enumerate().map(of_input))
            .collect()
    })
}

/// Residuals one step ahead over time, and their autocorrelations.
pub(super) fn residuals(
    plant: &Plant,
    document: &PlantDocument,
    records: &[PlantRecording],
    found: &Evaluation,
) -> Vec<Group> {
    let outputs = plant.spec.outputs();
    let l = outputs.len();
    let titles = ("residual", "Residuals one step ahead, with the noise model");
    let mut groups = each(plant, document, records, titles, |k, drawn| {
        let of_output = |(o, &v): (usize, &VariableId)| {
            let recorded = &drawn.record.outputs[o];
            let left: Vec<f64> = recorded
                .iter()
                .zip(&found.predicted[k * l + o])
                .map(|(y, p)| y - p)
                .collect();
            let name = plant.spec.variable(v).column();
            let caption = format!(
                "Root mean square {} {}.",
                number(size(left.iter().copied()), 3),
                plant.spec.variable(v).unit_text.clone().unwrap_or_default()
            );
            drawn.plot(
                v,
                (format!("Residual of {name}"), caption),
                &[("residual", "output", &left)],
            )
        };
        outputs.iter().enumerate().map(of_output).collect()
    });
    let plots = outputs.iter().enumerate().map(|(o, &v)| {
        let series: Vec<&[f64]> = found
            .innovations
            .iter()
            .skip(o)
            .step_by(l)
            .map(Vec::as_slice)
            .collect();
        autocorrelation(plant.spec.variable(v).column(), &series)
    });
    groups.push(Group {
        id: "autocorrelation".to_owned(),
        title: "Residuals and their past".to_owned(),
        caption: String::new(),
        plots: plots.collect(),
        folded: false,
        linked: false,
        beside: true,
    });
    groups
}

/// Autocorrelation of a residual, over several recordings.
fn autocorrelation(name: &str, series: &[&[f64]]) -> Plot {
    let count: usize = series.iter().map(|s| s.len()).sum();
    let square: f64 = series.iter().flat_map(|s| s.iter()).map(|e| e * e).sum();
    let longest = series.iter().map(|s| s.len()).max().unwrap_or(0);
    let values: Vec<(f64, f64)> = (1..=LAGS.min(longest.saturating_sub(1)))
        .map(|lag| {
            let sum: f64 = series
                .iter()
                .flat_map(|s| s.iter().zip(s.iter().skip(lag)))
                .map(|(a, b)| a * b)
                .sum();
            (lag as f64, sum / square)
        })
        .collect();
    let bound = interval_quantile(BOUND, None) / (count.max(1) as f64).sqrt();
    let beyond = values.iter().filter(|v| v.1.abs() > bound).count();
    let largest = values.iter().fold(bound, |m, v| m.max(v.1.abs()));
    let limits: Vec<(f64, f64, f64)> = values.iter().map(|v| (v.0, -bound, bound)).collect();
    Plot {
        title: format!("{name} with its own past"),
        caption: format!("{beyond} of {} beyond the bound.", values.len()),
        height: "low",
        drawing: Drawing {
            x: Axis::new("lag", "samples")
                .whole()
                .over(values.iter().map(|v| v.0)),
            y: Axis::new("correlation", "").over([-largest, largest]),
            series: vec![
                Series::marks("residual", "bar-1", Kind::Bars, values).within("99 % bound", limits),
            ],
            ..Drawing::default()
        },
    }
}
