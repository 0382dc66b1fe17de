//! Why a model could not be identified, and what to do about it.

use crate::limits::LimitError;
use crate::linalg::LinalgError;
use crate::log::LogError;

/// Failure of an identification.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum IdentifyError {
    /// The recording could not be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// It would take more memory than it may.
    #[error(transparent)]
    Limit(#[from] LimitError),
    /// A factorisation failed on data that should allow it.
    #[error("numerical failure: {0}")]
    Linalg(#[from] LinalgError),
    /// Not enough samples for the past window.
    #[error(
        "the recording is too short: {samples} samples, but a past window of {past} needs at least {needed}; \
         give a longer recording or a smaller --past"
    )]
    TooShort {
        /// Samples there are.
        samples: usize,
        /// Past window asked for.
        past: usize,
        /// Samples needed.
        needed: usize,
    },
    /// Not enough samples for the past and the future window together.
    #[error(
        "the recording is too short: {samples} samples, but a past window of {past} and a future window of {future} \
         need at least {needed}; give a longer recording, or a smaller --past or --future"
    )]
    TooShortForWindows {
        /// Samples there are.
        samples: usize,
        /// Past window.
        past: usize,
        /// Future window.
        future: usize,
        /// Samples needed.
        needed: usize,
    },
    /// Not enough samples for any model.
    #[error(
        "the recording is too short: {samples} samples in all, and a model of {channels} channels needs at \
         least {needed}; give a longer recording, or more of them"
    )]
    TooFewSamples {
        /// Samples there are.
        samples: usize,
        /// Number of channels.
        channels: usize,
        /// Samples needed.
        needed: usize,
    },
    /// Nothing to model.
    #[error("the recording has no {role}; name at least one column with --{role}s")]
    NoChannel {
        /// `input` or `output`.
        role: &'static str,
    },
    /// A channel that never changes.
    #[error(
        "{role} '{name}' is constant{place}: it carries no information; leave it out with --inputs and --outputs"
    )]
    ConstantChannel {
        /// `input` or `output`.
        role: &'static str,
        /// Name of the channel.
        name: String,
        /// Where, when there are several experiments.
        place: String,
    },
    /// Numbers whose squares and products are none.
    #[error(
        "{role} '{name}' has a mean of {level:e} and deviates from it by {deviation:e}; only sizes from 1e-60 to 1e60 are \
         identified: give it in another unit"
    )]
    Size {
        /// `input` or `output`.
        role: &'static str,
        /// Name of the channel.
        name: String,
        /// Mean, of the recording in which it is largest.
        level: f64,
        /// Standard deviation, the largest.
        deviation: f64,
    },
    /// Two channels that are the same signal up to scale and offset.
    #[error(
        "'{first}' and '{second}' are the same signal up to scale and offset (correlation {correlation:.12}); \
         a model between them says nothing: leave one out with --inputs and --outputs"
    )]
    SameChannel {
        /// Name of the one channel.
        first: String,
        /// Name of the other.
        second: String,
        /// Correlation coefficient.
        correlation: f64,
    },
    /// Order beyond what the windows allow.
    #[error("order {order} is not possible: {reason}; the largest order here is {largest}")]
    Order {
        /// Order asked for.
        order: usize,
        /// Largest possible.
        largest: usize,
        /// What limits it.
        reason: String,
    },
    /// Windows that make no sense.
    #[error("{asked} is not possible: {reason}")]
    Horizon {
        /// The windows as asked for.
        asked: String,
        /// What is wrong.
        reason: String,
    },
    /// The states, inputs and residuals are linearly dependent.
    #[error(
        "the regression on {what} is singular: the recording does not excite the plant enough for this order; \
         lower --order or --past, or record with a richer input"
    )]
    SingularRegression {
        /// Which regressors.
        what: &'static str,
    },
    /// Two recordings that are copies of one.
    #[error(
        "{first} and {second} hold the same bytes: their noise would count as twice the information; name each \
         recording once"
    )]
    SameRecording {
        /// Name of the one.
        first: String,
        /// Name of the other.
        second: String,
    },
    /// Samples are needed, and only moments are there.
    #[error(
        "{reason}, and this takes the samples themselves, of which only moments are left; identify on one machine"
    )]
    MomentsOnly {
        /// What needs them.
        reason: &'static str,
    },
    /// Options that do not fit the recording.
    #[error("{0}")]
    Option(String),
    /// No stable model was found.
    #[error(
        "no stable model of order {order} was found (spectral radius stays at {spectral_radius:.6}); \
         lower --order or drop --stable"
    )]
    NoStableModel {
        /// Order.
        order: usize,
        /// Radius of the best try.
        spectral_radius: f64,
    },
}
