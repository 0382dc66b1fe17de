//! Reads units as Modelica writes them.

use super::Unit;

const fn base(exponents: [f64; 7]) -> Unit {
    Unit::from_exponents(exponents)
}

const NUMBER: Unit = Unit::ONE;
const LENGTH: Unit = base([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
const MASS: Unit = base([0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
const TIME: Unit = Unit::SECOND;
const CURRENT: Unit = base([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
const TEMPERATURE: Unit = base([0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
const AMOUNT: Unit = base([0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
const LIGHT: Unit = base([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
const FREQUENCY: Unit = base([0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0]);
const FORCE: Unit = base([1.0, 1.0, -2.0, 0.0, 0.0, 0.0, 0.0]);
const ENERGY: Unit = base([2.0, 1.0, -2.0, 0.0, 0.0, 0.0, 0.0]);
const POWER: Unit = base([2.0, 1.0, -3.0, 0.0, 0.0, 0.0, 0.0]);
const PRESSURE: Unit = base([-1.0, 1.0, -2.0, 0.0, 0.0, 0.0, 0.0]);
const VOLUME: Unit = base([3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
const AREA: Unit = base([2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
const SPEED: Unit = base([1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0]);
const CHARGE: Unit = base([0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
const VOLTAGE: Unit = base([2.0, 1.0, -3.0, -1.0, 0.0, 0.0, 0.0]);
const RESISTANCE: Unit = base([2.0, 1.0, -3.0, -2.0, 0.0, 0.0, 0.0]);
const CONDUCTANCE: Unit = base([-2.0, -1.0, 3.0, 2.0, 0.0, 0.0, 0.0]);
const CAPACITANCE: Unit = base([-2.0, -1.0, 4.0, 2.0, 0.0, 0.0, 0.0]);
const INDUCTANCE: Unit = base([2.0, 1.0, -2.0, -2.0, 0.0, 0.0, 0.0]);
const FLUX: Unit = base([2.0, 1.0, -2.0, -1.0, 0.0, 0.0, 0.0]);
const FIELD: Unit = base([0.0, 1.0, -2.0, -1.0, 0.0, 0.0, 0.0]);
const DOSE: Unit = base([2.0, 0.0, -2.0, 0.0, 0.0, 0.0, 0.0]);

/// Radians in a turn.
const TURN: f64 = std::f64::consts::TAU;

/// Symbols that take the prefixes of the SI, and their size in base units; NaN where a symbol has several sizes.
const PREFIXED: [(&str, Unit, f64); 36] = [
    ("m", LENGTH, 1.0),
    ("g", MASS, 1e-3),
    ("s", TIME, 1.0),
    ("A", CURRENT, 1.0),
    ("K", TEMPERATURE, 1.0),
    ("mol", AMOUNT, 1.0),
    ("cd", LIGHT, 1.0),
    ("rad", NUMBER, 1.0),
    ("sr", NUMBER, 1.0),
    ("Hz", FREQUENCY, 1.0),
    ("N", FORCE, 1.0),
    ("Pa", PRESSURE, 1.0),
    ("W", POWER, 1.0),
    ("J", ENERGY, 1.0),
    ("C", CHARGE, 1.0),
    ("V", VOLTAGE, 1.0),
    ("F", CAPACITANCE, 1.0),
    ("Ohm", RESISTANCE, 1.0),
    ("ohm", RESISTANCE, 1.0),
    ("S", CONDUCTANCE, 1.0),
    ("Wb", FLUX, 1.0),
    ("T", FIELD, 1.0),
    ("H", INDUCTANCE, 1.0),
    ("lm", LIGHT, 1.0),
    ("Bq", FREQUENCY, 1.0),
    ("Gy", DOSE, 1.0),
    ("Sv", DOSE, 1.0),
    ("l", VOLUME, 1e-3),
    ("L", VOLUME, 1e-3),
    ("t", MASS, 1e3),
    ("bar", PRESSURE, 1e5),
    ("eV", ENERGY, 1.602_176_634e-19),
    ("VA", POWER, 1.0),
    ("var", POWER, 1.0),
    ("Wh", ENERGY, 3600.0),
    ("Ah", CHARGE, 3600.0),
];

/// Symbols that stand alone.
const ALONE: [(&str, Unit, f64); 41] = [
    ("1", NUMBER, 1.0),
    ("%", NUMBER, 0.01),
    ("ppm", NUMBER, 1e-6),
    ("deg", NUMBER, TURN / 360.0),
    ("°", NUMBER, TURN / 360.0),
    ("rev", NUMBER, TURN),
    ("r", NUMBER, TURN),
    ("arcmin", NUMBER, TURN / 21_600.0),
    ("arcsec", NUMBER, TURN / 1_296_000.0),
    ("gon", NUMBER, TURN / 400.0),
    ("-", NUMBER, 1.0),
    ("min", TIME, 60.0),
    ("h", TIME, 3600.0),
    ("hr", TIME, 3600.0),
    ("d", TIME, 86_400.0),
    ("day", TIME, 86_400.0),
    ("week", TIME, 604_800.0),
    ("yr", TIME, f64::NAN),
    ("rpm", FREQUENCY, TURN / 60.0),
    ("kat", base([0.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0]), 1.0),
    ("lx", base([-2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]), 1.0),
    ("degC", TEMPERATURE, 1.0),
    ("°C", TEMPERATURE, 1.0),
    ("degF", TEMPERATURE, 5.0 / 9.0),
    ("degRk", TEMPERATURE, 5.0 / 9.0),
    ("degK", TEMPERATURE, 1.0),
    ("ha", AREA, 1e4),
    ("Ω", RESISTANCE, 1.0),
    ("cc", VOLUME, 1e-6),
    ("gal", VOLUME, f64::NAN),
    ("in", LENGTH, 0.0254),
    ("ft", LENGTH, 0.3048),
    ("mi", LENGTH, 1609.344),
    ("mph", SPEED, 0.44704),
    ("kn", SPEED, 1852.0 / 3600.0),
    ("lb", MASS, 0.453_592_37),
    ("lbf", FORCE, 4.448_221_615_260_5),
    ("kgf", FORCE, 9.806_65),
    ("psi", PRESSURE, 6_894.757_293_168),
    ("atm", PRESSURE, 101_325.0),
    ("cal", ENERGY, f64::NAN),
];

/// Symbols of an angle: a turn is 1 for some and 2*pi for others.
const ANGLES: [&str; 9] = [
    "rad", "deg", "°", "rev", "r", "arcmin", "arcsec", "gon", "rpm",
];

/// Prefixes of the SI.
const PREFIXES: [(&str, f64); 22] = [
    ("da", 1e1),
    ("Y", 1e24),
    ("Z", 1e21),
    ("E", 1e18),
    ("P", 1e15),
    ("T", 1e12),
    ("G", 1e9),
    ("M", 1e6),
    ("k", 1e3),
    ("h", 1e2),
    ("d", 1e-1),
    ("c", 1e-2),
    ("m", 1e-3),
    ("u", 1e-6),
    ("µ", 1e-6),
    ("μ", 1e-6),
    ("n", 1e-9),
    ("p", 1e-12),
    ("f", 1e-15),
    ("a", 1e-18),
    ("z", 1e-21),
    ("y", 1e-24),
];

/// Parentheses inside each other.
const DEEPEST: usize = 16;

/// Symbols of [`PREFIXED`] that are no coherent units of the SI.
const SCALED: [&str; 11] = [
    "g", "l", "L", "t", "bar", "eV", "VA", "var", "Wh", "Ah", "ohm",
];

/// True for a unit of symbols that have neither a prefix nor another scale: products of them are coherent.
pub(super) fn is_coherent(text: &str) -> bool {
    let coherent = |symbol: &str| {
        matches!(symbol, "" | "kg")
            || (!SCALED.contains(&symbol) && PREFIXED.iter().any(|p| p.0 == symbol))
    };
    text.split(|c: char| !(c.is_alphabetic() || matches!(c, '%' | '°' | '_')))
        .all(coherent)
}

/// Symbols that a misspelt one may stand for.
pub(super) fn usual() -> impl Iterator<Item = &'static str> {
    const WITH_PREFIX: [&str; 16] = [
        "kg", "mm", "cm", "km", "ms", "kN", "kW", "MW", "mV", "kV", "mA", "kPa", "MPa", "mbar",
        "kJ", "kHz",
    ];
    let single = PREFIXED.iter().chain(&ALONE).map(|s| s.0);
    single.chain(WITH_PREFIX)
}

/// A unit with its size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sized {
    pub(super) unit: Unit,
    /// In base units of the SI; NaN where it is not known.
    pub(super) size: f64,
    /// Exponent of angles.
    pub(super) angle: f64,
}

impl Sized {
    const ONE: Self = Self {
        unit: NUMBER,
        size: 1.0,
        angle: 0.0,
    };

    pub(super) fn times(&self, other: &Self) -> Self {
        Self {
            unit: self.unit.times(&other.unit),
            size: self.size * other.size,
            angle: self.angle + other.angle,
        }
    }

    fn power(&self, exponent: f64) -> Option<Self> {
        Some(Self {
            unit: self.unit.power(exponent)?,
            size: self.size.powf(exponent),
            angle: self.angle * exponent,
        })
    }

    fn per(&self, other: &Self) -> Self {
        Self {
            unit: self.unit.per(&other.unit),
            size: self.size / other.size,
            angle: self.angle - other.angle,
        }
    }
}

/// Reads `kg.m2/(s3.A)`.
pub(super) fn parse(text: &str) -> Option<Sized> {
    if text.is_empty() || text.len() > 200 {
        return None;
    }
    let mut reader = Reader { text, at: 0 };
    let unit = reader.product(0)?;
    (reader.at == text.len()).then_some(unit)
}

struct Reader<'a> {
    text: &'a str,
    at: usize,
}

impl<'a> Reader<'a> {
    fn rest(&self) -> &'a str {
        &self.text[self.at..]
    }

    fn take(&mut self, sign: char) -> bool {
        let here = self.rest().starts_with(sign);
        if here {
            self.at += sign.len_utf8();
        }
        here
    }

    /// The characters from here on that satisfy a condition.
    fn span(&mut self, wanted: impl Fn(char) -> bool) -> &'a str {
        let rest = self.rest();
        let length = rest.find(|c| !wanted(c)).unwrap_or(rest.len());
        self.at += length;
        &rest[..length]
    }

    fn product(&mut self, depth: usize) -> Option<Sized> {
        let mut answer = self.power(depth)?;
        let mut divided = false;
        loop {
            if self.take('.') || self.take('*') || self.take('·') {
                // `J/kg.K` is meant as `J/(kg.K)` by some and not by others.
                if divided {
                    return None;
                }
                answer = answer.times(&self.power(depth)?);
            } else if self.take('/') {
                divided = true;
                answer = answer.per(&self.power(depth)?);
            } else {
                return Some(answer);
            }
        }
    }

    fn power(&mut self, depth: usize) -> Option<Sized> {
        if depth >= DEEPEST {
            return None;
        }
        let unit = if self.take('(') {
            let inner = self.product(depth + 1)?;
            if !self.take(')') {
                return None;
            }
            inner
        } else if self.rest().starts_with(|c: char| c.is_ascii_digit()) {
            // A number is a factor; only `1` is usual.
            let size = self.span(|c| c.is_ascii_digit()).parse().ok()?;
            return Some(Sized { size, ..Sized::ONE });
        } else {
            let symbol = self.span(|c| c.is_alphabetic() || matches!(c, '%' | '°' | '_'));
            if symbol.is_empty() && self.take('-') {
                Sized::ONE
            } else {
                find(symbol)?
            }
        };
        unit.power(self.exponent()?)
    }

    /// `2`, `-1`, `^2`, `^(1/2)` or `(1/2)`; 1 where there is none.
    fn exponent(&mut self) -> Option<f64> {
        let marked = self.take('^');
        if self.take('(') {
            let above = self.signed()?;
            let below = if self.take('/') { self.signed()? } else { 1.0 };
            return (self.take(')') && below != 0.0).then_some(above / below);
        }
        let next = self.rest().chars().next();
        if marked || next.is_some_and(|c| c.is_ascii_digit() || c == '-' || c == '+') {
            return self.signed();
        }
        for (sign, value) in [('²', 2.0), ('³', 3.0)] {
            if self.take(sign) {
                return Some(value);
            }
        }
        Some(1.0)
    }

    fn signed(&mut self) -> Option<f64> {
        let negative = self.take('-');
        if !negative {
            self.take('+');
        }
        let whole = self.span(|c| c.is_ascii_digit());
        if whole.is_empty() {
            return None;
        }
        let start = self.at - whole.len();
        // `m0.5` is a half; the dot of `m2.s` is a product.
        let mut after = self.rest().chars();
        if after.next() == Some('.') && after.next().is_some_and(|c| c.is_ascii_digit()) {
            self.at += 1;
            self.span(|c| c.is_ascii_digit());
        }
        let value: f64 = self.text[start..self.at].parse().ok()?;
        Some(if negative { -value } else { value })
    }
}

/// The unit of one symbol.
pub(super) fn find(symbol: &str) -> Option<Sized> {
    let among = |table: &[(&str, Unit, f64)], wanted: &str| {
        let entry = table.iter().find(|e| e.0 == wanted)?;
        Some(Sized {
            unit: entry.1,
            size: entry.2,
            angle: f64::from(u8::from(ANGLES.contains(&wanted))),
        })
    };
    among(&ALONE, symbol)
        .or_else(|| among(&PREFIXED, symbol))
        .or_else(|| {
            PREFIXES.iter().find_map(|(prefix, factor)| {
                let found = among(&PREFIXED, symbol.strip_prefix(prefix)?)?;
                Some(Sized {
                    size: found.size * factor,
                    ..found
                })
            })
        })
}
