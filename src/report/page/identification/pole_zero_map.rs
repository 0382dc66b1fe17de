//! Poles and zeros in the z plane, with the ellipses that hold them.

use super::plot::{Axis, Drawing, Group, Kind, Plot, Series};
use super::typeset_number::uncertain;
use crate::covariance::Invariants;
use crate::covariance::{Root, ellipse_quantile};
use crate::identify::Model;

/// Points of an outline.
const POINTS: usize = 72;
/// Zeros and ellipses further out than this are not drawn: sampling puts zeros anywhere on the real axis.
const FARTHEST: f64 = 2.0;
/// A picture of its own for poles that fill less than this share of the unit circle.
const CROWDED: f64 = 0.6;
/// Room around the poles in that picture, as a share of what they span.
const ROOM: f64 = 0.25;

/// The map, and a closer look where the poles are close together.
pub(super) fn map(of: &Invariants, model: &Model) -> Option<Group> {
    let freedom = model.covariance.as_ref().and_then(|c| c.degrees_of_freedom);
    if of.poles.is_empty() {
        return None;
    }
    let ellipses = |level: f64| {
        let size = ellipse_quantile(level, freedom);
        of.poles
            .iter()
            .filter_map(move |root| ellipse(root, size))
            .collect::<Vec<_>>()
    };
    let outlines = [
        ("99 %", "outline_wide", ellipses(0.99)),
        ("95 %", "outline", ellipses(0.95)),
    ];
    let near = |root: &&Root| root.real.hypot(root.imag) <= FARTHEST;
    let far = of.zeros.iter().filter(|zero| !near(zero)).count();
    let mut series: Vec<Series> = outlines
        .iter()
        .filter(|outline| !outline.2.is_empty())
        .map(|(name, style, lines)| Series::bundle(*name, style, lines.clone()).quiet())
        .collect();
    if !of.zeros.is_empty() {
        let zeros = of.zeros.iter().filter(near);
        let says = zeros.clone().map(|z| format!("zero at {}", place(z)));
        series.push(
            Series::marks(
                "zeros",
                "zeros",
                Kind::Dots,
                zeros.clone().map(|z| (z.real, z.imag)),
            )
            .saying(says.collect()),
        );
    }
    series.push(
        Series::marks(
            "poles",
            "first",
            Kind::Crosses,
            of.poles.iter().map(|p| (p.real, p.imag)),
        )
        .saying(of.poles.iter().map(words).collect()),
    );
    let mut caption = "Inside the circle is stable, close to it slowly damped; an ellipse holds its pole with the \
                       probability that it stands for."
        .to_owned();
    if far > 0 {
        caption.push_str(&format!(
            " {far} of {} zeros lie outside the picture.",
            of.zeros.len()
        ));
    }
    let bounds = |pick: fn(&Root) -> f64| {
        let values = of.poles.iter().map(pick).filter(|v| v.is_finite());
        let low = values.clone().fold(f64::INFINITY, f64::min);
        [low, values.fold(f64::NEG_INFINITY, f64::max)]
    };
    let (across, up) = (bounds(|p| p.real), bounds(|p| p.imag));
    let picture = |title: &str, caption: String, x: [f64; 2], y: [f64; 2]| Plot {
        title: title.to_owned(),
        caption,
        height: "square",
        drawing: Drawing {
            x: Axis::new("real part", "").over(x),
            y: Axis::new("imaginary part", "").over(y),
            series: series.clone(),
            unit_circle: true,
            ..Drawing::default()
        },
    };
    let whole = |pick: fn(&Root) -> f64, [low, high]: [f64; 2]| {
        let zeros = of.zeros.iter().filter(near).map(pick);
        zeros.fold([low.min(-1.05), high.max(1.05)], |[low, high], z| {
            [low.min(z), high.max(z)]
        })
    };
    let mut plots = vec![picture(
        "Poles and zeros",
        caption,
        whole(|p| p.real, across),
        whole(|p| p.imag, up),
    )];
    let span = (across[1] - across[0]).max(up[1] - up[0]);
    if span < 2.0 * CROWDED {
        // What the ellipses need, but not those of a pole that is hardly known.
        let room = ROOM * span.max(0.02);
        let wide = outlines[1].2.iter().flatten();
        let reach = |pick: fn(&(f64, f64)) -> f64, [low, high]: [f64; 2]| {
            let ends = wide.clone().map(pick);
            [
                (low - room).min(ends.clone().fold(low, f64::min).max(low - span)),
                (high + room).max(ends.fold(high, f64::max).min(high + span)),
            ]
        };
        plots.push(picture(
            "The poles, closer",
            "The same picture around the poles: the size of an ellipse is what the recording leaves open.".to_owned(),
            reach(|p| p.0, across),
            reach(|p| p.1, up),
        ));
    }
    Some(Group {
        id: "map".to_owned(),
        title: String::new(),
        caption: String::new(),
        plots,
        folded: false,
        linked: false,
        beside: true,
    })
}

