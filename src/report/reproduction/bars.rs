//! Bar charts as SVG in pixels; on a narrow screen the chart scrolls sideways.

use serde::Serialize;

use super::view::typeset;
use crate::report::drawing::number::{exact, number};
use crate::reproduce::Bars;

/// Width of a bar.
const BAR: f64 = 9.0;
/// Space between groups.
const GAP: f64 = 18.0;
/// Height of the area of the bars.
const HEIGHT: f64 = 230.0;
/// Room above it, for the values of bars that are cut.
const TOP: f64 = 40.0;
/// Room below it, for the names of the groups.
const BOTTOM: f64 = 26.0;
/// Room on the left, for the scale.
const LEFT: f64 = 34.0;
/// Colours of bars that the style sheet knows.
const COLOURS: usize = 9;

/// A chart as the template draws it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Chart {
    id: String,
    title: String,
    caption: String,
    quantity: String,
    width: String,
    height: String,
    right: String,
    left: String,
    reference: String,
    description: String,
    ticks: Vec<[String; 2]>,
    groups: Vec<GroupOfBars>,
    legend: Vec<Key>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct Key {
    class: String,
    name: String,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct GroupOfBars {
    name: String,
    middle: String,
    base: String,
    bars: Vec<Bar>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct Bar {
    x: String,
    y: String,
    width: String,
    height: String,
    class: String,
    /// What it is, in words.
    title: String,
    /// Value of a bar that is cut, and where it stands.
    cut: Option<[String; 3]>,
}

fn place(value: f64) -> String {
    format!("{value:.1}")
}

/// The chart of these bars.
pub(super) fn chart(of: &Bars) -> Chart {
    let group_width = BAR * of.series.len() as f64 + GAP;
    let largest = of
        .series
        .iter()
        .flat_map(|s| s.values.iter().flatten())
        .fold(of.reference, |m: f64, v| m.max(*v));
    let top = largest.min(of.cut);
    let level = |value: f64| TOP + HEIGHT * (1.0 - value / top);
    let step = [0.1, 0.2, 0.25, 0.5, 1.0, 2.0, 5.0]
        .into_iter()
        .find(|step| top / step <= 6.0)
        .unwrap_or(10.0);
    let ticks = (0..)
        .map(|k| f64::from(k) * step)
        .take_while(|v| *v <= top * (1.0 + 1e-9))
        .map(|v| [place(level(v)), exact(v)])
        .collect();
    let groups = of
        .groups
        .iter()
        .enumerate()
        .map(|(g, name)| {
            let from = LEFT + g as f64 * group_width + GAP / 2.0;
            let bars = of
                .series
                .iter()
                .enumerate()
                .filter_map(|(k, series)| {
                    let value = (*series.values.get(g)?)?;
                    let (x, shown) = (from + k as f64 * BAR, value.min(top));
                    let cut = (value > top).then(|| {
                        let middle = x + BAR / 2.0;
                        [place(middle), place(TOP - 4.0), number(value, 2)]
                    });
                    Some(Bar {
                        x: place(x + 0.5),
                        y: place(level(shown)),
                        width: place(BAR - 1.0),
                        height: place(level(0.0) - level(shown)),
                        class: class(k),
                        title: format!("{name}, {}: {}", series.name, number(value, 3)),
                        cut,
                    })
                })
                .collect();
            GroupOfBars {
                name: typeset(name),
                middle: place(from + (group_width - GAP) / 2.0),
                base: place(TOP + HEIGHT + 17.0),
                bars,
            }
        })
        .collect();
    let width = LEFT + group_width * of.groups.len() as f64 + GAP;
    let names: Vec<&str> = of.series.iter().map(|s| s.name.as_str()).collect();
    Chart {
        id: of.id.clone(),
        title: of.title.clone(),
        caption: of.caption.clone(),
        quantity: of.quantity.clone(),
        width: place(width),
        height: place(TOP + HEIGHT + BOTTOM),
        right: place(width),
        left: place(LEFT),
        reference: place(level(of.reference)),
        description: format!(
            "{}: bars of {} for {}.",
            of.title,
            names.join(", "),
            of.groups.join(", ")
        ),
        ticks,
        groups,
        legend: names
            .iter()
            .enumerate()
            .map(|(k, name)| Key {
                class: class(k),
                name: (*name).to_owned(),
            })
            .collect(),
    }
}

fn class(series: usize) -> String {
    format!("bar-{}", series % COLOURS + 1)
}
