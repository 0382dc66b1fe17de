//! The pictures over time: recording against simulation against what was found, and what each leaves.

use super::plot::{Axis, Drawing, Group, Plot, Series, Shade, Stripe, interval};
use crate::explain::{Explanation, SignalTraces, Verdict};

/// Groups beyond this many are folded away.
const SHOWN: usize = 3;
/// Windows beyond this many are not labelled with a number.
const NUMBERED: usize = 9;

/// One model's answer.
struct Answer<'a> {
    name: &'static str,
    class: &'static str,
    values: &'a [f64],
}

/// A group of pictures for each output and recording, those that differ first.
pub(super) fn groups(of: &Explanation) -> Vec<Group> {
    let mut traces: Vec<&SignalTraces> = of.signals.iter().collect();
    traces.sort_by_key(|s| {
        let differs = of.location.outputs.contains(&s.output);
        (s.output != of.fit.output, !differs, s.recording)
    });
    let mut groups: Vec<Group> = traces.iter().filter_map(|s| group(of, s)).collect();
    for (k, group) in groups.iter_mut().enumerate() {
        group.id = format!("signal-{k}");
        group.folded = k >= SHOWN;
    }
    groups
}

/// What is drawn beside the recording: only what differs from what is drawn already.
pub(super) fn answers_differ(a: &[f64], b: &[f64]) -> bool {
    let size = b.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    a.len() != b.len() || a.iter().zip(b).any(|(a, b)| (a - b).abs() > 1e-9 * size)
}

/// The name of the last model of a verdict.
pub(super) fn augmented_name(of: Verdict) -> &'static str {
    match of {
        Verdict::Named | Verdict::Family => "with the effect",
        Verdict::Unexplained => "with the learned curve",
        Verdict::Consistent | Verdict::Parameters => "with other parameters",
    }
}

fn answers(verdict: Verdict, s: &SignalTraces, samples: usize) -> Vec<Answer<'_>> {
    let all = [
        ("simulation", "simulation", &s.simulated),
        ("parameters only", "parameters", &s.parameters_only),
        (augmented_name(verdict), "augmented", &s.augmented),
    ];
    let mut answers: Vec<Answer> = Vec::new();
    for (name, class, values) in all {
        let values = values.as_slice();
        let known = answers.iter().any(|a| !answers_differ(a.values, values));
        if values.len() >= samples && !known {
            answers.push(Answer {
                name,
                class,
                values,
            });
        }
    }
    match verdict {
        // Nothing beyond noise: other models have nothing to show.
        Verdict::Consistent => answers.truncate(1),
        // The refitted simulation is what was found.
        Verdict::Parameters => {
            if let [.., last] = answers.as_mut_slice()
                && last.class == "parameters"
            {
                *last = Answer {
                    name: augmented_name(verdict),
                    class: "augmented",
                    values: last.values,
                };
            }
        }
        Verdict::Named | Verdict::Family | Verdict::Unexplained => {}
    }
    answers
}

fn group(of: &Explanation, s: &SignalTraces) -> Option<Group> {
    let samples = s.time.len().min(s.recorded.len());
    let (time, recorded) = (s.time.get(..samples)?, s.recorded.get(..samples)?);
    let answers = answers(of.verdict, s, samples);
    let over = [*time.first()?, *time.last()?];
    let drawn = answers.iter().flat_map(|a| &a.values[..samples]);
    let draw = |values: &[f64]| -> Vec<(f64, f64)> {
        time.iter().copied().zip(values.iter().copied()).collect()
    };
    let mut series = vec![Series::line("recorded", "recorded", draw(recorded))];
    for a in &answers {
        series.push(Series::line(a.name, a.class, draw(a.values)));
    }
    let windows = windows(of, over);
    let mut plots = vec![Plot {
        title: "Recording and models".to_owned(),
        caption: format!(
            "{} over {}: the recording is the thick line; where a thin one leaves it, that model lacks something.",
            s.output,
            interval(over[0], over[1], "s")
        ),
        height: "tall",
        drawing: Drawing {
            x: Axis::new("time", "s").spanning(over),
            y: Axis::new(&s.output, &s.unit).over(recorded.iter().chain(drawn).copied()),
            series,
            shades: windows.clone(),
            ..Drawing::default()
        },
    }];
    plots.extend(residuals(of, s, recorded, time, &answers, &windows));
    Some(Group {
        id: String::new(),
        title: title(of, s),
        caption: caption(of, &plots),
        plots,
        folded: false,
        linked: true,
        beside: false,
    })
}

