//! A picture as the template draws it: axes, lines, shaded windows, and words for those who cannot see it.

use serde::Serialize;

use super::axis::{Axis, AxisView, SIZE};
use super::number::{fixed, with_unit};
use super::trace::{area, dots, line};

/// Pictures that share their horizontal axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(in crate::report) struct Group {
    /// Unique within the page.
    pub(in crate::report) id: String,
    /// Heading.
    pub(in crate::report) title: String,
    /// What there is to see.
    pub(in crate::report) caption: String,
    /// From top to bottom.
    pub(in crate::report) plots: Vec<Plot>,
    /// Shown only when asked for.
    pub(in crate::report) folded: bool,
}

/// One picture.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(in crate::report) struct Plot {
    /// Heading.
    pub(in crate::report) title: String,
    /// What it shows, in a sentence.
    pub(in crate::report) description: String,
    pub(in crate::report) x: AxisView,
    pub(in crate::report) y: AxisView,
    pub(in crate::report) series: Vec<Series>,
    pub(in crate::report) shades: Vec<Shade>,
    /// Intervals that are marked along the upper edge.
    pub(in crate::report) strips: Vec<Shade>,
    /// Name and height range of a band from left to right.
    pub(in crate::report) stripe: Option<Stripe>,
    /// Class: how high it is.
    pub(in crate::report) height: &'static str,
    /// Keeps the vertical range of the other pictures of its group.
    pub(in crate::report) same_scale: bool,
    /// Its range comes from a picture above, and its own may be much smaller.
    pub(in crate::report) follows: bool,
}

/// A line in a picture.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(in crate::report) struct Series {
    pub(in crate::report) name: String,
    /// Class in the style sheet: colour, width and dashes.
    pub(in crate::report) class: &'static str,
    pub(in crate::report) path: String,
    /// Area around the line.
    pub(in crate::report) area: Option<String>,
    /// A bundle of lines, of which no single value is read.
    pub(in crate::report) quiet: bool,
}

/// An interval along the horizontal axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(in crate::report) struct Shade {
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
pub(in crate::report) struct Stripe {
    from: String,
    height: String,
    name: &'static str,
}

impl Series {
    /// A line.
    pub(in crate::report) fn line(
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
            quiet: false,
        }
    }

    /// A bundle of lines of one kind, each of them drawn from its own beginning.
    pub(in crate::report) fn bundle(
        name: impl Into<String>,
        class: &'static str,
        axes: (&Axis, &Axis),
        lines: impl IntoIterator<Item = Vec<(f64, f64)>>,
    ) -> Self {
        let paths: Vec<String> = lines
            .into_iter()
            .map(|points| line(axes.0, axes.1, points))
            .collect();
        Self {
            name: name.into(),
            class,
            quiet: paths.len() > 1,
            path: paths.concat(),
            area: None,
        }
    }

    /// The same with an area: `(at, lower, upper)`.
    pub(in crate::report) fn within(
        mut self,
        axes: (&Axis, &Axis),
        limits: &[(f64, f64, f64)],
    ) -> Self {
        self.area = Some(area(axes.0, axes.1, limits));
        self
    }

    /// Dots within an area: `(at, value, deviation)`.
    pub(in crate::report) fn dots_within(
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
            quiet: false,
        }
    }
}

impl Shade {
    /// An interval cut to the axis; `None` outside of it.
    pub(in crate::report) fn new(
        x: &Axis,
        from: f64,
        to: f64,
        label: String,
        title: String,
    ) -> Option<Self> {
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
    pub(in crate::report) fn around_zero(y: &Axis, half: f64, name: &'static str) -> Option<Self> {
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
pub(in crate::report) fn interval(from: f64, to: f64, unit: &str) -> String {
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
