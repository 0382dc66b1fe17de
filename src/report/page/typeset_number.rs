//! Numbers as people read them: few digits, a real minus sign, powers of ten as superscripts.

/// Stands for a number that is none.
const NONE: &str = "–";

/// `value` with `digits` significant digits.
pub(in crate::report) fn number(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return NONE.to_owned();
    }
    let magnitude = magnitude(value, digits);
    if value != 0.0 && !(-3..6).contains(&magnitude) {
        let mantissa = value / 10f64.powi(magnitude);
        return format!(
            "{} × {}",
            fixed(mantissa, digits.saturating_sub(1)),
            power_of_ten(magnitude)
        );
    }
    fixed(value, decimals(digits, magnitude))
}

/// `value ± std`, to two digits of `std`; without a `std`, four digits of the value.
pub(in crate::report) fn uncertain(value: f64, std: Option<f64>) -> String {
    let Some(std) = std.filter(|s| s.is_finite() && *s > 0.0 && value.is_finite()) else {
        return number(value, 4);
    };
    let size = magnitude(value, 2).max(magnitude(std, 2));
    if !(-3..6).contains(&size) {
        let scale = 10f64.powi(size);
        let decimals = decimals(2, magnitude(std / scale, 2));
        return format!(
            "({} ± {}) × {}",
            fixed(value / scale, decimals),
            fixed(std / scale, decimals),
            power_of_ten(size)
        );
    }
    let decimals = decimals(2, magnitude(std, 2));
    format!("{} ± {}", fixed(value, decimals), fixed(std, decimals))
}

/// A share of one in per cent, `share` of 0.123 as `12.3 %`.
pub(in crate::report) fn percent(share: f64, decimals: usize) -> String {
    if share.is_finite() {
        format!("{} %", fixed(100.0 * share, decimals))
    } else {
        NONE.to_owned()
    }
}

/// A share of a variance in per cent, without claiming all or nothing of what is nearly so.
pub(in crate::report) fn share(of: f64) -> String {
    match of {
        s if s > 0.999 && s < 1.0 => "> 99.9 %".to_owned(),
        s if s > 0.0 && s < 0.001 => "< 0.1 %".to_owned(),
        s => percent(s, 1),
    }
}

/// A probability in per cent; nothing is certain.
pub(in crate::report) fn probability(of: f64) -> String {
    match of {
        p if !p.is_finite() => NONE.to_owned(),
        p if p > 0.99 => "> 99 %".to_owned(),
        p if p < 0.01 => "< 1 %".to_owned(),
        p => percent(p, 0),
    }
}

/// A share of one as the width of a bar, in per cent.
pub(in crate::report) fn width(share: f64) -> String {
    let share = if share.is_finite() { share } else { 0.0 };
    format!("{:.1}", 100.0 * share.clamp(0.0, 1.0))
}

/// The probability of as much by chance.
pub(in crate::report) fn p_value(of: f64) -> String {
    match of {
        p if !p.is_finite() => NONE.to_owned(),
        p if p < 1e-4 => "< 0.0001".to_owned(),
        p => number(p, 2),
    }
}

/// `value` with `decimals` digits after the point, and a minus sign that is one.
pub(in crate::report) fn fixed(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return NONE.to_owned();
    }
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(rest) if rest.bytes().any(|b| (b'1'..=b'9').contains(&b)) => format!("−{rest}"),
        Some(rest) => rest.to_owned(),
        None => text,
    }
}

/// `10⁻⁶`.
pub(in crate::report) fn power_of_ten(exponent: i32) -> String {
    let digits = exponent.to_string();
    let raised = digits.chars().map(|c| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        '4' => '⁴',
        '5' => '⁵',
        '6' => '⁶',
        '7' => '⁷',
        '8' => '⁸',
        '9' => '⁹',
        _ => '⁰',
    });
    std::iter::once("10".to_owned())
        .chain(raised.map(String::from))
        .collect()
}

/// A number and its unit, with a space that does not break.
pub(in crate::report) fn with_unit(number: &str, unit: &str) -> String {
    if unit.is_empty() {
        number.to_owned()
    } else {
        format!("{number}\u{a0}{unit}")
    }
}

/// Symbols that plain text has to do without.
pub(in crate::report) fn typeset(text: &str) -> String {
    text.replace("+-", "±")
        .replace("sigma^2", "σ²")
        .replace("sigma2", "σ²")
}

/// A number that is known exactly: no digits that say nothing.
pub(in crate::report) fn exact(value: f64) -> String {
    let text = number(value, 6);
    match text.split_once(" × ") {
        Some(_) => text,
        None if text.contains('.') => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        None => text,
    }
}

/// The power of ten of the first digit, once `value` is rounded to `digits` digits.
fn magnitude(value: f64, digits: usize) -> i32 {
    if value == 0.0 {
        return 0;
    }
    let text = format!("{value:.*e}", digits.saturating_sub(1));
    text.split_once('e')
        .and_then(|(_, exponent)| exponent.parse().ok())
        .unwrap_or(0)
}

fn decimals(digits: usize, magnitude: i32) -> usize {
    let digits = i32::try_from(digits).unwrap_or(i32::MAX);
    usize::try_from(digits.saturating_sub(1).saturating_sub(magnitude)).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_are_few() {
        assert_eq!(number(0.0, 3), "0.00");
        assert_eq!(number(1.23456, 3), "1.23");
        assert_eq!(number(-0.012345, 3), "−0.0123");
        assert_eq!(number(123_456.0, 3), "123456");
        assert_eq!(number(1.5e-7, 3), "1.50 × 10⁻⁷");
        assert_eq!(number(-2e9, 1), "−2 × 10⁹");
        assert_eq!(number(9.999, 3), "10.0");
        assert_eq!(number(f64::NAN, 3), "–");
    }

    #[test]
    fn uncertainty_decides_the_digits() {
        assert_eq!(uncertain(1.23456, Some(0.0321)), "1.235 ± 0.032");
        assert_eq!(uncertain(1234.5, Some(20.0)), "1234 ± 20");
        assert_eq!(uncertain(1.2348e-6, Some(2.1e-8)), "(1.235 ± 0.021) × 10⁻⁶");
        assert_eq!(uncertain(1.5, None), "1.500");
        assert_eq!(uncertain(1.5, Some(0.0)), "1.500");
        assert_eq!(uncertain(f64::INFINITY, Some(1.0)), "–");
    }

    #[test]
    fn exact_numbers_are_short() {
        assert_eq!(exact(0.02), "0.02");
        assert_eq!(exact(0.0), "0");
        assert_eq!(exact(100.0), "100");
    }

    #[test]
    fn nothing_is_certain() {
        assert_eq!(probability(0.9999), "> 99 %");
        assert_eq!(probability(0.0), "< 1 %");
        assert_eq!(probability(0.876), "88 %");
        assert_eq!(p_value(1e-9), "< 0.0001");
        assert_eq!(p_value(0.31), "0.31");
        assert_eq!(percent(0.1234, 1), "12.3 %");
        assert_eq!(share(0.99995), "> 99.9 %");
        assert_eq!(share(0.0), "0.0 %");
    }

    #[test]
    fn a_rounded_zero_has_no_sign() {
        assert_eq!(fixed(-0.001, 2), "0.00");
        assert_eq!(fixed(-0.01, 2), "−0.01");
    }
}
