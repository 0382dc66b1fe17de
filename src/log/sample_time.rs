//! Which numbers can be a sample time.

/// Shortest and longest sample time, in seconds: from the fastest that light can be gated to longer than there has been
/// time. Beyond, frequencies and times of what was sampled leave the range of numbers.
const SAMPLE_TIMES: std::ops::RangeInclusive<f64> = 1e-18..=1e18;

/// Whether this can be a sample time, in seconds.
pub fn is_sample_time(seconds: f64) -> bool {
    SAMPLE_TIMES.contains(&seconds)
}
