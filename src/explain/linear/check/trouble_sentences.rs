//! What is said of troubles with the data.

use std::ops::Range;

use super::clock::Drift;
use super::finding::{Kind, Number, Trouble};
use super::gross::Gross;
use super::relation::Relation;
use super::wrap::Wrap;
use crate::explain::document::sentences::number;
use crate::log::Log;

fn unit_of(log: &Log, output: usize) -> &str {
    log.outputs[output].unit.as_deref().unwrap_or("")
}

/// `12.3 s`, of sample `k`.
fn time(log: &Log, k: usize) -> f64 {
    log.start_time + k as f64 * log.sample_time
}

/// `5 deg`, `5`.
fn with_unit(value: f64, unit: &str) -> String {
    format!("{} {unit}", number(value)).trim_end().to_owned()
}

fn trouble(kind: Kind, recording: usize, output: usize, sentence: String) -> Trouble {
    Trouble {
        kind,
        recording,
        output,
        left_out: Vec::new(),
        numbers: Vec::new(),
        sentence,
    }
}

pub(super) fn identical(log: &Log, recording: usize, output: usize, simulated: usize) -> Trouble {
    let name = &log.outputs[output].name;
    let what = if simulated == output {
        format!("the simulated {name}")
    } else {
        format!("the simulated {}", log.outputs[simulated].name)
    };
    trouble(
        Kind::Identical,
        recording,
        output,
        format!(
            "Warning: {what} is identical to the recorded {name} of {} in all samples, noise included: it is a copy of the recording itself, not a simulation of it.",
            log.name
        ),
    )
}

pub(super) fn swapped(log: &Log, i: usize, j: usize) -> Trouble {
    let (a, b) = (&log.outputs[i].name, &log.outputs[j].name);
    trouble(
        Kind::Swapped,
        0,
        i,
        format!(
            "The outputs {a} and {b} are swapped: the recorded {a} follows the simulated {b}, and the recorded {b} the simulated {a}. They are exchanged in everything that follows."
        ),
    )
}

pub(super) fn wrapped(
    log: &Log,
    recording: usize,
    output: usize,
    wraps: &(Option<Wrap>, Option<Wrap>),
) -> Trouble {
    let name = &log.outputs[output].name;
    let unit = unit_of(log, output);
    let (who, wrap) = match wraps {
        (Some(wrap), None) => (name.clone(), Some(wrap)),
        (None, Some(wrap)) => (format!("The simulated {name}"), Some(wrap)),
        (a, _) => (format!("{name}, recorded and simulated,"), a.as_ref()),
    };
    let (period, count, first) = wrap.map_or((0.0, 0, 0), |w| {
        (
            w.period,
            w.jumps.len(),
            w.jumps.first().copied().unwrap_or(0),
        )
    });
    let mut found = trouble(
        Kind::Wrap,
        recording,
        output,
        format!(
            "{who} wraps at every {} ({count} times, first at {} s): it starts again after each turn. Its turns are counted in everything that follows.",
            with_unit(period, unit),
            number(time(log, first))
        ),
    );
    found.numbers = vec![
        Number::new("period", period, unit),
        Number::new("count", count as f64, ""),
        Number::new("first", time(log, first), "s"),
    ];
    found
}

/// A sign, a unit, or both.
pub(super) fn related(log: &Log, output: usize, relation: &Relation) -> Vec<Trouble> {
    let name = &log.outputs[output].name;
    let mut found = Vec::new();
    if relation.reversed {
        let mut sign = trouble(
            Kind::Sign,
            0,
            output,
            format!(
                "The sign of {name} is reversed: the recording is minus what was simulated. The simulation is compared with its sign changed{}.",
                if relation.offset == 0.0 {
                    String::new()
                } else {
                    format!(
                        ", shifted by {}",
                        with_unit(relation.offset, unit_of(log, output))
                    )
                }
            ),
        );
        sign.numbers = vec![Number::new("factor", -1.0, "")];
        found.push(sign);
    }
    if let Some(unit) = &relation.unit {
        let factor = relation.factor.abs();
        let shift = if relation.reversed || relation.offset == 0.0 {
            String::new()
        } else {
            format!(" plus {}", number(relation.offset))
        };
        let mut said = trouble(
            Kind::Unit,
            0,
            output,
            format!(
                "Units: {name} is recorded in another unit than it was simulated in. The recording is {} times the simulation{shift} ({unit}); the simulation is converted in everything that follows.",
                number(factor)
            ),
        );
        said.numbers = vec![Number::new("factor", factor, "")];
        found.push(said);
    }
    found
}