fn title(of: &Explanation, s: &SignalTraces) -> String {
    if of.recordings.len() < 2 {
        return s.output.clone();
    }
    match of.recordings.get(s.recording) {
        Some(recording) => format!("{} in {}", s.output, recording.name),
        None => format!("{} in recording {}", s.output, s.recording + 1),
    }
}

fn windows(of: &Explanation, over: [f64; 2]) -> Vec<Shade> {
    let strongest = of.location.time.iter().enumerate();
    strongest
        .filter_map(|(k, [from, to, _])| {
            let label = if k < NUMBERED {
                (k + 1).to_string()
            } else {
                String::new()
            };
            let title = format!(
                "differs most, window {}: {}",
                k + 1,
                interval(*from, *to, "s")
            );
            Shade::new(over, [*from, *to], label, title)
        })
        .collect()
}

fn held_out(of: &Explanation, over: [f64; 2]) -> Vec<Shade> {
    let blocks = of.fit.heldout_blocks.iter();
    blocks
        .filter_map(|block| {
            let title = format!("never fitted: {}", interval(block[0], block[1], "s"));
            Shade::new(over, *block, String::new(), title)
        })
        .collect()
}

fn residuals(
    of: &Explanation,
    s: &SignalTraces,
    recorded: &[f64],
    time: &[f64],
    answers: &[Answer],
    windows: &[Shade],
) -> Vec<Plot> {
    let (Some(first), Some(end)) = (time.first(), time.last()) else {
        return Vec::new();
    };
    let over = [*first, *end];
    let left: Vec<Vec<f64>> = answers
        .iter()
        .map(|a| recorded.iter().zip(a.values).map(|(y, m)| y - m).collect())
        .collect();
    let noise = (s.output == of.fit.output).then_some(of.fit.train.noise_floor.rmse);
    let last = answers.len() - 1;
    let mut plots: Vec<Plot> = Vec::new();
    for (k, (answer, values)) in answers.iter().zip(&left).enumerate() {
        let points = time.iter().copied().zip(values.iter().copied());
        let style = match answer.class {
            "simulation" => "before",
            "parameters" => "between",
            _ => "after",
        };
        let series = Series::line(answer.name, style, points);
        match plots.first_mut() {
            // What other parameters alone leave stands beside what the simulation leaves.
            Some(before) if k < last => before.drawing.series.push(series),
            _ => plots.push(Plot {
                title: match (k, last) {
                    (0, 0) => "What the simulation leaves",
                    (0, _) => "Residual before",
                    _ if answer.class == "parameters" => "Residual with other parameters",
                    _ => "Residual after",
                }
                .to_owned(),
                caption: match k {
                    0 => "Recording minus model: what reaches beyond the grey band is more than noise.",
                    _ => "The same with what was found, on the same scale: the less is left of the pattern above, the \
                          more of it is explained.",
                }
                .to_owned(),
                height: "low",
                drawing: Drawing {
                    x: Axis::new("time", "s").spanning(over),
                    y: Axis::new("residual", &s.unit).over(left.iter().flatten().copied()),
                    series: vec![series],
                    shades: windows.to_vec(),
                    strips: held_out(of, over),
                    stripe: noise
                        .and_then(|n| Stripe::around_zero(2.0 * n, "noise, ± 2 deviations")),
                    follows: k > 0,
                    ..Drawing::default()
                },
            }),
        }
    }
    plots
}

fn caption(of: &Explanation, plots: &[Plot]) -> String {
    let mut says = Vec::new();
    let shaded = |p: &Plot| !p.drawing.shades.is_empty();
    if plots.iter().any(shaded) {
        says.push("Shaded and numbered: the windows in which they differ most, strongest first.");
    } else if of.location.time.is_empty() && !of.location.outputs.is_empty() {
        says.push("They differ throughout, not in single windows.");
    }
    if plots.iter().any(|p| p.drawing.stripe.is_some()) {
        says.push("Grey band around zero: what noise alone does, two standard deviations.");
    }
    if plots.iter().any(|p| !p.drawing.strips.is_empty()) {
        says.push("Bars along the upper edge: blocks that were never fitted.");
    }
    says.join(" ")
}
