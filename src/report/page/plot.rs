//! A picture as the template draws it: axes, lines, shaded windows, and words for those who cannot see it.

use serde::Serialize;

use super::axis::{Axis, AxisView, SIZE};
use super::number::{fixed, with_unit};
use super::trace::{area, dots, line};

/// Pictures that share their horizontal axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Group {
    /// Unique within the page.
    pub(super) id: String,
    /// Heading.
    pub(super) title: String,
    /// What there is to see.
    pub(super) caption: String,
    /// From top to bottom.
    pub(super) plots: Vec<Plot>,
    /// Shown only when asked for.
    pub(super) folded: bool,
}

/// One picture.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Plot {
    /// Heading.
    pub(super) title: String,
    /// What it shows, in a sentence.
    pub(super) description: String,
    pub(super) x: AxisView,
    pub(super) y: AxisView,
    pub(super) series: Vec<Series>,
    pub(super) shades: Vec<Shade>,
    /// Intervals that are marked along the upper edge.
    pub(super) strips: Vec<Shade>,
    /// Name and height range of a band from left to right.
    pub(super) stripe: Option<Stripe>,
    /// Class: how high it is.
    pub(super) height: &'static str,
    /// Keeps the vertical range of the other pictures of its group.
    pub(super) same_scale: bool,
    /// Its range comes from a picture above, and its own may be much smaller.
    pub(super) follows: bool,
}

/// A line in a picture.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Series {
    pub(super) name: String,
    /// Class in the style sheet: colour, width and dashes.
    pub(super) class: &'static str,
    pub(super) path: String,
    /// Area around the line.
    pub(super) area: Option<String>,
}

/// An interval along the horizontal axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Shade {
    /// In the picture's coordinates.
    from: String,
    width: String,
    /// Middle, in per cent.
    middle: String,
    label: String,
    /// What it is, in words.
    title: String,
}

/// A band along the vertical axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Stripe {
    from: String,
    height: String,
    name: &'static str,
}

impl Series {
    /// A line.
    pub(super) fn line(
        name: impl Into<String>,
        class: &'static str,
        axes: (&Axis, &Axis),
        points: impl IntoIterator<Item = (f64, f64)>,
    ) -> Self {
        Self {
            name: name.into(),
            class,
            path: line(axes.0, axes.1, points),
            area: None,
        }
    }

    /// Dots within an area: `(at, value, deviation)`.
    pub(super) fn dots_within(
        name: impl Into<String>,
        class: &'static str,
        axes: (&Axis, &Axis),
        points: &[(f64, f64, f64)],
    ) -> Self {
        let around: Vec<_> = points.iter().map(|p| (p.0, p.1 - p.2, p.1 + p.2)).collect();
        Self {
            name: name.into(),
            class,
            path: dots(axes.0, axes.1, points.iter().map(|p| (p.0, p.1))),
            area: Some(area(axes.0, axes.1, &around)),
        }
    }
}

impl Shade {
    /// An interval cut to the axis; `None` outside of it.
    pub(super) fn new(x: &Axis, from: f64, to: f64, label: String, title: String) -> Option<Self> {
        let (a, b) = x.cut(from, to)?;
        Some(Self {
            from: fixed_plain(SIZE * a),
            width: fixed_plain(SIZE * (b - a)),
            middle: format!("{:.2}", 50.0 * (a + b)),
            label,
            title,
        })
    }
}

impl Stripe {
    /// A band from `-half` to `half`.
    pub(super) fn around_zero(y: &Axis, half: f64, name: &'static str) -> Option<Self> {
        let (a, b) = y.cut(-half, half)?;
        (half.is_finite() && half > 0.0).then(|| Self {
            from: fixed_plain(SIZE * (1.0 - b)),
            height: fixed_plain(SIZE * (b - a)),
            name,
        })
    }
}

fn fixed_plain(value: f64) -> String {
    format!("{value:.0}")
}

/// `12.0 – 20.5 s`, with as many digits as tell the two apart.
pub(super) fn interval(from: f64, to: f64, unit: &str) -> String {
    let width = (to - from).abs();
    let decimals = match width {
        w if !w.is_finite() || w <= 0.0 => 2.0,
        w if (10.0..100.0).contains(&w) => 1.0,
        w => (1.0 - w.log10().floor()).clamp(0.0, 6.0),
    } as usize;
    let text = format!("{} – {}", fixed(from, decimals), fixed(to, decimals));
    with_unit(&text, unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shades_are_cut_to_the_picture() {
        let x = Axis::over([0.0, 10.0]).unwrap();
        let shade = Shade::new(&x, 5.0, 20.0, String::new(), String::new()).unwrap();
        assert_eq!(
            (shade.from.as_str(), shade.width.as_str()),
            ("50000", "50000")
        );
        assert!(Shade::new(&x, 11.0, 12.0, String::new(), String::new()).is_none());
    }

    #[test]
    fn intervals_have_the_digits_they_need() {
        assert_eq!(interval(12.04, 20.5, "s"), "12.0 – 20.5\u{a0}s");
        assert_eq!(interval(0.0, 100.0, ""), "0 – 100");
    }
}
