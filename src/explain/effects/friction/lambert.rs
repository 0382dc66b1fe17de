//! Lambert's W function on a logarithmic scale.

/// The `y` with `y + ln y = level`: `W(e^level)`, where the exponential may be beyond the range of numbers.
///
/// A guess from the series of W (Corless et al. 1996, eqs. 3.1, 3.19 and 4.18), then the iteration of Fritsch, Shafer and Crowley
/// (1973), whose error is the fourth power of the one before.
pub(super) fn exponential_w(level: f64) -> f64 {
    // Below this e^level is W to the last digit, and may be nothing at all.
    if level < -38.0 {
        return level.exp();
    }
    let mut y = if level > 2.0 {
        let log = level.ln();
        level - log + log / level
    } else if level < -1.0 {
        let x = level.exp();
        x * (1.0 - x * (1.0 - 1.5 * x))
    } else {
        let t = level - 1.0;
        1.0 + t * (0.5 + t * (1.0 / 16.0 - t / 192.0))
    };
    for _ in 0..2 {
        let missed = level - y - y.ln();
        let share = missed / (2.0 * (1.0 + y) * (1.0 + y + 2.0 / 3.0 * missed));
        y *= 1.0 + missed / (1.0 + y) * (1.0 - share) / (1.0 - 2.0 * share);
        // The fourth power of this is below the last digit.
        if missed.abs() < 1e-4 {
            break;
        }
    }
    y
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::*;

    #[test]
    fn it_solves_its_equation_at_every_size() {
        let levels = (-2000..=2000).map(|k| f64::from(k) * 0.05);
        for level in levels.chain([-745.0, -300.0, 1e4, 1e9, 1e300]) {
            let y = exponential_w(level);
            if level < -38.0 {
                assert_relative_eq!(y, level.exp(), max_relative = 1e-14);
            } else {
                // An error of y moves the level by (1 + 1/y) of it.
                let error = (y + y.ln() - level) / (1.0 + y);
                assert!(
                    error.abs() < 1e-14 * (1.0 + level.abs()),
                    "{level}: {error}"
                );
            }
        }
        // The omega constant, and W(1e) = 1.
        assert_relative_eq!(
            exponential_w(0.0),
            0.567_143_290_409_784,
            max_relative = 1e-14
        );
        assert_relative_eq!(exponential_w(1.0), 1.0, max_relative = 1e-15);
        assert_eq!(exponential_w(f64::NEG_INFINITY), 0.0);
    }
}
