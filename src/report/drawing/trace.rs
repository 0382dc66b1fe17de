//! Lines of a picture as SVG path data, in whole numbers so that the page stays small.
//!
//! The script of the page reads values back from these paths: `M x y` starts a piece, `l` goes on by differences.

use std::fmt::Write as _;

use super::axis::{Axis, SIZE};

/// A point in the coordinates of the picture; `None` where there is none to draw.
fn point(x: &Axis, y: &Axis, at: f64, value: f64) -> Option<(i64, i64)> {
    let (a, b) = (x.share(at), y.share(value));
    // Far outside is not drawn; just outside is cut by the picture's edge.
    let drawn = a.is_finite() && b.is_finite() && a.abs() < 10.0 && b.abs() < 10.0;
    drawn.then(|| ((SIZE * a).round() as i64, (SIZE * (1.0 - b)).round() as i64))
}

/// A line through the points; it is broken where a value is not finite.
pub(in crate::report) fn line(
    x: &Axis,
    y: &Axis,
    points: impl IntoIterator<Item = (f64, f64)>,
) -> String {
    let mut path = String::new();
    let mut last: Option<(i64, i64)> = None;
    let mut fresh = true;
    for (at, value) in points {
        let here = point(x, y, at, value);
        if let Some((a, b)) = here {
            match last {
                Some((c, d)) => {
                    let (a, b) = (a - c, b - d);
                    let letter = match (fresh, a < 0) {
                        (true, _) => "l",
                        (false, true) => "",
                        (false, false) => " ",
                    };
                    let space = if b < 0 { "" } else { " " };
                    // Writing to a string cannot fail.
                    let _ = write!(path, "{letter}{a}{space}{b}");
                    fresh = false;
                }
                None => {
                    let _ = write!(path, "M{a} {b}");
                    fresh = true;
                }
            }
        }
        last = here;
    }
    path
}

/// Dots at the points: lines without length, which round caps make round at any scale.
pub(in crate::report) fn dots(
    x: &Axis,
    y: &Axis,
    points: impl IntoIterator<Item = (f64, f64)>,
) -> String {
    points
        .into_iter()
        .filter_map(|(at, value)| point(x, y, at, value))
        .map(|(a, b)| format!("M{a} {b}h0"))
        .collect()
}

/// The area between two lines over the same places.
pub(in crate::report) fn area(x: &Axis, y: &Axis, points: &[(f64, f64, f64)]) -> String {
    let upper = points.iter().filter_map(|p| point(x, y, p.0, p.2));
    let lower = points.iter().rev().filter_map(|p| point(x, y, p.0, p.1));
    let mut path = String::new();
    for (a, b) in upper.chain(lower) {
        let letter = if path.is_empty() { 'M' } else { 'L' };
        let _ = write!(path, "{letter}{a} {b}");
    }
    if !path.is_empty() {
        path.push('Z');
    }
    path
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit() -> Axis {
        Axis::over([0.0, 1.0]).unwrap()
    }

    #[test]
    fn lines_go_on_by_differences() {
        let path = line(
            &unit(),
            &unit(),
            [(0.0, 0.0), (0.5, 1.0), (1.0, 0.5), (0.5, 0.5)],
        );
        assert_eq!(path, "M0 100000l50000-100000 50000 50000-50000 0");
    }

    #[test]
    fn gaps_break_a_line() {
        let path = line(
            &unit(),
            &unit(),
            [(0.0, 0.0), (0.2, f64::NAN), (0.5, 1.0), (1.0, 1.0)],
        );
        assert_eq!(path, "M0 100000M50000 0l50000 0");
    }

    #[test]
    fn areas_close() {
        let path = area(&unit(), &unit(), &[(0.0, 0.0, 1.0), (1.0, 0.0, 1.0)]);
        assert_eq!(path, "M0 0L100000 0L100000 100000L0 100000Z");
        assert_eq!(area(&unit(), &unit(), &[]), "");
        assert_eq!(dots(&unit(), &unit(), [(0.0, 1.0)]), "M0 0h0");
    }
}
