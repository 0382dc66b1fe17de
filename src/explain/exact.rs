//! What needs no fit: a sensor that holds its value, and one with coarse levels.

use super::data::Data;

/// A run of equal samples must be this improbable, over the whole recording, to be a frozen sensor.
const IMPROBABLE: f64 = 1e-6;
/// Shortest run that is ever called frozen.
const SHORTEST: usize = 8;
/// Levels may miss the lattice by this share of the spacing: files are rounded.
const OFF_LATTICE: f64 = 0.02;

/// A sensor that held its value.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Freeze {
    pub segment: usize,
    pub output: usize,
    /// First sample that repeats its predecessor.
    pub from: usize,
    /// First sample after the run.
    pub to: usize,
}

/// Runs of equal samples that chance does not make, away from the ends of the range (there a sensor saturates), while
/// the simulation `moving` moves.
pub(crate) fn frozen(data: &Data, simulated: &super::data::Series) -> Vec<Freeze> {
    let mut found = Vec::new();
    for (series, y) in data.outputs_as_series().enumerate() {
        let n = y.len();
        let (low, high) = range(y);
        let equal = y.windows(2).filter(|p| p[0] == p[1]).count();
        let mut k = 1;
        while k < n {
            if y[k] != y[k - 1] {
                k += 1;
                continue;
            }
            let from = k;
            while k < n && y[k] == y[k - 1] {
                k += 1;
            }
            let run = k - from;
            // How often neighbours are equal elsewhere: resolution, rest.
            let rate = ((equal - run) as f64 + 1.0) / n as f64;
            let chance = n as f64 * rate.powf(run as f64);
            let at_limit = y[from] == low || y[from] == high;
            let span = &simulated[series][from - 1..k];
            let (a, b) = range(span);
            let resolution = spacing(y).unwrap_or(0.0);
            let moves = b - a > 3.0 * resolution && b - a > 0.02 * (high - low);
            if run + 1 >= SHORTEST && chance < IMPROBABLE && !at_limit && moves {
                found.push(Freeze {
                    segment: series / data.outputs,
                    output: series % data.outputs,
                    from: from - 1,
                    to: k,
                });
            }
        }
    }
    found
}

fn range(values: &[f64]) -> (f64, f64) {
    values
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| {
            (lo.min(*v), hi.max(*v))
        })
}

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
