//! The data factor of a simulated recording as it is: nothing removed, nothing scaled, as in the papers.

use crate::log::Log;
use crate::moments::RFactor;

/// Failures of a run are counted and told, not handled: their text is enough.
pub(super) type Failure = String;

/// The factor of windows of `window + 1` samples.
pub(super) fn raw_factor(log: &Log, window: usize) -> Result<RFactor, Failure> {
    RFactor::of_samples(&log.channel_data(), log.inputs.len(), window).map_err(|e| e.to_string())
}
