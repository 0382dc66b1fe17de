//! A picture as data: axes, series, shaded windows. `draw.js` draws it with plotly.js; nothing here knows how.

use crate::noise::stand_alone;
use serde::{Serialize, Serializer};

use super::thin::{rounded, thinned};
use super::typeset_number::{fixed, with_unit};

/// Pictures that belong together.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(in crate::report) struct Group {
    /// Unique within the page.
    pub(in crate::report) id: String,
    /// Heading.
    pub(in crate::report) title: String,
    /// What there is to see in all of them; empty where the captions of the pictures say it.
    pub(in crate::report) caption: String,
    /// From top to bottom.
    pub(in crate::report) plots: Vec<Plot>,
    /// Shown only when asked for.
    pub(in crate::report) folded: bool,
    /// Zooming one zooms all of them along the horizontal axis.
    pub(in crate::report) linked: bool,
    /// Side by side where there is room.
    pub(in crate::report) beside: bool,
}

/// One picture.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(in crate::report) struct Plot {
    /// Heading.
    pub(in crate::report) title: String,
    /// What there is to see, in a sentence.
    pub(in crate::report) caption: String,
    /// Class: how high it is.
    pub(in crate::report) height: &'static str,
    /// What is drawn.
    #[serde(serialize_with = "as_script")]
    pub(in crate::report) drawing: Drawing,
}

/// What is drawn.
#[derive(Debug, Clone, PartialEq, Serialize, Default)]
pub(in crate::report) struct Drawing {
    pub(in crate::report) x: Axis,
    pub(in crate::report) y: Axis,
    pub(in crate::report) series: Vec<Series>,
    /// Windows along the horizontal axis.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(in crate::report) shades: Vec<Shade>,
    /// Intervals that are marked along the upper edge, and what they are.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(in crate::report) strips: Vec<Shade>,
    /// A band around zero from left to right.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(in crate::report) stripe: Option<Stripe>,
    /// A dashed line across at this height.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(in crate::report) level: Option<f64>,
    /// Both axes have the same scale, and the unit circle is drawn.
    #[serde(skip_serializing_if = "is_false")]
    pub(in crate::report) unit_circle: bool,
    /// Has the vertical scale of the picture above it.
    #[serde(skip_serializing_if = "is_false")]
    pub(in crate::report) follows: bool,
    /// Narrowest width in pixels; a narrow screen scrolls sideways.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(in crate::report) least_width: Option<usize>,
}

/// One edge of a picture.
#[derive(Debug, Clone, PartialEq, Serialize, Default)]
pub(in crate::report) struct Axis {
    label: String,
    unit: String,
    #[serde(skip_serializing_if = "is_false")]
    logarithmic: bool,
    /// Ends; without them, what is drawn decides.
    #[serde(skip_serializing_if = "Option::is_none")]
    range: Option<[f64; 2]>,
    /// Names in the place of numbers, at 0, 1, 2, ...
    #[serde(skip_serializing_if = "Vec::is_empty")]
    names: Vec<String>,
    /// Values are counts: no fractions on the axis.
    #[serde(skip_serializing_if = "is_false")]
    whole: bool,
    /// Date and time at zero, when values are seconds that are to be shown as dates.
    #[serde(skip_serializing_if = "Option::is_none")]
    since: Option<String>,
}

/// How a series is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Default)]
#[serde(rename_all = "lowercase")]
pub(in crate::report) enum Kind {
    /// A line; several lines where there are gaps.
    #[default]
    Line,
    /// Dots.
    Dots,
    /// Crosses (poles).
    Crosses,
    /// Bars from zero.
    Bars,
}

/// Values in a picture.
#[derive(Debug, Clone, PartialEq, Serialize, Default)]
pub(in crate::report) struct Series {
    pub(in crate::report) name: String,
    /// Colour, width and dashes: a name that `draw.js` knows.
    pub(in crate::report) style: &'static str,
    kind: Kind,
    x: Vec<Option<f64>>,
    y: Vec<Option<f64>>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    bands: Vec<Band>,
    /// No single value is read: a bundle of lines, or an outline.
    #[serde(skip_serializing_if = "is_false")]
    quiet: bool,
    /// What is said of each point; the values where it is empty.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    says: Vec<String>,
    /// What stands at each point in the picture.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    labels: Vec<String>,
}

/// An area around a line.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Band {
    name: String,
    x: Vec<Option<f64>>,
    lower: Vec<Option<f64>>,
    upper: Vec<Option<f64>>,
}

/// An interval along the horizontal axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(in crate::report) struct Shade {
    from: f64,
    to: f64,
    /// Stands in the picture.
    label: String,
    /// What it is, in words.
    title: String,
}

/// A band around zero.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(in crate::report) struct Stripe {
    half: f64,
    name: &'static str,
}

fn is_false(value: &bool) -> bool {
    !value
}

