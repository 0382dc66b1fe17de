//! Singular values, criteria of the order, criteria of the past window.

use super::grid;
use super::plot::{Axis, Drawing, Group, Kind, Plot, Series};
use super::typeset_number::number;
use crate::identify::Summary;

/// Singular values shown beyond the order, at least and as a multiple of it.
const BEYOND: usize = 12;
const TIMES: usize = 4;

/// The evidence as pictures.
pub(super) fn pictures(of: &Summary) -> Vec<Group> {
    let plots = [singular_values(of), criteria(of), windows(of)];
    grid("evidence", "", plots.into_iter().flatten().collect())
}

fn singular_values(of: &Summary) -> Option<Plot> {
    let values = &of.diagnostics.singular_values;
    let shown = (of.order + BEYOND).max(TIMES * of.order).min(values.len());
    let points: Vec<(f64, f64)> = (1..)
        .map(f64::from)
        .zip(values[..shown].iter().copied())
        .collect();
    let (kept, left) = points.split_at(of.order.min(shown));
    if points.is_empty() {
        return None;
    }
    let ratio = match (kept.last(), left.first()) {
        (Some(last), Some(next)) if last.1 > 0.0 => format!(
            "; the next is {} of the last of them",
            number(next.1 / last.1, 2)
        ),
        _ => String::new(),
    };
    Some(Plot {
        title: "Singular values".to_owned(),
        caption: format!(
            "One state for each that stands out: the first {} are kept{ratio}.",
            of.order
        ),
        height: "middle",
        drawing: Drawing {
            x: Axis::new("number", "")
                .whole()
                .over(points.iter().map(|p| p.0)),
            y: Axis::new("singular value", "")
                .logarithmic(true)
                .over(points.iter().map(|p| p.1)),
            series: vec![
                Series::marks("kept", "chosen", Kind::Dots, kept.to_vec()),
                Series::marks("left out", "plain", Kind::Dots, left.to_vec()),
            ],
            ..Drawing::default()
        },
    })
}

fn criteria(of: &Summary) -> Option<Plot> {
    let mut points: Vec<(f64, f64)> = of
        .diagnostics
        .orders
        .iter()
        // An order beyond what the singular values reach has no criterion.
        .filter(|e| e.singular_value_criterion < f64::MAX)
        .map(|e| (e.order as f64, e.singular_value_criterion))
        .collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let best = points.iter().min_by(|a, b| a.1.total_cmp(&b.1))?.0;
    let chosen = of.order as f64;
    let says = match best == chosen {
        true => format!("Smallest at the order that was chosen, {chosen}."),
        false => {
            format!("Smallest at {best}; order {chosen} was chosen for the reasons given above.")
        }
    };
    let at = points.iter().copied().filter(|p| p.0 == chosen);
    Some(Plot {
        title: "Criterion of the order".to_owned(),
        caption: says,
        height: "middle",
        drawing: Drawing {
            x: Axis::new("order", "")
                .whole()
                .over(points.iter().map(|p| p.0)),
            y: Axis::new("singular value criterion", "").over(points.iter().map(|p| p.1)),
            series: vec![
                Series::line("criterion", "plain", points.clone()),
                Series::marks("chosen", "chosen", Kind::Dots, at),
            ],
            ..Drawing::default()
        },
    })
}

fn windows(of: &Summary) -> Option<Plot> {
    let points: Vec<(f64, f64)> = of
        .diagnostics
        .past_windows
        .iter()
        .map(|e| (e.past as f64, e.akaike))
        .filter(|p| p.1.is_finite())
        .collect();
    let best = *points.iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(Plot {
        title: "Criterion of the past window".to_owned(),
        caption: format!(
            "How many past samples the present depends on: smallest at {}; {} are used.",
            best.0, of.horizons.past
        ),
        height: "middle",
        drawing: Drawing {
            x: Axis::new("past window", "samples")
                .whole()
                .over(points.iter().map(|p| p.0)),
            y: Axis::new("Akaike’s criterion", "").over(points.iter().map(|p| p.1)),
            series: vec![
                Series::line("criterion", "plain", points.clone()),
                Series::marks("smallest", "chosen", Kind::Dots, [best]),
            ],
            ..Drawing::default()
        },
    })
}
