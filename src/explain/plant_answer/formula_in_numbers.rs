//! Formulas as people read them: parameters as numbers, with the digits that their standard deviations support.

use std::collections::BTreeMap;

use crate::explain::document::sentences::number;
use crate::explain::explanation::Quantity;

/// Literals with more significant digits are shortened to so many.
const DIGITS: usize = 5;

/// A value to the second digit of its standard deviation, and at least to its own first.
pub(super) fn rounded(of: &Quantity) -> String {
    let Some(std) = of.std.filter(|s| s.is_finite() && *s > 0.0) else {
        return number(of.value);
    };
    let exponent = |x: f64| x.abs().log10().floor() as i32;
    let last = exponent(std) - 1;
    let size = match of.value {
        0.0 => return "0".to_owned(),
        value => exponent(value),
    };
    let digits = (size - last).max(0) as usize;
    let scientific = format!("{:.digits$e}", of.value);
    if !(-4..6).contains(&size) {
        return scientific;
    }
    let value = scientific.parse().unwrap_or(of.value);
    let decimals = (-last.min(size)).max(0) as usize;
    format!("{value:.decimals$}")
}

/// A formula cut into words, numbers and single other characters.
fn tokens(text: &str) -> Vec<&str> {
    let mut found = Vec::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let word = |c: char| c.is_alphanumeric() || c == '_' || c == '.';
        let mut end = rest.find(|c: char| !word(c)).unwrap_or(rest.len());
        if end == 0 {
            end = first.len_utf8();
        } else if first.is_ascii_digit() && rest[..end].ends_with(['e', 'E']) {
            // The sign of a power of ten belongs to the number.
            let sign = rest[end..].starts_with(['-', '+']);
            let power = rest[end..].get(1..).unwrap_or_default();
            let digits = power.find(|c: char| !c.is_ascii_digit());
            let digits = digits.unwrap_or(power.len());
            if sign && digits > 0 {
                end += 1 + digits;
            }
        }
        found.push(&rest[..end]);
        rest = &rest[end..];
    }
    found
}

/// The formula with the values of its parameters.
pub(super) fn in_numbers(formula: &str, parameters: &BTreeMap<String, Quantity>) -> String {
    let tokens = tokens(formula);
    let mut text = String::new();
    for (i, token) in tokens.iter().enumerate() {
        let Some(quantity) = parameters.get(*token) else {
            text.push_str(token);
            continue;
        };
        let value = rounded(quantity);
        let Some(size) = value.strip_prefix('-') else {
            text.push_str(&value);
            continue;
        };
        // A sign before a power binds less than the power.
        if tokens.get(i + 1) == Some(&"^") {
            text.push_str(&format!("({value})"));
        } else if text.ends_with("+ ") {
            text.truncate(text.len() - 2);
            text.push_str(&format!("- {size}"));
        } else if text.ends_with("- ") {
            text.truncate(text.len() - 2);
            text.push_str(&format!("+ {size}"));
        } else if ["(", ", ", "= "].iter().any(|e| text.ends_with(e)) {
            text.push_str(&value);
        } else {
            text.push_str(&format!("({value})"));
        }
    }
    text
}

/// The formula with shorter literals, but for those that `own`, the text of the user, has.
pub(super) fn with_short_literals(formula: &str, own: &str) -> String {
    let short = |token: &str| -> Option<String> {
        let mantissa = token.split(['e', 'E']).next()?;
        let digits = mantissa.trim_start_matches(['0', '.']);
        let digits = digits.chars().filter(char::is_ascii_digit).count();
        let number = token.starts_with(|c: char| c.is_ascii_digit());
        if !number || digits <= DIGITS + 1 || own.contains(token) {
            return None;
        }
        let value: f64 = token.parse().ok()?;
        let value: f64 = format!("{value:.*e}", DIGITS - 1).parse().ok()?;
        Some(match (1e-3..1e6).contains(&value) {
            true => value.to_string(),
            false => format!("{value:e}"),
        })
    };
    let each = tokens(formula).into_iter();
    each.map(|token| short(token).unwrap_or_else(|| token.to_owned()))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quantity(value: f64, std: Option<f64>) -> Quantity {
        Quantity {
            value,
            std,
            unit: String::new(),
        }
    }

    #[test]
    fn values_have_the_digits_of_their_standard_deviations() {
        for (value, std, said) in [
            (-2791.3, Some(339.2), "-2790"),
            (0.643_21, Some(0.0401), "0.643"),
            (0.026, Some(0.040), "0.026"),
            (274_268.0, Some(36_000.0), "274000"),
            (0.3, Some(20.0), "0.3"),
            (2.512e-7, Some(1.1e-9), "2.512e-7"),
            (0.0, Some(1.0), "0"),
            (0.5548, None, "0.5548"),
        ] {
            assert_eq!(rounded(&quantity(value, std)), said, "{value} {std:?}");
        }
    }

    #[test]
    fn parameters_become_numbers_and_signs_are_merged() {
        let parameters = [
            ("c", quantity(-2791.3, Some(339.2))),
            ("from", quantity(-0.643_21, Some(0.0401))),
        ];
        let parameters = parameters.map(|(name, q)| (name.to_owned(), q)).into();
        let said = |formula: &str| in_numbers(formula, &parameters);
        assert_eq!(
            said("der(a) = g*c2 + c*(max(v - from, 0) + min(v + from, 0))"),
            "der(a) = g*c2 - 2790*(max(v + 0.643, 0) + min(v - 0.643, 0))"
        );
        assert_eq!(said("x = z/from + from^2"), "x = z/(-0.643) + (-0.643)^2");
        assert_eq!(said("x = max(from, c*z)"), "x = max(-0.643, -2790*z)");
        assert_eq!(said("x = c*z"), "x = -2790*z");
    }

    #[test]
    fn literals_of_the_user_are_kept() {
        let formula = "m*der(v) = 9.80665432*u1234567 + s*1.388888888888889e-3 + 2.0*k/86.4";
        assert_eq!(
            with_short_literals(formula, "v = 9.80665432*u"),
            "m*der(v) = 9.80665432*u1234567 + s*0.0013889 + 2.0*k/86.4"
        );
        assert_eq!(with_short_literals("1.23456789e-9*x", ""), "1.2346e-9*x");
    }
}