/// JSON that can stand within a script element: nothing in it means anything to HTML.
fn as_script<S: Serializer>(drawing: &Drawing, to: S) -> Result<S::Ok, S::Error> {
    let json = serde_json::to_string(drawing).map_err(serde::ser::Error::custom)?;
    let json = json
        .replace('<', "\\u003c")
        .replace('>', "\\u003e")
        .replace('&', "\\u0026")
        .replace('\'', "\\u0027");
    to.serialize_str(&json)
}

impl Axis {
    /// An axis of numbers; the unit may be empty.
    pub(in crate::report) fn new(label: impl Into<String>, unit: impl Into<String>) -> Self {
        Self {
            label: label.into(),
            unit: unit.into(),
            ..Self::default()
        }
    }

    /// The same on a logarithmic scale, if asked for.
    pub(in crate::report) fn logarithmic(self, logarithmic: bool) -> Self {
        Self {
            logarithmic,
            ..self
        }
    }

    /// The same for counts.
    pub(in crate::report) fn whole(self) -> Self {
        Self {
            whole: true,
            ..self
        }
    }

    /// The same for seconds since a date, which are shown as dates; without one, as they are.
    pub(in crate::report) fn since(self, date: Option<&str>) -> Self {
        match date {
            Some(date) => Self {
                since: Some(date.to_owned()),
                unit: String::new(),
                ..self
            },
            None => self,
        }
    }

    #[cfg(feature = "cli")]
    /// The same with names in the place of numbers.
    pub(in crate::report) fn named(self, names: Vec<String>) -> Self {
        Self { names, ..self }
    }

    /// The same from the smallest to the largest of these values, with room at both ends.
    pub(in crate::report) fn over(self, values: impl IntoIterator<Item = f64>) -> Self {
        Self {
            range: ends(values, self.logarithmic, ROOM),
            ..self
        }
    }

    /// The same from the smallest to the largest of these values.
    pub(in crate::report) fn spanning(self, values: impl IntoIterator<Item = f64>) -> Self {
        Self {
            range: ends(values, self.logarithmic, 0.0),
            ..self
        }
    }
}

/// Room beyond the outermost values, as a share of what they span.
const ROOM: f64 = 0.06;

/// Ends of an axis; `None` without finite values.
fn ends(values: impl IntoIterator<Item = f64>, logarithmic: bool, room: f64) -> Option<[f64; 2]> {
    let (low, high) = values
        .into_iter()
        .filter(|v| v.is_finite() && v.abs() < 1e100 && (!logarithmic || *v > 0.0))
        .map(|v| if logarithmic { v.log10() } else { v })
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
            (low.min(v), high.max(v))
        });
    if low > high {
        return None;
    }
    let size = low.abs().max(high.abs());
    let room = match high - low {
        // A single value still has an axis around it.
        _ if size == 0.0 => 1.0,
        span if span <= 1e-9 * size => 0.05 * size,
        span => room * span,
    };
    let back = |v: f64| if logarithmic { 10f64.powf(v) } else { v };
    Some([back(low - room), back(high + room)])
}

impl Series {
    /// A line, thinned where it has more points than a screen can show; broken where a value is not finite, and dots where most
    /// values stand alone.
    pub(in crate::report) fn line(
        name: impl Into<String>,
        style: &'static str,
        points: impl IntoIterator<Item = (f64, f64)>,
    ) -> Self {
        let mut points: Vec<(f64, f64)> = points.into_iter().collect();
        let known: Vec<bool> = points.iter().map(|(_, y)| y.is_finite()).collect();
        if stand_alone(&known) {
            points.retain(|(_, y)| y.is_finite());
            return Self::of(name, style, Kind::Dots, points);
        }
        Self::of(name, style, Kind::Line, thinned(&points))
    }

    /// A line through points that are few already.
    fn of(
        name: impl Into<String>,
        style: &'static str,
        kind: Kind,
        points: Vec<(f64, f64)>,
    ) -> Self {
        let (x, y): (Vec<f64>, Vec<f64>) = points.into_iter().unzip();
        Self {
            name: name.into(),
            style,
            kind,
            x: rounded(&x),
            y: rounded(&y),
            ..Self::default()
        }
    }

    /// A bundle of lines of one kind, each of them drawn from its own beginning.
    pub(in crate::report) fn bundle(
        name: impl Into<String>,
        style: &'static str,
        lines: impl IntoIterator<Item = Vec<(f64, f64)>>,
    ) -> Self {
        let mut points = Vec::new();
        let mut count = 0;
        for line in lines {
            if count > 0 {
                points.push((f64::NAN, f64::NAN));
            }
            points.extend(thinned(&line));
            count += 1;
        }
        Self {
            quiet: count > 1,
            ..Self::of(name, style, Kind::Line, points)
        }
    }