fn place(root: &Root) -> String {
    format!(
        "{:.4} {} {:.4}i",
        root.real,
        if root.imag < 0.0 { "−" } else { "+" },
        root.imag.abs()
    )
    .replace('-', "−")
}

fn words(root: &Root) -> String {
    let mut says = format!("pole at {}", place(root));
    if let Some(f) = root.natural_frequency_hz.filter(|_| root.imag != 0.0) {
        says.push_str(&format!(
            ", {} Hz",
            uncertain(f, root.natural_frequency_std)
        ));
    }
    match (root.imag != 0.0, root.damping, root.time_constant_s) {
        (true, Some(damping), _) => {
            says.push_str(&format!(
                ", damping {}",
                uncertain(damping, root.damping_std)
            ));
        }
        (false, _, Some(time)) => {
            says.push_str(&format!(
                ", time constant {} s",
                uncertain(time, root.time_constant_std)
            ));
        }
        _ => {}
    }
    says
}

/// The outline of `x' Cov^-1 x = size` around a root; `None` without a covariance or larger than the picture.
fn ellipse(root: &Root, size: f64) -> Option<Vec<(f64, f64)>> {
    let [[a, b], [_, c]] = root.covariance?;
    // Square root of the covariance by its axes.
    let turn = 0.5 * (2.0 * b).atan2(a - c);
    let (sin, cos) = turn.sin_cos();
    let long = (a * cos * cos + 2.0 * b * sin * cos + c * sin * sin).max(0.0);
    let short = (a * sin * sin - 2.0 * b * sin * cos + c * cos * cos).max(0.0);
    let (long, short) = ((size * long).sqrt(), (size * short).sqrt());
    let drawn = long.is_finite() && long < FARTHEST;
    drawn.then(|| {
        (0..=POINTS)
            .map(|k| {
                let (s, c) = (std::f64::consts::TAU * k as f64 / POINTS as f64).sin_cos();
                let (along, across) = (long * c, short * s);
                (
                    root.real + along * cos - across * sin,
                    root.imag + along * sin + across * cos,
                )
            })
            .collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_ellipse_is_where_the_distance_is_its_size() {
        let root = Root {
            real: 0.5,
            imag: -0.3,
            covariance: Some([[0.02, 0.007], [0.007, 0.01]]),
            natural_frequency_hz: None,
            natural_frequency_std: None,
            damping: None,
            damping_std: None,
            time_constant_s: None,
            time_constant_std: None,
        };
        let inverse = nalgebra::matrix![0.02, 0.007; 0.007, 0.01]
            .try_inverse()
            .unwrap();
        let outline = ellipse(&root, 5.99).unwrap();
        assert_eq!(outline.len(), POINTS + 1);
        for (x, y) in outline {
            let v = nalgebra::vector![x - 0.5, y + 0.3];
            assert!((v.dot(&(inverse * v)) - 5.99).abs() < 1e-9);
        }
        assert_eq!(ellipse(&root, f64::INFINITY), None);
        assert_eq!(
            ellipse(
                &Root {
                    covariance: None,
                    ..root
                },
                5.99
            ),
            None
        );
    }
}
