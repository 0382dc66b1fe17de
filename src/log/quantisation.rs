//! Whether a signal was recorded in steps.

/// Levels may miss the lattice by this share of the spacing: files are rounded.
const OFF_LATTICE: f64 = 0.02;

/// Spacing of the lattice that all values of `y` lie on, if they do and if they meet few of its points.
pub(crate) fn spacing(y: &[f64]) -> Option<f64> {
    let mut levels: Vec<f64> = y.to_vec();
    levels.sort_by(f64::total_cmp);
    let (low, high) = (*levels.first()?, *levels.last()?);
    let rounding = 1e-7 * low.abs().max(high.abs());
    levels.dedup_by(|a, b| (*a - *b).abs() <= rounding);
    // A lattice that is met about once a point is no evidence.
    if levels.len() < 3 || levels.len() * 4 > y.len() {
        return None;
    }
    let step = levels
        .windows(2)
        .map(|p| p[1] - p[0])
        .fold(f64::INFINITY, f64::min);
    // Better by least squares over the whole range.
    let refined = {
        let counts: Vec<f64> = levels.iter().map(|v| ((v - low) / step).round()).collect();
        let (num, den) = levels
            .iter()
            .zip(&counts)
            .fold((0.0, 0.0), |(n, d), (v, c)| (n + (v - low) * c, d + c * c));
        num / den
    };
    let on = levels
        .iter()
        .filter(|v| {
            let at = (**v - low) / refined;
            (at - at.round()).abs() <= OFF_LATTICE + rounding / refined
        })
        .count();
    (on == levels.len() && refined > 0.0).then_some(refined)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lattice_is_found_and_noise_is_none() {
        let coarse: Vec<f64> = (0..4000)
            .map(|k| 0.3 * (3.0 * (0.01 * f64::from(k)).sin() / 0.3).round())
            .collect();
        let step = spacing(&coarse).expect("a lattice");
        assert!((step - 0.3).abs() < 1e-9, "{step}");
        let smooth: Vec<f64> = (0..4000).map(|k| (0.01 * f64::from(k)).sin()).collect();
        assert!(spacing(&smooth).is_none());
    }
}
