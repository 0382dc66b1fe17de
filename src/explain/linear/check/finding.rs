//! What a check finds.

use std::ops::Range;

/// What is wrong with the data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// The simulated column is the recorded one.
    Identical,
    /// Two outputs have changed places.
    Swapped,
    /// The output has the other sign.
    Sign,
    /// The output is in another unit.
    Unit,
    /// One of the two clocks runs faster than the other.
    Clock,
    /// An angle that starts again at the end of each turn.
    Wrap,
    /// Samples that read one value, such as 0, in place of the signal.
    Dropout,
    /// Isolated samples far off.
    Outliers,
}

impl Kind {
    /// The library's name of it, where it is an answer of its own; the others are said in words.
    pub(crate) fn id(self) -> Option<&'static str> {
        match self {
            Self::Swapped => Some("swapped_outputs"),
            Self::Clock => Some("clock_drift"),
            Self::Wrap => Some("sensor_wrap"),
            Self::Dropout => Some("sensor_dropout"),
            Self::Outliers => Some("sensor_outliers"),
            Self::Identical | Self::Sign | Self::Unit => None,
        }
    }

    /// Whether it is a relation between the numbers of the simulation and those of the recording: a parameter.
    pub(crate) fn is_relation(self) -> bool {
        matches!(self, Self::Sign | Self::Unit)
    }
}

/// A number that belongs to a finding.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Number {
    pub(crate) name: &'static str,
    pub(crate) value: f64,
    pub(crate) unit: String,
}

impl Number {
    pub(crate) fn new(name: &'static str, value: f64, unit: &str) -> Self {
        Self {
            name,
            value,
            unit: unit.to_owned(),
        }
    }
}

/// One thing that is wrong with the data rather than with the physics. It is repaired in what is compared (see
/// [`super::Checked`]): samples that are left out hold what their neighbours say.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Trouble {
    pub(crate) kind: Kind,
    /// Which recording, from 0.
    pub(crate) recording: usize,
    /// Which output, from 0.
    pub(crate) output: usize,
    /// Samples that are left out.
    pub(crate) left_out: Vec<Range<usize>>,
    pub(crate) numbers: Vec<Number>,
    /// In plain words.
    pub(crate) sentence: String,
}
