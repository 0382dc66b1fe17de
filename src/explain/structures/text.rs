//! The equations of a structure with the names and sizes of a recording in the place of marks.
//!
//! | mark | what stands there |
//! |---|---|
//! | `{input}`, `{output}` | the name of the channel |
//! | `{output:_suffix}` | the same with a suffix, for a state |
//! | `{unit:input}`, `{unit:output}` | its unit, as an attribute; empty where none is known |
//! | `{std:input}`, `{std:output}` | standard deviation |
//! | `{rms:input}`, `{rms:output}` | root mean square |
//! | `{first}` | first value of the output |
//! | `{time}` | a time constant, in seconds |

use crate::explain::columns::Column;
use crate::log::{Channel, Log};

/// What the marks stand for.
pub(super) struct Marks {
    input: (Column, Size),
    output: (Column, Size),
    first: f64,
}

struct Size {
    std: f64,
    rms: f64,
}

impl Size {
    fn of<'a>(columns: impl Iterator<Item = &'a Vec<f64>>) -> Option<Self> {
        let (mut count, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for v in columns.flatten().filter(|v| v.is_finite()) {
            count += 1.0;
            sum += v;
            squares += v * v;
        }
        let (mean, square) = (sum / count, squares / count);
        let std = (square - mean * mean).max(0.0).sqrt();
        (count > 0.0 && std > 0.0).then_some(Self {
            std,
            rms: square.sqrt(),
        })
    }
}

impl Marks {
    /// Of recordings with one input and one output, both of which move.
    pub(super) fn of(recordings: &[Log]) -> Option<Self> {
        let first = recordings.first()?;
        let ([input], [output]) = (&first.inputs[..], &first.outputs[..]) else {
            return None;
        };
        let named = |channel: &Channel| Column(channel.clone());
        let inputs = recordings.iter().map(|log| &log.input_data[0]);
        let outputs = recordings.iter().map(|log| &log.output_data[0]);
        Some(Self {
            input: (named(input), Size::of(inputs)?),
            output: (named(output), Size::of(outputs)?),
            first: first.output_data[0]
                .iter()
                .copied()
                .find(|y| y.is_finite())?,
        })
    }

    /// Standard deviation of the output.
    pub(super) fn output_std(&self) -> f64 {
        self.output.1.std
    }

    /// The name of the output's channel.
    pub(super) fn output_name(&self) -> String {
        self.output.0.0.name.clone()
    }

    /// Name of the state that follows the output with this suffix.
    pub(super) fn state(&self, suffix: &str) -> String {
        self.output.0.suffixed(suffix)
    }

    /// The equations of a plant with about this time constant.
    pub(super) fn fill(&self, equations: &str, time: f64) -> String {
        let mut text = String::with_capacity(equations.len());
        let mut rest = equations;
        while let Some((before, after)) = rest.split_once('{') {
            text += before;
            let (mark, after) = after.split_once('}').unwrap_or((after, ""));
            text += &self.value(mark, time);
            rest = after;
        }
        text + rest
    }

    fn value(&self, mark: &str, time: f64) -> String {
        let channel = |name: &str| match name {
            "input" => &self.input,
            _ => &self.output,
        };
        let (kind, of) = mark.split_once(':').unwrap_or((mark, ""));
        match kind {
            "unit" => channel(of).0.unit(),
            "std" => format!("{:e}", channel(of).1.std),
            "rms" => format!("{:e}", channel(of).1.rms),
            "first" => format!("{:e}", self.first),
            "time" => format!("{time:e}"),
            name => channel(name).0.suffixed(of),
        }
    }
}