    /// Points that are not connected.
    pub(in crate::report) fn marks(
        name: impl Into<String>,
        style: &'static str,
        kind: Kind,
        points: impl IntoIterator<Item = (f64, f64)>,
    ) -> Self {
        Self::of(name, style, kind, points.into_iter().collect())
    }

    /// The same with an area: `(at, lower, upper)`.
    pub(in crate::report) fn within(
        mut self,
        name: impl Into<String>,
        limits: impl IntoIterator<Item = (f64, f64, f64)>,
    ) -> Self {
        let limits: Vec<(f64, f64, f64)> = limits
            .into_iter()
            .filter(|(x, low, high)| x.is_finite() && low.is_finite() && high.is_finite())
            .collect();
        let column = |pick: fn(&(f64, f64, f64)) -> f64| {
            rounded(&limits.iter().map(pick).collect::<Vec<f64>>())
        };
        if !limits.is_empty() {
            self.bands.push(Band {
                name: name.into(),
                x: column(|l| l.0),
                lower: column(|l| l.1),
                upper: column(|l| l.2),
            });
        }
        self
    }

    /// The same with words for each point.
    pub(in crate::report) fn saying(mut self, says: Vec<String>) -> Self {
        self.says = says;
        self
    }

    #[cfg(feature = "cli")]
    /// The same with words in the picture, at each point.
    pub(in crate::report) fn labelled(mut self, labels: Vec<String>) -> Self {
        if labels.iter().any(|label| !label.is_empty()) {
            self.labels = labels;
        }
        self
    }

    /// The same as an outline of which no value is read.
    pub(in crate::report) fn quiet(mut self) -> Self {
        self.quiet = true;
        self
    }
}

impl Shade {
    /// An interval; `None` when it is none or lies outside `over`.
    pub(in crate::report) fn new(
        over: [f64; 2],
        [from, to]: [f64; 2],
        label: String,
        title: String,
    ) -> Option<Self> {
        let cut = [from.max(over[0]), to.min(over[1])];
        (from <= to && cut[0] < cut[1]).then_some(Self {
            from: cut[0],
            to: cut[1],
            label,
            title,
        })
    }
}

impl Stripe {
    /// A band from `-half` to `half`.
    pub(in crate::report) fn around_zero(half: f64, name: &'static str) -> Option<Self> {
        (half.is_finite() && half > 0.0).then_some(Self { half, name })
    }
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
        let shade = |from, to| {
            Shade::new([0.0, 10.0], [from, to], String::new(), String::new())
                .map(|s| [s.from, s.to])
        };
        assert_eq!(shade(5.0, 20.0), Some([5.0, 10.0]));
        assert_eq!(shade(11.0, 12.0), None);
        assert_eq!(shade(f64::NAN, f64::NAN), None);
        assert_eq!(shade(4.0, 3.0), None);
    }

    #[test]
    fn values_that_stand_alone_are_dots() {
        let every = |step: usize| {
            let at = |k| {
                if k % step == 0 { k as f64 } else { f64::NAN }
            };
            Series::line("y", "recorded", (0..20).map(|k| (k as f64, at(k))))
        };
        assert_eq!((every(1).kind, every(4).kind), (Kind::Line, Kind::Dots));
        assert_eq!(every(4).x.len(), 5);
    }

    #[test]
    fn intervals_have_the_digits_they_need() {
        assert_eq!(interval(12.04, 20.5, "s"), "12.0 – 20.5\u{a0}s");
        assert_eq!(interval(0.0, 100.0, ""), "0 – 100");
    }

    #[test]
    fn axes_hold_what_is_finite() {
        assert_eq!(ends([f64::NAN], false, 0.0), None);
        assert_eq!(
            ends([0.0, f64::INFINITY, 10.0], false, 0.1),
            Some([-1.0, 11.0])
        );
        let [low, high] = ends([3.0, 3.0], false, 0.0).unwrap();
        assert!(low < 3.0 && high > 3.0);
        assert_eq!(ends([0.0], false, 0.0), Some([-1.0, 1.0]));
        let [low, high] = ends([-1.0, 0.1, 10.0], true, 0.0).unwrap();
        assert!((low - 0.1).abs() < 1e-12 && (high - 10.0).abs() < 1e-9);
    }

    #[test]
    fn nothing_in_a_drawing_ends_the_script_that_it_stands_in() {
        let plot = Plot {
            title: String::new(),
            caption: String::new(),
            height: "low",
            drawing: Drawing {
                series: vec![Series::line("</script><!--&", "first", [(0.0, f64::NAN)])],
                ..Drawing::default()
            },
        };
        let value = serde_json::to_value(&plot).unwrap();
        let text = value["drawing"].as_str().unwrap();
        assert!(!text.contains(['<', '>', '&']));
        let read: serde_json::Value = serde_json::from_str(text).unwrap();
        assert_eq!(read["series"][0]["name"], "</script><!--&");
        assert!(read["series"][0]["y"][0].is_null());
    }
}
