//! Numbers as people write them.

use super::Style;

/// Relative standard deviation below which a value is as good as exact.
const NEARLY_EXACT: f64 = 1e-6;

/// A value in so many significant digits, without trailing zeros of the fraction.
pub(crate) fn significant(value: f64, digits: usize) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if !value.is_finite() {
        return value.to_string();
    }
    let size = exponent(value);
    if !(-4..6).contains(&size) {
        return trimmed(&format!("{value:.*e}", digits.saturating_sub(1)));
    }
    let decimals = (digits as i32 - 1 - size).max(0) as usize;
    trimmed(&format!("{value:.decimals$}"))
}

/// A value with its standard deviation, both to the second significant digit of the latter.
pub(crate) fn with_std(value: Option<f64>, std: Option<f64>, style: Style) -> String {
    let Some(value) = value else {
        return "-".to_owned();
    };
    let Some(std) = std.filter(|std| std.is_finite() && *std > 0.0) else {
        return significant(value, 5);
    };
    let pm = style.plus_minus;
    if std < NEARLY_EXACT * value.abs() {
        return format!("{} {pm} {std:.0e}", significant(value, 7));
    }
    let size = exponent(value.abs().max(std));
    if (-4..6).contains(&size) {
        let decimals = (1 - exponent(std)).max(0) as usize;
        format!("{value:.decimals$} {pm} {std:.decimals$}")
    } else {
        let scale = 10.0_f64.powi(size);
        let (value, std) = (value / scale, std / scale);
        let decimals = (1 - exponent(std)).max(0) as usize;
        format!("({value:.decimals$} {pm} {std:.decimals$})e{size}")
    }
}

/// A percentage.
pub(crate) fn percent(value: f64) -> String {
    if value < -1000.0 {
        // Worse than useless; how much does not matter.
        return "< -1000 %".to_owned();
    }
    // A fit of 99.99 % and one of 100 % are not the same thing.
    if value > 99.0 && value < 100.0 {
        format!("{value:.2} %")
    } else {
        format!("{value:.1} %")
    }
}

/// A probability.
pub(crate) fn probability(p: f64) -> String {
    if p < 1e-12 {
        "< 1e-12".to_owned()
    } else if p < 1e-3 {
        format!("{p:.0e}")
    } else {
        format!("{p:.3}")
    }
}

fn exponent(value: f64) -> i32 {
    if value == 0.0 {
        0
    } else {
        value.abs().log10().floor() as i32
    }
}

fn trimmed(text: &str) -> String {
    let (number, power) = match text.split_once('e') {
        Some((number, power)) => (number, format!("e{power}")),
        None => (text, String::new()),
    };
    let number = if number.contains('.') {
        number.trim_end_matches('0').trim_end_matches('.')
    } else {
        number
    };
    format!("{number}{power}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pm(value: f64, std: f64) -> String {
        with_std(Some(value), Some(std), Style::ASCII)
    }

    #[test]
    fn two_digits_of_the_uncertainty() {
        assert_eq!(pm(0.123_456, 0.001_23), "0.1235 +- 0.0012");
        assert_eq!(pm(1234.5, 12.0), "1234 +- 12");
        assert_eq!(pm(-2.5, 0.3), "-2.50 +- 0.30");
        assert_eq!(pm(1.234e-7, 2.0e-9), "(1.234 +- 0.020)e-7");
        assert_eq!(pm(0.0, 0.5), "0.00 +- 0.50");
        assert_eq!(pm(0.5, 1e-14), "0.5 +- 1e-14");
        assert_eq!(with_std(Some(1.0), Some(0.0), Style::ASCII), "1");
        assert_eq!(with_std(None, None, Style::ASCII), "-");
        assert_eq!(
            with_std(Some(2.0), Some(0.1), Style::UNICODE),
            "2.00 ± 0.10"
        );
    }

    #[test]
    fn significant_digits_without_ballast() {
        assert_eq!(significant(0.1, 5), "0.1");
        assert_eq!(significant(1.0 / 3.0, 5), "0.33333");
        assert_eq!(significant(123_456.0, 5), "123456");
        assert_eq!(significant(1.25e-9, 5), "1.25e-9");
        assert_eq!(significant(0.0, 5), "0");
        assert_eq!(percent(99.987), "99.99 %");
        assert_eq!(percent(62.34), "62.3 %");
        assert_eq!(percent(-1e11), "< -1000 %");
        assert_eq!(probability(0.25), "0.250");
        assert_eq!(probability(3e-5), "3e-5");
        assert_eq!(probability(0.0), "< 1e-12");
    }
}
