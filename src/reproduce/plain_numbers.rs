//! Numbers in sentences, in characters that every terminal has.

/// `value` with `digits` significant digits, in powers of ten where it is very large or small.
pub(super) fn number(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return "none".to_owned();
    }
    let scientific = format!("{value:.*e}", digits.saturating_sub(1));
    let exponent: i32 = scientific
        .split_once('e')
        .and_then(|(_, exponent)| exponent.parse().ok())
        .unwrap_or(0);
    if value != 0.0 && !(-4..6).contains(&exponent) {
        return scientific;
    }
    let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
    format!("{value:.decimals$}")
}

/// A share of one in per cent.
pub(super) fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

/// A share of one in per cent, with its standard error.
pub(super) fn percent_with_error((share, error): (f64, f64)) -> String {
    format!("{:.1} +- {:.1} %", 100.0 * share, 100.0 * error)
}

/// `0.93 to 1.05`.
pub(super) fn range(values: impl IntoIterator<Item = f64>) -> String {
    let (low, high) = values
        .into_iter()
        .filter(|v| v.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
            (low.min(v), high.max(v))
        });
    format!("{} to {}", number(low, 3), number(high, 3))
}

/// A sentence on the runs that a method failed in; nothing when there are none.
pub(super) fn failures(name: &str, failed: usize, runs: usize) -> Option<String> {
    (failed > 0).then(|| format!("{name}: {failed} of {runs} runs failed and are left out."))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        assert_eq!(number(1.1983, 4), "1.198");
        assert_eq!(number(1.23e-29, 2), "1.2e-29");
        assert_eq!(number(0.0123, 2), "0.012");
        assert_eq!(number(1234.0, 2), "1234");
        assert_eq!(number(f64::NAN, 2), "none");
        assert_eq!(percent(0.9314), "93.1 %");
        assert_eq!(percent_with_error((0.9, 0.0123)), "90.0 +- 1.2 %");
        assert_eq!(range([1.0, f64::NAN, 0.5]), "0.500 to 1.00");
    }
}
