//! Units that are not known: they are compared with nothing, and may be misspelt.

use super::{Unit, symbols};
use crate::physics::error::{position, shortened};
use crate::physics::expression::VariableId;
use crate::physics::spec::ModelSpec;
use std::fmt;

/// A variable whose unit is not known.
#[derive(Debug, Clone, PartialEq)]
pub struct UnknownUnit {
    /// The variable.
    pub variable: VariableId,
    /// Its name.
    pub name: String,
    /// The unit as declared.
    pub unit: String,
    /// A known unit that may be meant.
    pub nearest: Option<String>,
    /// Line of the declaration, counted from 1.
    pub line: usize,
    /// Column of the name, counted from 1.
    pub column: usize,
}

impl fmt::Display for UnknownUnit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, unit) = (shortened(&self.name), shortened(&self.unit));
        write!(
            f,
            "the unit `{unit}` of `{name}` is not known and not compared"
        )?;
        match &self.nearest {
            Some(nearest) => write!(f, "; did you mean `{nearest}`?"),
            None => Ok(()),
        }
    }
}

/// Variables whose unit is not known, in the order of declaration. Modelica allows any text as a unit, so this is no error.
pub fn unknown_units(spec: &ModelSpec) -> Vec<UnknownUnit> {
    let each = spec.variables.iter().enumerate();
    each.filter(|(_, v)| v.unit.is_none())
        .filter_map(|(index, v)| {
            let unit = v.unit_text.clone()?;
            let (line, column) = position(&spec.text, v.span.start);
            Some(UnknownUnit {
                variable: VariableId(index as u32),
                name: v.name.clone(),
                nearest: nearest(&unit),
                unit,
                line,
                column,
            })
        })
        .collect()
}

/// Words that are written in the place of symbols.
const WORDS: [(&str, &str); 42] = [
    ("metre", "m"),
    ("metres", "m"),
    ("meter", "m"),
    ("meters", "m"),
    ("sec", "s"),
    ("secs", "s"),
    ("second", "s"),
    ("seconds", "s"),
    ("minute", "min"),
    ("minutes", "min"),
    ("hour", "h"),
    ("hours", "h"),
    ("kilogram", "kg"),
    ("newton", "N"),
    ("newtons", "N"),
    ("radian", "rad"),
    ("radians", "rad"),
    ("rads", "rad"),
    ("degree", "deg"),
    ("degrees", "deg"),
    ("volt", "V"),
    ("volts", "V"),
    ("amp", "A"),
    ("amps", "A"),
    ("ampere", "A"),
    ("amperes", "A"),
    ("watt", "W"),
    ("watts", "W"),
    ("joule", "J"),
    ("joules", "J"),
    ("pascal", "Pa"),
    ("kelvin", "K"),
    ("celsius", "degC"),
    ("fahrenheit", "degF"),
    ("ohms", "Ohm"),
    ("litre", "l"),
    ("liter", "l"),
    ("liters", "l"),
    ("percent", "%"),
    ("pct", "%"),
    ("none", "1"),
    ("dimensionless", "1"),
];

/// The known unit that may be meant.
fn nearest(text: &str) -> Option<String> {
    const LONGEST: usize = 64;
    if text.len() > LONGEST {
        return None;
    }
    let known = |candidate: &String| Unit::parse(candidate).is_some();
    // Each part is repaired by itself: what stands between parts is kept.
    let mut repaired = String::new();
    let mut rest = text.trim();
    while let Some(first) = rest.chars().next() {
        let in_symbol = |c: char| c.is_alphabetic() || matches!(c, '%' | '°' | '_');
        if !in_symbol(first) {
            repaired.push(if first == ' ' { '.' } else { first });
            rest = &rest[first.len_utf8()..];
            continue;
        }
        let length = rest.find(|c| !in_symbol(c)).unwrap_or(rest.len());
        repaired += &symbol(&rest[..length])?;
        rest = &rest[length..];
    }
    let plain = Some(repaired.clone()).filter(known);
    plain.or_else(|| {
        // `J/kg.K` may mean both; the denominator in parentheses is what is usual.
        let (above, below) = repaired.split_once('/')?;
        Some(format!("{above}/({})", below.replace('/', "."))).filter(known)
    })
}

/// The symbol itself, or the known one that is nearest to it.
fn symbol(written: &str) -> Option<String> {
    if Unit::parse(written).is_some() {
        return Some(written.to_string());
    }
    let lower = written.to_lowercase();
    if let Some((_, symbol)) = WORDS.iter().find(|w| w.0 == lower) {
        return Some((*symbol).to_string());
    }
    let all: Vec<&str> = symbols::usual().collect();
    let nearest = crate::physics::syntax::nearest(written, all.iter().copied())?;
    // One letter of a word of two is not enough to go by.
    let same = nearest.eq_ignore_ascii_case(written);
    (same || written.chars().count() > 2).then_some(nearest)
}
