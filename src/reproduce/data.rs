//! The data factor of a simulated recording as it is: nothing removed, nothing scaled, as in the papers.

use crate::log::Log;
use crate::moments::{Detrend, LagAccumulator, RFactor};

/// Failures of a run are counted and told, not handled: their text is enough.
pub(super) type Failure = String;

/// The factor of windows of `window + 1` samples.
pub(super) fn raw_factor(log: &Log, window: usize) -> Result<RFactor, Failure> {
    let channels: Vec<&[f64]> = log
        .input_data
        .iter()
        .chain(&log.output_data)
        .map(Vec::as_slice)
        .collect();
    let mut accumulator = LagAccumulator::new(channels.len(), window);
    accumulator.push(&channels);
    let moments = accumulator.moments();
    let gram = moments.gram(window, &moments.trend(Detrend::None));
    let scale = vec![1.0; channels.len()];
    RFactor::from_gram(&gram, log.input_data.len(), &scale).map_err(|e| e.to_string())
}
