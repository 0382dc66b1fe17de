//! Long lines thinned to what a screen can show, and numbers to the digits that it can.

/// Points of a line that a page carries at most: a wide screen has fewer columns than half of them.
pub(in crate::report) const MOST_POINTS: usize = 5000;
/// Digits of what a series spans: a screen of 4000 columns, zoomed in a hundred times, still shows none of the
/// rounding.
const DIGITS: i32 = 6;

/// The smallest and the largest point of each of half as many stretches as points are allowed: the line looks as it did.
///
/// A value that is not finite breaks the line, and stays.
pub(in crate::report) fn thinned(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    if points.len() <= MOST_POINTS {
        return points.to_vec();
    }
    let stretch = points.len().div_ceil(MOST_POINTS / 2);
    let mut kept = Vec::with_capacity(MOST_POINTS);
    for part in points.chunks(stretch) {
        let finite = || part.iter().enumerate().filter(|(_, p)| p.1.is_finite());
        let low = finite().min_by(|a, b| a.1.1.total_cmp(&b.1.1));
        let high = finite().max_by(|a, b| a.1.1.total_cmp(&b.1.1));
        match (low, high) {
            (Some((i, _)), Some((j, _))) if i != j => {
                kept.extend([part[i.min(j)], part[i.max(j)]]);
            }
            (Some((i, _)), _) => kept.push(part[i]),
            (None, _) => kept.push((part[0].0, f64::NAN)),
        }
    }
    kept
}

/// Values rounded to a millionth of what they span; what is not finite is nothing.
pub(in crate::report) fn rounded(values: &[f64]) -> Vec<Option<f64>> {
    let finite = || values.iter().copied().filter(|v| v.is_finite());
    let low = finite().fold(f64::INFINITY, f64::min);
    let high = finite().fold(f64::NEG_INFINITY, f64::max);
    let smallest = finite().fold(
        f64::INFINITY,
        |m, v| {
            if v == 0.0 { m } else { m.min(v.abs()) }
        },
    );
    // Values that span decades may stand on a logarithmic axis, where the smallest counts as much as the largest.
    let span = match high - low {
        span if low > 0.0 && high > 10.0 * low => smallest.min(span),
        span if span > 0.0 => span,
        _ => smallest,
    };
    let decimals = DIGITS - span.log10().floor().clamp(-300.0, 300.0) as i32;
    values
        .iter()
        .map(|v| v.is_finite().then(|| round(*v, decimals)))
        .collect()
}

fn round(value: f64, decimals: i32) -> f64 {
    if !(0..=300).contains(&decimals) {
        let scale = 10f64.powi(-decimals);
        let back = (value / scale).round() * scale;
        return if back.is_finite() { back } else { value };
    }
    let scale = 10f64.powi(decimals);
    let back = (value * scale).round() / scale;
    if back.is_finite() { back } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_line_keeps_its_peaks() {
        let mut points: Vec<(f64, f64)> = (0..1_000_000)
            .map(|k| (f64::from(k), (f64::from(k) * 0.1).sin()))
            .collect();
        points[123_456].1 = 9.0;
        points[654_321].1 = -9.0;
        let kept = thinned(&points);
        assert!(kept.len() <= MOST_POINTS);
        assert!(kept.contains(&(123_456.0, 9.0)) && kept.contains(&(654_321.0, -9.0)));
        assert!(kept.windows(2).all(|w| w[0].0 < w[1].0));
        assert_eq!(thinned(&points[..100]), &points[..100]);
    }

    #[test]
    fn gaps_stay() {
        let points = vec![(0.0, f64::NAN); 20_000];
        let kept = thinned(&points);
        assert!(!kept.is_empty() && kept.iter().all(|p| p.1.is_nan()));
    }

    #[test]
    fn numbers_have_the_digits_that_can_be_seen() {
        assert_eq!(
            rounded(&[0.0, 0.123_456_789_123, 10.0, f64::NAN]),
            [Some(0.0), Some(0.123_46), Some(10.0), None]
        );
        // Time far from zero.
        assert_eq!(
            rounded(&[1e6, 1e6 + 0.001_234_567_89]),
            [Some(1e6), Some(1_000_000.001_234_568)]
        );
        // Decades.
        assert_eq!(
            rounded(&[1.234_567_89e-9, 1.0]),
            [Some(1.234_568e-9), Some(1.0)]
        );
        assert_eq!(rounded(&[0.0, 0.0]), [Some(0.0), Some(0.0)]);
        assert_eq!(rounded(&[3e9, 2e200]), [Some(3e9), Some(2e200)]);
    }
}
