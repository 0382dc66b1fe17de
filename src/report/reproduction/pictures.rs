//! Line pictures of a reproduction.

use crate::report::drawing::axis::Axis;
use crate::report::drawing::plot::{Group, Plot, Series};
use crate::reproduce::{Curve, Figure, Panel, Role};

/// A figure as a group of pictures on common axes, so that panels can be compared.
pub(super) fn group(of: &Figure) -> Option<Group> {
    let values = of.panels.iter().flat_map(|p| &p.curves).flat_map(drawn);
    let x = scaled(Axis::over(of.at.iter().copied())?, of.x.logarithmic);
    let y = scaled(Axis::over(values)?, of.y.logarithmic).padded();
    Some(Group {
        id: of.id.clone(),
        title: of.title.clone(),
        caption: of.caption.clone(),
        plots: of.panels.iter().map(|p| plot(of, p, &x, &y)).collect(),
        folded: false,
    })
}

fn scaled(axis: Axis, logarithmic: bool) -> Axis {
    if logarithmic {
        axis.logarithmic()
    } else {
        axis
    }
}

/// Values that the range of the picture has to hold: lines, not the bands around them, which may reach to minus
/// infinity in decibels.
fn drawn(curve: &Curve) -> impl Iterator<Item = f64> + '_ {
    curve.lines.iter().flatten().filter_map(|v| *v)
}

fn plot(figure: &Figure, panel: &Panel, x: &Axis, y: &Axis) -> Plot {
    let names: Vec<&str> = panel.curves.iter().map(|c| c.name.as_str()).collect();
    let title = match panel.title.as_str() {
        "" => figure.title.clone(),
        title => title.to_owned(),
    };
    Plot {
        description: format!(
            "{title}: {} over {}. Lines: {}.",
            figure.y.label,
            figure.x.label,
            names.join(", ")
        ),
        title,
        x: x.horizontal(&figure.x.label, &figure.x.unit),
        y: y.vertical(&figure.y.label, &figure.y.unit, 5.0),
        series: panel
            .curves
            .iter()
            .map(|c| series(c, &figure.at, x, y))
            .collect(),
        shades: Vec::new(),
        strips: Vec::new(),
        stripe: None,
        height: "middle",
        same_scale: false,
        follows: false,
    }
}

fn series(curve: &Curve, at: &[f64], x: &Axis, y: &Axis) -> Series {
    let class = match curve.role {
        Role::Truth => "truth",
        Role::Runs => "runs",
        Role::First => "first",
        Role::Second => "second",
        Role::Third => "third",
        Role::Fourth => "fourth",
    };
    let lines = curve.lines.iter().map(|line| {
        at.iter()
            .zip(line)
            .map(|(x, v)| (*x, v.unwrap_or(f64::NAN)))
            .collect()
    });
    let series = Series::bundle(&curve.name, class, (x, y), lines);
    match &curve.band {
        None => series,
        Some([lower, upper]) => {
            // A lower limit of zero has no place on a logarithmic scale: the band reaches to the edge.
            let limits: Vec<(f64, f64, f64)> = at
                .iter()
                .zip(lower.iter().zip(upper))
                .filter_map(|(at, (low, high))| Some((*at, low.unwrap_or(y.lowest()), (*high)?)))
                .collect();
            series.within((x, y), &limits)
        }
    }
}
