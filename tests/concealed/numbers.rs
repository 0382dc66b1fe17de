//! Small statistics and rounding.

/// The mean.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// The standard deviation about the mean.
pub fn deviation(values: &[f64]) -> f64 {
    let centre = mean(values);
    root_mean_square(values.iter().map(|v| v - centre))
}

/// The root mean square.
pub fn root_mean_square(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0_usize);
    for value in values {
        sum += value * value;
        count += 1;
    }
    (sum / count.max(1) as f64).sqrt()
}

/// The root mean square of `a - b`.
pub fn distance(a: &[f64], b: &[f64]) -> f64 {
    root_mean_square(a.iter().zip(b).map(|(x, y)| x - y))
}

/// Rounds to significant decimal digits, as a text file would.
pub fn round_to(value: f64, digits: usize) -> f64 {
    if !value.is_finite() {
        return value;
    }
    format!("{value:.*e}", digits.max(1) - 1)
        .parse()
        .unwrap_or(value)
}

/// Text of a number with significant decimal digits and no trailing zeros.
pub fn text_of(value: f64, digits: usize) -> String {
    const PLAIN: std::ops::Range<f64> = 1e-5..1e15;
    let rounded = round_to(value, digits);
    if rounded == 0.0 {
        "0".into()
    } else if PLAIN.contains(&rounded.abs()) {
        format!("{rounded}")
    } else {
        format!("{rounded:e}")
    }
}
