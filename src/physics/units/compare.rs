//! Units as loggers write them, compared with those of a plant or of a simulation.
//!
//! A logger's unit is free text: `ls-1` is l/s, `C` is degC more often than coulomb, `ms-1` is m/s or 1/ms. Every reading counts: two
//! texts differ only if none of their readings agree, and what cannot be read differs from nothing.

use super::symbols::{self, Sized};

/// Sizes that differ by less than this part are equal: conversions are rounded.
const EQUAL: f64 = 1e-3;
/// A longer text is a remark.
const LONGEST: usize = 40;
/// 0 degC in K, and 0 degF.
const ICE: f64 = 273.15;
const FAHRENHEIT_ZERO: f64 = ICE - 32.0 * 5.0 / 9.0;

/// How the unit of one text follows from that of another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Comparison {
    /// The same, or one of them is not known.
    Alike,
    /// One of the first is so many of the second.
    Factor(f64),
    /// The same size, and another zero: add this to numbers in the first.
    Offset(f64),
    /// Another size and another zero: multiply numbers in the first by this, and add that.
    Line(f64, f64),
    /// Different quantities.
    Dimension,
}

/// Spellings of whole units that are no products of symbols, in lower case.
const WHOLE: [(&str, &str); 31] = [
    ("c", "degC"),
    ("°c", "degC"),
    ("celsius", "degC"),
    ("grad c", "degC"),
    ("deg c", "degC"),
    ("degc", "degC"),
    ("f", "degF"),
    ("°f", "degF"),
    ("fahrenheit", "degF"),
    ("deg f", "degF"),
    ("kelvin", "K"),
    ("kmh", "km/h"),
    ("kph", "km/h"),
    ("mps", "m/s"),
    ("rads", "rad/s"),
    ("u/min", "rpm"),
    ("umdr", "rev"),
    ("turn", "rev"),
    ("g", "kgf/kg"),
    ("umdr/min", "rpm"),
    ("rps", "rev/s"),
    ("hz", "rev/s"),
    ("1/min", "rpm"),
    ("min-1", "rpm"),
    ("pct", "%"),
    ("percent", "%"),
    ("degree", "deg"),
    ("degrees", "deg"),
    ("gpm", "gal/min"),
    ("lpm", "l/min"),
    ("lph", "l/h"),
];

/// Spellings of symbols.
const SYMBOLS: [(&str, &str); 9] = [
    ("sec", "s"),
    ("hour", "h"),
    ("days", "d"),
    ("hours", "h"),
    ("inch", "in"),
    ("mile", "mi"),
    ("Nm", "N.m"),
    ("kNm", "kN.m"),
    ("mNm", "mN.m"),
];

/// Compares two units as they are written.
pub(crate) fn compare(one: &str, other: &str) -> Comparison {
    if one.trim() == other.trim() {
        return Comparison::Alike;
    }
    let (ours, theirs) = (readings(one), readings(other));
    let pairs = ours
        .iter()
        .flat_map(|a| theirs.iter().map(move |b| between(a, b)));
    let found: Vec<Option<Comparison>> = pairs.collect();
    if found.contains(&Some(Comparison::Alike)) {
        return Comparison::Alike;
    }
    // A conversion is more likely than another quantity.
    let conversion = |c: &Option<Comparison>| c.filter(|c| *c != Comparison::Dimension);
    let conversion = found.iter().find_map(conversion);
    conversion.unwrap_or(match found.is_empty() || found.contains(&None) {
        true => Comparison::Alike,
        false => Comparison::Dimension,
    })
}

/// Symbols of time other than the second, as far as [`compare`] reads the text: `mm/d` has `d`.
#[cfg(feature = "cli")]
pub(crate) fn slow_time(text: &str) -> Option<&'static str> {
    let symbols = text.split(|c: char| !c.is_alphabetic());
    symbols
        .filter_map(|s| {
            let hours = s.ends_with("Wh") || s.ends_with("Ah");
            let symbol = if hours { "h" } else { s };
            ["min", "h", "hr", "d", "day"]
                .into_iter()
                .find(|t| *t == symbol)
        })
        .next()
}

/// A conversion to seven digits, without those that are zero: 86400, 3.6.
pub(crate) fn rounded(factor: f64) -> String {
    let digits = format!("{factor:.6e}").parse::<f64>();
    digits.map_or_else(|_| factor.to_string(), |v| v.to_string())
}

/// A unit and its zero.
#[derive(Debug, Clone, Copy)]
struct Reading {
    sized: Sized,
    zero: f64,
}

/// Two readings; none where the factor between them is not known.
fn between(a: &Reading, b: &Reading) -> Option<Comparison> {
    if !a.sized.unit.same(&b.sized.unit) {
        return Some(Comparison::Dimension);
    }
    let factor = a.sized.size / b.sized.size;
    // A number may be an angle in any unit.
    if !factor.is_finite() || (a.sized.angle - b.sized.angle).abs() > EQUAL {
        return None;
    }
    let offset = (a.zero - b.zero) / b.sized.size;
    Some(match ((factor - 1.0).abs() > EQUAL, offset != 0.0) {
        (false, false) => Comparison::Alike,
        (false, true) => Comparison::Offset(offset),
        (true, false) => Comparison::Factor(factor),
        (true, true) => Comparison::Line(factor, offset),
    })
}

