//! What needs no fit: a sensor that holds its value.

use crate::explain::linear::data::Data;
use crate::log::spacing;

/// A run of equal samples must be this improbable, over the whole recording, to be a frozen sensor.
const IMPROBABLE: f64 = 1e-6;
/// Shortest run that is ever called frozen.
const SHORTEST: usize = 8;

/// A sensor that held its value.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Freeze {
    pub(crate) segment: usize,
    pub(crate) output: usize,
    /// First sample that repeats its predecessor.
    pub(crate) from: usize,
    /// First sample after the run.
    pub(crate) to: usize,
}

/// Runs of equal samples that chance does not make, away from the ends of the range (there a sensor saturates), while
/// the simulation `moving` moves.
pub(crate) fn frozen(data: &Data, simulated: &crate::explain::linear::data::Series) -> Vec<Freeze> {
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
