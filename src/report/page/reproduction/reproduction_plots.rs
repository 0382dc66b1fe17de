//! Lines and bars of a reproduction.

use super::plot::{Axis, Drawing, Group, Kind, Plot, Series};
use super::typeset_number::{number, typeset};
use crate::reproduce::{Bars, Curve, Figure, Panel, Role};

/// Styles of bars that `draw.js` knows, in the order of the kinds.
const BARS: [&str; 9] = [
    "bar-1", "bar-2", "bar-3", "bar-4", "bar-5", "bar-6", "bar-7", "bar-8", "bar-9",
];
/// Pixels of a bar, and of the space between groups, below which a chart scrolls sideways.
const BAR_PIXELS: usize = 8;
const GAP_PIXELS: usize = 16;
/// Share of the length of the longest bar shown that is left for the values of those that are cut.
const ROOM_FOR_VALUES: f64 = 0.16;

/// A figure as a group of pictures on common axes, so that panels can be compared.
pub(super) fn figure(of: &Figure) -> Group {
    let curves = || of.panels.iter().flat_map(|p| &p.curves);
    let y = axis(&of.y).over(curves().flat_map(drawn));
    let x = axis(&of.x).spanning(of.at.iter().copied());
    // A lower limit of zero has no place on a logarithmic scale: the band reaches to the edge.
    let lowest = curves()
        .flat_map(drawn)
        .filter(|v| *v > 0.0 || !of.y.logarithmic)
        .fold(f64::INFINITY, f64::min);
    let lowest = if of.y.logarithmic {
        lowest / 1e3
    } else {
        lowest - 1e3
    };
    Group {
        id: of.id.clone(),
        title: of.title.clone(),
        caption: of.caption.clone(),
        plots: of
            .panels
            .iter()
            .map(|p| panel(of, p, &x, &y, lowest))
            .collect(),
        folded: false,
        linked: false,
        beside: of.panels.len() > 1,
    }
}

fn axis(of: &crate::reproduce::Quantity) -> Axis {
    Axis::new(&of.label, &of.unit).logarithmic(of.logarithmic)
}

/// Values that the range of the picture has to hold: lines, not the bands around them, which may reach to minus
/// infinity in decibels.
fn drawn(curve: &Curve) -> impl Iterator<Item = f64> + '_ {
    curve.lines.iter().flatten().filter_map(|v| *v)
}

fn panel(figure: &Figure, panel: &Panel, x: &Axis, y: &Axis, lowest: f64) -> Plot {
    let names: Vec<&str> = panel.curves.iter().map(|c| c.name.as_str()).collect();
    let title = match panel.title.as_str() {
        "" => figure.title.clone(),
        title => title.to_owned(),
    };
    let curves = panel.curves.iter();
    Plot {
        title,
        caption: format!(
            "{} over {}: {}.",
            typeset(&figure.y.label),
            figure.x.label,
            names.join(", ")
        ),
        height: "middle",
        drawing: Drawing {
            x: x.clone(),
            y: y.clone(),
            series: curves.map(|c| series(c, &figure.at, lowest)).collect(),
            ..Drawing::default()
        },
    }
}

fn series(curve: &Curve, at: &[f64], lowest: f64) -> Series {
    let style = match curve.role {
        Role::Truth => "truth",
        Role::Runs => "runs",
        Role::First => "first",
        Role::Second => "second",
        Role::Third => "third",
    };
    let lines = curve.lines.iter().map(|line| {
        at.iter()
            .zip(line)
            .map(|(x, v)| (*x, v.unwrap_or(f64::NAN)))
            .collect()
    });
    let series = Series::bundle(&curve.name, style, lines);
    match &curve.band {
        None => series,
        Some([lower, upper]) => {
            let limits = at.iter().zip(lower.iter().zip(upper));
            let limits =
                limits.filter_map(|(at, (low, high))| Some((*at, low.unwrap_or(lowest), (*high)?)));
            // The name of the line says what its band is.
            series.within("", limits)
        }
    }
}

/// The bars as a group of one picture.
pub(super) fn bars(of: &Bars) -> Group {
    let longest = of
        .series
        .iter()
        .flat_map(|s| s.values.iter().flatten())
        .fold(of.reference, |m: f64, v| m.max(*v));
    let top = longest.min(of.cut);
    let room = if longest > top { ROOM_FOR_VALUES } else { 0.0 };
    let series = of.series.iter().enumerate().map(|(k, series)| {
        let values = || series.values.iter().copied().zip(&of.groups).enumerate();
        let bars =
            values().map(|(g, (value, _))| (g as f64, value.map_or(f64::NAN, |v| v.min(top))));
        let says = values().map(|(_, (value, group))| {
            value.map_or_else(String::new, |v| {
                format!("{}: {}", typeset(group), number(v, 3))
            })
        });
        let labels = values().map(|(_, (value, _))| {
            value
                .filter(|v| *v > top)
                .map_or_else(String::new, |v| number(v, 2))
        });
        Series::marks(&series.name, BARS[k % BARS.len()], Kind::Bars, bars)
            .saying(says.collect())
            .labelled(labels.collect())
    });
    Group {
        id: of.id.clone(),
        title: of.title.clone(),
        caption: String::new(),
        plots: vec![Plot {
            title: of.quantity.clone(),
            caption: of.caption.clone(),
            height: "middle",
            drawing: Drawing {
                x: Axis::default().named(of.groups.iter().map(|g| typeset(g)).collect()),
                y: Axis::new(&of.quantity, "").spanning([0.0, top * (1.0 + room)]),
                series: series.collect(),
                level: Some(of.reference),
                least_width: Some(
                    of.groups.len() * (of.series.len() * BAR_PIXELS + GAP_PIXELS) + 80,
                ),
                ..Drawing::default()
            },
        }],
        folded: false,
        linked: false,
        beside: false,
    }
}
