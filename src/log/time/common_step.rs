//! Irregular times: the step of a grid that has a point at each of them.

/// A grid has at most as many points, or so many a row.
const MOST_POINTS: f64 = 10_000.0;
const MOST_POINTS_A_ROW: f64 = 20.0;
/// Recordings of at most this many rows may have a grid so fine that no time is far from its point.
pub(crate) const FEW_ROWS: usize = (MOST_POINTS / MOST_POINTS_A_ROW) as usize;
/// Remainders below this part of the shortest spacing are rounding.
const ROUNDING: f64 = 1e-4;
/// Points to the shortest spacing where times have no common divisor: none is further from its point than a twentieth of it; or to the
/// median, where a few times are much closer than the others.
const POINTS_A_SPACING: f64 = 10.0;
/// Distance of a time from its point on such a grid, at most, in shortest spacings.
pub(crate) const NEAR: f64 = 0.5 / POINTS_A_SPACING;

/// The greatest common divisor of the spacings of these times in seconds, or a tenth of the shortest where that needs too many
/// points, or the shortest where it is a tenth of most; none where all need too many. Times that go back begin another recording.
pub(crate) fn common_step(times: &[f64]) -> Option<f64> {
    let known: Vec<f64> = times.iter().copied().filter(|t| t.is_finite()).collect();
    let spacings: Vec<f64> = known
        .windows(2)
        .map(|w| w[1] - w[0])
        .filter(|d| *d > 0.0)
        .collect();
    let shortest = spacings.iter().copied().min_by(f64::total_cmp)?;
    let most = MOST_POINTS.max(MOST_POINTS_A_ROW * known.len() as f64);
    let finest = spacings.iter().sum::<f64>() / most;
    let rounding = ROUNDING * shortest;
    let common = |a, b: &f64| divisor_of(a, *b, rounding);
    let divisor = spacings.iter().fold(0.0, common);
    let mut sorted = spacings;
    sorted.sort_by(f64::total_cmp);
    let few_are_close = shortest <= sorted[sorted.len() / 2] / POINTS_A_SPACING;
    [divisor, shortest / POINTS_A_SPACING]
        .into_iter()
        .chain(few_are_close.then_some(shortest))
        .find(|step| *step >= finest)
}

/// Euclid's algorithm; what is left below `rounding` is 0.
fn divisor_of(mut a: f64, mut b: f64, rounding: f64) -> f64 {
    while b > rounding {
        let left = a % b;
        let left = if b - left < rounding { 0.0 } else { left };
        (a, b) = (b, left);
    }
    a
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_grid_has_a_point_at_every_time() {
        let hours = [0.25, 0.5, 0.75, 1.0, 1.25, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0];
        let seconds: Vec<f64> = hours.iter().map(|h| h * 3600.0).collect();
        assert!((common_step(&seconds).unwrap() - 900.0).abs() < 1e-6);
        let thirds = [0.0, 0.33, 0.67, 1.0, 2.0, 2.33];
        assert!((common_step(&thirds).unwrap() - 0.01).abs() < 1e-9);
        // The second recording begins anew.
        assert_eq!(common_step(&[0.0, 2.0, 6.0, 0.0, 4.0]), Some(2.0));
    }

    #[test]
    fn times_without_a_divisor_are_near_points_and_bursts_have_no_grid() {
        let step = common_step(&[0.0, 1.0, std::f64::consts::PI, 10.0]).unwrap();
        assert!((1e-3..=0.1).contains(&step), "{step}");
        let bursts: Vec<f64> = (0..200)
            .map(|k| f64::from(k / 2) * 1000.0 + f64::from(k % 2) * 1e-3)
            .collect();
        assert_eq!(common_step(&bursts), None);
        assert_eq!(common_step(&[1.0]), None);
        // Two of the times are close to each other, and nothing divides all.
        let mut one_pair: Vec<f64> = (0..40)
            .map(|k| f64::from(k) * std::f64::consts::E)
            .collect();
        one_pair.insert(20, one_pair[19] + 0.02);
        one_pair.push(150.0);
        assert_eq!(common_step(&one_pair), Some(one_pair[20] - one_pair[19]));
    }
}