pub(super) fn drifts(log: &Log, recording: usize, drift: Drift, of_recording: bool) -> Trouble {
    // Of the clock at fault, in seconds a second of the other.
    let rate = 1.0 / (1.0 + drift.rate) - 1.0;
    let length = log.samples() as f64 * log.sample_time;
    let lag = rate.abs() * length;
    let (who, other) = if of_recording {
        ("the recorded outputs", "inputs and simulation")
    } else {
        ("the simulation", "the recording")
    };
    // An output that shows what the other shows later has a clock that is slow.
    let slow = if of_recording { rate > 0.0 } else { rate < 0.0 };
    let rate = if slow { -rate.abs() } else { rate.abs() };
    let mut found = trouble(
        Kind::Clock,
        recording,
        0,
        format!(
            "The clock (time base) of {who} is {:.3} % {}: it {} {other} by {} s over the {} s of the recording. The time base is corrected in everything that follows.",
            100.0 * rate.abs(),
            if slow { "slow" } else { "fast" },
            if slow {
                "falls behind"
            } else {
                "runs ahead of"
            },
            number(lag),
            number(length)
        ),
    );
    found.numbers = vec![
        Number::new("rate", rate, "s/s"),
        Number::new("lag_at_end", lag, "s"),
    ];
    found
}

/// Dropouts and outliers of one output beside its simulation.
pub(super) fn gross(
    log: &Log,
    simulated: &[f64],
    (recording, output): (usize, usize),
    gross: &Gross,
) -> Vec<Trouble> {
    let name = &log.outputs[output].name;
    let unit = unit_of(log, output);
    let count = |runs: &[Range<usize>]| runs.iter().map(ExactSizeIterator::len).sum::<usize>();
    let first = |runs: &[Range<usize>]| time(log, runs.first().map_or(0, |r| r.start));
    let mut list = Vec::new();
    if let Some((value, runs)) = &gross.dropouts {
        let lengths = runs.iter().map(ExactSizeIterator::len);
        let (least, most) = (
            lengths.clone().min().unwrap_or(0),
            lengths.max().unwrap_or(0),
        );
        let lengths = if least == most {
            format!("runs of {most}")
        } else {
            format!("runs of {least} to {most}")
        };
        let mut found = trouble(
            Kind::Dropout,
            recording,
            output,
            format!(
                "{name} drops out: it reads {} in {} samples ({lengths}), first at {} s; they are left out of everything that follows.",
                with_unit(*value, unit),
                count(runs),
                number(first(runs))
            ),
        );
        found.numbers = vec![
            Number::new("value", *value, unit),
            Number::new("count", count(runs) as f64, ""),
            Number::new("first", first(runs), "s"),
        ];
        found.left_out = runs.clone();
        list.push(found);
    }
    if !gross.outliers.is_empty() {
        let runs = &gross.outliers;
        // From what stands beside them.
        let filled = super::gross::filled(&log.output_data[output], simulated, runs.iter());
        let largest = runs
            .iter()
            .map(|r| log.output_data[output][r.start] - filled[r.start])
            .max_by(|a, b| a.abs().total_cmp(&b.abs()))
            .unwrap_or(0.0);
        let noun = if runs.len() == 1 {
            "sample is an isolated outlier"
        } else {
            "samples are isolated outliers"
        };
        let mut found = trouble(
            Kind::Outliers,
            recording,
            output,
            format!(
                "{name}: {} {noun}, off by {} at most, first at {} s; left out of everything that follows.",
                runs.len(),
                with_unit(largest.abs(), unit),
                number(first(runs))
            ),
        );
        found.numbers = vec![
            Number::new("count", runs.len() as f64, ""),
            Number::new("largest", largest, unit),
            Number::new("first", first(runs), "s"),
        ];
        found.left_out = runs.clone();
        list.push(found);
    }
    list
}
