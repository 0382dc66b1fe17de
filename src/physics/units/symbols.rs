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

/// Symbols that take the prefixes of the SI.
const PREFIXED: [(&str, Unit); 36] = [
    ("m", LENGTH),
    ("g", MASS),
    ("s", TIME),
    ("A", CURRENT),
    ("K", TEMPERATURE),
    ("mol", AMOUNT),
    ("cd", LIGHT),
    ("rad", NUMBER),
    ("sr", NUMBER),
    ("Hz", FREQUENCY),
    ("N", FORCE),
    ("Pa", PRESSURE),
    ("W", POWER),
    ("J", ENERGY),
    ("C", CHARGE),
    ("V", VOLTAGE),
    ("F", CAPACITANCE),
    ("Ohm", RESISTANCE),
    ("ohm", RESISTANCE),
    ("S", CONDUCTANCE),
    ("Wb", FLUX),
    ("T", FIELD),
    ("H", INDUCTANCE),
    ("lm", LIGHT),
    ("Bq", FREQUENCY),
    ("Gy", DOSE),
    ("Sv", DOSE),
    ("l", VOLUME),
    ("L", VOLUME),
    ("t", MASS),
    ("bar", PRESSURE),
    ("eV", ENERGY),
    ("VA", POWER),
    ("var", POWER),
    ("Wh", ENERGY),
    ("Ah", CHARGE),
];

/// Symbols that stand alone.
const ALONE: [(&str, Unit); 41] = [
    ("1", NUMBER),
    ("%", NUMBER),
    ("ppm", NUMBER),
    ("deg", NUMBER),
    ("°", NUMBER),
    ("rev", NUMBER),
    ("r", NUMBER),
    ("arcmin", NUMBER),
    ("arcsec", NUMBER),
    ("gon", NUMBER),
    ("-", NUMBER),
    ("min", TIME),
    ("h", TIME),
    ("hr", TIME),
    ("d", TIME),
    ("day", TIME),
    ("week", TIME),
    ("yr", TIME),
    ("rpm", FREQUENCY),
    ("kat", base([0.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0])),
    ("lx", base([-2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])),
    ("degC", TEMPERATURE),
    ("°C", TEMPERATURE),
    ("degF", TEMPERATURE),
    ("degRk", TEMPERATURE),
    ("degK", TEMPERATURE),
    ("ha", AREA),
    ("Ω", RESISTANCE),
    ("cc", VOLUME),
    ("gal", VOLUME),
    ("in", LENGTH),
    ("ft", LENGTH),
    ("mi", LENGTH),
    ("mph", SPEED),
    ("kn", SPEED),
    ("lb", MASS),
    ("lbf", FORCE),
    ("kgf", FORCE),
    ("psi", PRESSURE),
    ("atm", PRESSURE),
    ("cal", ENERGY),
];

/// Prefixes of the SI; factors are left out.
const PREFIXES: [&str; 22] = [
    "da", "Y", "Z", "E", "P", "T", "G", "M", "k", "h", "d", "c", "m", "u", "µ", "μ", "n", "p", "f",
    "a", "z", "y",
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

/// Reads `kg.m2/(s3.A)`.
pub(super) fn parse(text: &str) -> Option<Unit> {
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

    fn product(&mut self, depth: usize) -> Option<Unit> {
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

    fn power(&mut self, depth: usize) -> Option<Unit> {
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
            self.span(|c| c.is_ascii_digit());
            return Some(NUMBER);
        } else {
            let symbol = self.span(|c| c.is_alphabetic() || matches!(c, '%' | '°' | '_'));
            if symbol.is_empty() && self.take('-') {
                NUMBER
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
fn find(symbol: &str) -> Option<Unit> {
    let among =
        |table: &[(&str, Unit)], wanted: &str| table.iter().find(|e| e.0 == wanted).map(|e| e.1);
    among(&ALONE, symbol)
        .or_else(|| among(&PREFIXED, symbol))
        .or_else(|| {
            PREFIXES
                .iter()
                .filter_map(|p| symbol.strip_prefix(p))
                .find_map(|rest| among(&PREFIXED, rest))
        })
}
