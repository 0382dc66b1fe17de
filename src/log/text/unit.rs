//! Whether a text is a unit: what stands in parentheses after a name may be one, or part of the name.

/// Units, without the prefixes of the SI.
const UNITS: [&str; 78] = [
    "m", "g", "s", "A", "K", "mol", "cd", "Hz", "N", "Pa", "J", "W", "C", "V", "F", "Ω", "ohm",
    "Ohm", "S", "Wb", "T", "H", "lm", "lx", "Bq", "Gy", "rad", "sr", "deg", "°", "°C", "°F",
    "degC", "degF", "degK", "Celsius", "bar", "l", "L", "t", "min", "h", "d", "sec", "hr", "rpm",
    "RPM", "rev", "U", "Umdr", "%", "pct", "percent", "ppm", "dB", "VA", "var", "Wh", "VAr", "Ah",
    "Nm", "eV", "psi", "lb", "lbf", "ft", "inch", "mile", "mph", "kph", "kmh", "km/h", "mmHg",
    "inHg", "gpm", "mpm", "cnt", "counts",
];
const PREFIXES: [&str; 11] = ["k", "M", "G", "m", "µ", "μ", "u", "n", "p", "c", "d"];
/// More than this is a remark.
const LONGEST: usize = 20;

/// Whether `text` is made of units, powers, products and quotients only: `m/s^2`, `kg·m²`, `1/min`.
pub(crate) fn is_unit(text: &str) -> bool {
    let text = text.trim();
    if text.is_empty() || text.chars().count() > LONGEST {
        return false;
    }
    if UNITS.contains(&text) {
        return true;
    }
    let between = |c: char| {
        c.is_ascii_digit()
            || matches!(
                c,
                '/' | '*' | '·' | '.' | '^' | ' ' | '²' | '³' | '-' | '+' | '⁻' | '¹'
            )
    };
    let mut any = false;
    text.split(between)
        .filter(|part| !part.is_empty())
        .all(|part| {
            any = true;
            is_simple(part.trim_matches(['(', ')']))
        })
        && any
}

fn is_simple(text: &str) -> bool {
    UNITS.contains(&text)
        || PREFIXES.iter().any(|prefix| {
            text.strip_prefix(prefix)
                .is_some_and(|rest| UNITS.contains(&rest))
        })
}

#[cfg(test)]
mod tests {
    use super::is_unit;

    #[test]
    fn units_and_remarks() {
        for unit in [
            "V", "rpm", "m/s", "m/s^2", "kg·m²", "°C", "%", "1/min", "mV", "km/h", "N*m", "l/min",
            "m3/h", "rad/s",
        ] {
            assert!(is_unit(unit), "{unit}");
        }
        for remark in [
            "filtered",
            "left",
            "raw",
            "in",
            "out",
            "1",
            "set point",
            "",
            "old",
            "abs",
        ] {
            assert!(!is_unit(remark), "{remark}");
        }
    }
}
