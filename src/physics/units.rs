//! Units: products of powers of the seven base units. In a [`Unit`] only dimensions count; `compare` and `seconds` know factors (milli, hour, degree).

mod check;
mod compare;
mod infer;
#[cfg(feature = "cli")]
mod seconds;
mod symbols;
#[cfg(test)]
mod tests;
mod types;
mod unknown;
mod words;

pub use check::check_units;
pub(crate) use check::unit_conflicts;
pub(crate) use compare::{Comparison, compare, rounded};
pub(crate) use infer::units_in_words;
#[cfg(feature = "cli")]
pub(crate) use seconds::other_clock;
pub(crate) use types::type_unit;
pub use unknown::{UnknownUnit, unknown_units};

use std::fmt;

const BASES: [&str; 7] = ["m", "kg", "s", "A", "K", "mol", "cd"];

/// Difference of exponents that is rounding.
const TOLERANCE: f64 = 1e-6;

/// Largest exponent that is followed.
const LARGEST: f64 = 1e6;

/// Derived units by which a dimension is called, and their exponents.
const NAMED: [(&str, [i8; 7]); 19] = [
    ("N", [1, 1, -2, 0, 0, 0, 0]),
    ("N.m", [2, 1, -2, 0, 0, 0, 0]),
    ("W", [2, 1, -3, 0, 0, 0, 0]),
    ("Pa", [-1, 1, -2, 0, 0, 0, 0]),
    ("V", [2, 1, -3, -1, 0, 0, 0]),
    ("C", [0, 0, 1, 1, 0, 0, 0]),
    ("Ohm", [2, 1, -3, -2, 0, 0, 0]),
    ("S", [-2, -1, 3, 2, 0, 0, 0]),
    ("F", [-2, -1, 4, 2, 0, 0, 0]),
    ("H", [2, 1, -2, -2, 0, 0, 0]),
    ("Wb", [2, 1, -2, -1, 0, 0, 0]),
    ("T", [0, 1, -2, -1, 0, 0, 0]),
    ("N/m", [0, 1, -2, 0, 0, 0, 0]),
    ("N.s/m", [0, 1, -1, 0, 0, 0, 0]),
    ("N.m.s", [2, 1, -1, 0, 0, 0, 0]),
    ("W/K", [2, 1, -3, 0, -1, 0, 0]),
    ("J/K", [2, 1, -2, 0, -1, 0, 0]),
    ("V/s", [2, 1, -4, -1, 0, 0, 0]),
    ("A/s", [0, 0, -1, 1, 0, 0, 0]),
];

/// A dimension: exponents of metre, kilogram, second, ampere, kelvin, mole and candela.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Unit {
    exponents: [f64; 7],
}

impl Unit {
    /// A pure number.
    pub const ONE: Unit = Unit {
        exponents: [0.0; 7],
    };

    /// The second.
    pub const SECOND: Unit = Unit {
        exponents: [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
    };

    pub(crate) const fn from_exponents(exponents: [f64; 7]) -> Self {
        Self { exponents }
    }

    /// Reads a unit in Modelica's notation, such as `kg.m2/(s3.A)`. None where a part of it is not known.
    pub fn parse(text: &str) -> Option<Self> {
        symbols::parse(text.trim()).map(|found| found.unit)
    }

    /// Unit of a product.
    #[must_use]
    pub fn times(&self, other: &Self) -> Self {
        self.with(other, |a, b| a + b)
    }

    /// Unit of a quotient.
    #[must_use]
    pub(crate) fn per(&self, other: &Self) -> Self {
        self.with(other, |a, b| a - b)
    }

    /// Unit of a power; none where an exponent is not a number of reasonable size.
    pub(crate) fn power(&self, exponent: f64) -> Option<Self> {
        let answer = Self {
            exponents: self
                .exponents
                .map(|e| if e == 0.0 { 0.0 } else { e * exponent }),
        };
        answer
            .exponents
            .iter()
            .all(|e| e.abs() <= LARGEST)
            .then_some(answer)
    }

    /// True when both measure the same kind of quantity.
    pub(crate) fn same(&self, other: &Self) -> bool {
        self.exponents
            .iter()
            .zip(&other.exponents)
            .all(|(a, b)| (a - b).abs() <= TOLERANCE)
    }

    /// True for a pure number.
    pub(crate) fn is_one(&self) -> bool {
        self.same(&Self::ONE)
    }

    /// A derived unit that takes up the mass, whether it is a factor (1) or divides (-1), and the base units that are left, where these are shorter
    /// than base units alone.
    fn shortest(&self) -> (Option<(&'static str, f64)>, Self) {
        let length = |unit: &Self| unit.exponents.iter().map(|e| e.abs()).sum::<f64>();
        let mut best = (None, *self, length(self));
        let derived = NAMED.iter().filter(|n| !n.0.contains(['.', '/']));
        for (name, exponents) in derived {
            let named = Self::from_exponents(exponents.map(f64::from));
            for (sign, rest) in [(1.0, self.per(&named)), (-1.0, self.times(&named))] {
                // Between equals, W/m reads better than N/s.
                let total = length(&rest) + 1.0 + 0.1 * rest.exponents[2].abs();
                // What is left of a mass beside a derived unit reads worse than base units: N/kg is m/s2.
                if total < best.2 - TOLERANCE && rest.exponents[1].abs() < TOLERANCE {
                    best = (Some((*name, sign)), rest, total);
                }
            }
        }
        (best.0, best.1)
    }

    fn with(&self, other: &Self, combine: impl Fn(f64, f64) -> f64) -> Self {
        let mut exponents = self.exponents;
        for (a, b) in exponents.iter_mut().zip(&other.exponents) {
            *a = combine(*a, *b);
        }
        Self { exponents }
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_one() {
            return f.write_str("1");
        }
        let named = NAMED
            .iter()
            .find(|n| self.same(&Self::from_exponents(n.1.map(f64::from))));
        if let Some((name, _)) = named {
            return f.write_str(name);
        }
        let (derived, rest) = self.shortest();
        let part = |sign: f64| -> Vec<String> {
            let derived = derived.filter(|d| d.1 == sign);
            let derived = derived.map(|d| d.0.to_string());
            let parts = BASES.iter().zip(&rest.exponents);
            let bases = parts
                .filter(|(_, e)| sign * **e > TOLERANCE)
                .map(|(base, e)| power_text(base, sign * e));
            derived.into_iter().chain(bases).collect()
        };
        let (above, below) = (part(1.0), part(-1.0));
        f.write_str(if above.is_empty() { "1" } else { "" })?;
        f.write_str(&above.join("."))?;
        match below.as_slice() {
            [] => Ok(()),
            [one] => write!(f, "/{one}"),
            several => write!(f, "/({})", several.join(".")),
        }
    }
}

fn power_text(base: &str, exponent: f64) -> String {
    if (exponent - 1.0).abs() <= TOLERANCE {
        return base.to_string();
    }
    if (exponent - exponent.round()).abs() <= TOLERANCE {
        return format!("{base}{}", exponent.round());
    }
    format!("{base}^{}", (exponent * 1e4).round() / 1e4)
}
