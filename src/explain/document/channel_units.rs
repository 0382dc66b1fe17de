//! Units as loggers write them: which law may hold for a channel.

use crate::log::Channel;

/// Ways in which a unit is written, in lower case; the first stands for it.
const WRITTEN: &[&[&str]] = &[
    &["deg", "\u{b0}", "degree", "degrees", "grad"],
    &["rad", "radian", "radians"],
    &["degC", "degc", "\u{b0}c", "c", "celsius", "grad c"],
    &["degF", "degf", "\u{b0}f", "f", "fahrenheit", "deg f"],
    &["K", "k", "kelvin"],
];

/// Units of a speed or a flow that are not written as something by time.
const RATES: &[&str] = &[
    "kmh", "kph", "mph", "kn", "knots", "rpm", "min-1", "rads", "degs", "mps", "rps", "hz", "lpm",
    "lph", "lmin", "gpm", "cfm", "sccm", "m3h", "m3s", "kgh", "kgs",
];
/// What stands after the slash of one that is.
const BY_TIME: &[&str] = &["s", "sec", "min", "h", "hr", "d"];

/// Units of a position or an angle.
const POSITIONS: &[&str] = &[
    "m", "mm", "um", "\u{b5}m", "cm", "km", "in", "ft", "rad", "radian", "radians", "deg",
    "\u{b0}", "degree", "degrees", "grad",
];

/// Words of names that say what a channel without a unit is.
const RATE_WORDS: &[&str] = &[
    "speed", "velocity", "vel", "omega", "rate", "flow", "gyro", "rpm",
];
const POSITION_WORDS: &[&str] = &[
    "position",
    "pos",
    "angle",
    "displacement",
    "disp",
    "deflection",
    "travel",
    "stroke",
    "altitude",
    "theta",
];

/// Words that say that it is something else: the flow temperature of a heating circuit is no flow.
const OTHER_WORDS: &[&str] = &[
    "t",
    "temp",
    "temperature",
    "p",
    "press",
    "pressure",
    "force",
    "torque",
    "current",
    "voltage",
    "power",
    "ratio",
];

/// The unit of a channel in lower case: of its brackets, else what the name ends with behind an underscore.
fn written(channel: &Channel) -> Option<String> {
    let unit = channel.unit.clone();
    unit.or_else(|| {
        channel
            .name
            .rsplit_once('_')
            .map(|(_, last)| last.to_owned())
    })
    .map(|unit| unit.trim().to_lowercase())
}

/// Whether `channel` is measured in `unit`.
pub(crate) fn is_in(channel: &Channel, unit: &str) -> bool {
    written(channel).is_some_and(|written| {
        WRITTEN.iter().any(|list| {
            list[0] == unit
                && (list[0].to_lowercase() == written || list.contains(&written.as_str()))
        })
    })
}

/// Whether a channel without a unit in brackets has one of these words in its name.
fn is_called(channel: &Channel, words: &[&str]) -> bool {
    let name = channel.name.to_lowercase();
    let parts = || name.split(|c: char| !c.is_alphabetic());
    let has = |words: &[&str]| parts().any(|part| words.contains(&part));
    channel.unit.is_none() && has(words) && !has(OTHER_WORDS)
}

/// Whether `channel` is a speed or a flow.
pub(crate) fn is_rate(channel: &Channel) -> bool {
    let by_unit = written(channel).is_some_and(|written| {
        let by_time = |(_, time): (&str, &str)| BY_TIME.contains(&time);
        RATES.contains(&written.as_str()) || written.rsplit_once('/').is_some_and(by_time)
    });
    by_unit || !has_unit_of_position(channel) && is_called(channel, RATE_WORDS)
}

/// Whether `channel` is a position or an angle.
pub(crate) fn is_position(channel: &Channel) -> bool {
    has_unit_of_position(channel) || !is_rate(channel) && is_called(channel, POSITION_WORDS)
}

fn has_unit_of_position(channel: &Channel) -> bool {
    written(channel).is_some_and(|written| POSITIONS.contains(&written.as_str()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channel(name: &str, unit: Option<&str>) -> Channel {
        Channel {
            name: name.to_owned(),
            unit: unit.map(str::to_owned),
        }
    }

    #[test]
    fn units_are_known_from_brackets_and_names() {
        assert!(is_in(&channel("T_furnace_degC", None), "degC"));
        assert!(is_in(&channel("T", Some("\u{b0}C")), "degC"));
        assert!(is_in(&channel("Chamber", Some("degF")), "degF"));
        assert!(is_in(&channel("T", Some("\u{b0}F")), "degF"));
        assert!(is_in(&channel("T_reactor", Some("K")), "K"));
        assert!(is_in(&channel("angle", Some("deg")), "deg"));
        assert!(!is_in(&channel("angle", Some("deg")), "degC"));
        assert!(!is_in(&channel("level", None), "K"));
        assert!(is_rate(&channel("v_kmh", None)));
        assert!(is_rate(&channel("speed", Some("RPM"))));
        assert!(is_rate(&channel("flow", Some("m3/h"))) && is_rate(&channel("q", Some("l/min"))));
        assert!(!is_rate(&channel("disp_mm", None)));
        assert!(is_rate(&channel("speed", None)) && is_rate(&channel("Motor Speed", None)));
        assert!(!is_rate(&channel("speed", Some("V"))) && !is_rate(&channel("pos_rate_mm", None)));
        assert!(is_position(&channel("shaft_angle", None)));
        assert!(!is_rate(&channel("flow_temperature", None)) && !is_rate(&channel("T_flow", None)));
        assert!(is_position(&channel("disp_mm", None)));
        assert!(is_position(&channel("angle", Some("Deg"))));
        assert!(!is_position(&channel("T", Some("K"))) && !is_position(&channel("y", None)));
    }
}