/// What a text may mean; nothing where it is not known.
fn readings(text: &str) -> Vec<Reading> {
    let text = text.trim();
    if text.is_empty() || text.chars().count() > LONGEST {
        return vec![];
    }
    let lower = text.to_lowercase();
    let whole = WHOLE.iter().find(|w| w.0 == lower).map(|w| w.1.to_owned());
    let candidates = [Some(text.to_owned()), whole, product(text)];
    let mut found: Vec<Reading> = Vec::new();
    for candidate in candidates.into_iter().flatten() {
        if let Some(sized) = symbols::parse(&candidate) {
            let zero = match candidate.as_str() {
                "degC" | "°C" => ICE,
                "degF" => FAHRENHEIT_ZERO,
                _ => 0.0,
            };
            found.push(Reading { sized, zero });
        }
    }
    found
}

/// A product whose points are left out or blanks: `mm d-1`, `ls-1`, `Jkg-1K-1`. Two symbols in one are told apart only before an
/// exponent below zero; `ls` alone may be a word.
fn product(text: &str) -> Option<String> {
    let text = text.replace(['⁻', '−'], "-").replace('¹', "1");
    let mut answer = String::new();
    let mut rest = text.as_str();
    while let Some(first) = rest.chars().next() {
        if !first.is_alphabetic() {
            let blank = first.is_whitespace();
            if !blank {
                answer.push(first);
            } else if !answer.ends_with(['.', '/', '*', '·', '(']) {
                answer.push('.');
            }
            rest = &rest[first.len_utf8()..];
            continue;
        }
        if answer.ends_with(|c: char| c.is_ascii_digit() || matches!(c, '²' | '³')) {
            answer.push('.');
        }
        let length = rest.find(|c: char| !c.is_alphabetic());
        let (symbol, after) = rest.split_at(length.unwrap_or(rest.len()));
        let inverse = after.trim_start_matches('^').starts_with('-');
        answer += &spelled(symbol, inverse)?;
        rest = after;
    }
    Some(answer)
}

/// A symbol, or two where `inverse` says that the last one divides.
fn spelled(written: &str, inverse: bool) -> Option<String> {
    if let Some((_, symbol)) = SYMBOLS.iter().find(|s| s.0 == written) {
        return Some((*symbol).to_owned());
    }
    if inverse && let Some((above, below)) = two(written) {
        return Some(format!("{above}.{below}"));
    }
    symbols::find(written).map(|_| written.to_owned())
}

/// The first of two known symbols is as long as it can be: `kgh` is kg and h.
fn two(written: &str) -> Option<(&str, &str)> {
    let places = written.char_indices().rev().filter(|(at, _)| *at > 0);
    let mut split = places.map(|(at, _)| written.split_at(at));
    split.find(|(a, b)| symbols::find(a).is_some() && symbols::find(b).is_some())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spellings_of_one_unit_are_alike() {
        for (a, b) in [
            ("l/s", "ls-1"),
            ("m3/h", "m3h-1"),
            ("m³/h", "m3 h-1"),
            ("kg/h", "kgh-1"),
            ("W/m2", "Wm-2"),
            ("W/m2", "W m^-2"),
            ("W/m^2", "W/m²"),
            ("mm/d", "mm d-1"),
            ("mm/d", "mmd⁻¹"),
            ("m/s", "ms-1"),
            ("J/(kg.K)", "Jkg-1K-1"),
            ("J/(kg.K)", "J/kg/K"),
            ("degC", "C"),
            ("°C", "Celsius"),
            ("km/h", "kmh"),
            ("N.m", "Nm"),
            ("%", "percent"),
            ("m/s", "m/sec"),
            ("rpm", "U/min"),
            ("rpm", "1/min"),
            ("rad/s", "1/s"),
            // Not known.
            ("counts", "m"),
            ("set point", "degC"),
            ("gal", "l"),
            ("", "V"),
        ] {
            assert_eq!(compare(a, b), Comparison::Alike, "{a} {b}");
            assert_eq!(compare(b, a), Comparison::Alike, "{b} {a}");
        }
    }

    #[test]
    fn factors_zeros_and_quantities_are_told() {
        for (a, b, expected) in [
            ("km/h", "m/s", 1.0 / 3.6),
            ("kmh", "m/s", 1.0 / 3.6),
            ("km/h", "ms-1", 1.0 / 3.6),
            ("mm", "m", 1e-3),
            ("deg", "rad", std::f64::consts::PI / 180.0),
            ("rpm", "rad/s", std::f64::consts::PI / 30.0),
            ("1/min", "rad/s", std::f64::consts::PI / 30.0),
            ("Hz", "rad/s", std::f64::consts::TAU),
            ("rpm", "Hz", 1.0 / 60.0),
            ("kW", "W", 1e3),
            ("bar", "kPa", 100.0),
            ("l/min", "m3/h", 0.06),
            ("ls-1", "m3/h", 3.6),
            ("mA.h", "C", 3.6),
            ("%", "1", 0.01),
            ("g", "m/s2", 9.80665),
            ("mph", "km/h", 1.609344),
        ] {
            let Comparison::Factor(found) = compare(a, b) else {
                panic!("{a} {b}: {:?}", compare(a, b));
            };
            assert!((found / expected - 1.0).abs() < 1e-9, "{a} {b}: {found}");
        }
        assert_eq!(compare("°C", "K"), Comparison::Offset(ICE));
        let Comparison::Line(factor, offset) = compare("degC", "°F") else {
            panic!("{:?}", compare("degC", "°F"));
        };
        assert!((factor - 1.8).abs() < 1e-12 && (offset - 32.0).abs() < 1e-9);
        assert_eq!(compare("K", "degC"), Comparison::Offset(-ICE));
        for (a, b) in [("mm", "m/s"), ("V", "A"), ("N", "N.m"), ("kW.h", "kW")] {
            assert_eq!(compare(a, b), Comparison::Dimension, "{a} {b}");
        }
    }
}
