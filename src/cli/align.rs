//! Simulated outputs on the samples of the recording that they belong to, by time.

use crate::log::{Log, Reading};

/// How far a sample of the simulation may be from one of the recording, in samples, and still be taken as it is.
const SAME_TIME: f64 = 0.01;
/// How much coarser than the recording a simulation may be, relative: clocks are rounded.
const SAME_STEP: f64 = 1e-3;
/// Fewer common samples are left out.
const SHORTEST: usize = 20;

/// A recording and its simulation on the same samples.
pub(super) type Pair = (Log, Log);

/// Pairs of what `recording` and `simulated` have in common, and what is to be said of the rest.
///
/// # Errors
/// They do not overlap, or the simulation is coarser than the recording.
pub(super) fn aligned(
    recording: &Reading,
    simulated: &Reading,
) -> anyhow::Result<(Vec<Pair>, Option<String>)> {
    let (name, other) = (name(recording), name(simulated));
    let (shift, mut said) = shift(recording, simulated);
    let mut pairs = Vec::new();
    let (mut lost, mut between) = (0, false);
    for log in &recording.logs {
        let step = log.sample_time;
        if let Some(coarse) = simulated
            .logs
            .iter()
            .find(|s| s.sample_time > step * (1.0 + SAME_STEP))
        {
            anyhow::bail!(
                "{other}: the simulation has a sample every {} s and {name} every {step} s; simulate at the recording's \
                 sample time or a shorter one, or bring the recording to it with --resample {}",
                coarse.sample_time,
                coarse.sample_time
            );
        }
        let before = pairs.len();
        for simulation in &simulated.logs {
            let start = simulation.start_time + shift;
            let ratio = step / simulation.sample_time;
            let first = (log.start_time - start) / simulation.sample_time;
            let last = (simulation.samples() - 1) as f64 + SAME_TIME * ratio;
            // Samples of the recording that the simulation covers.
            let from = ((-first - SAME_TIME * ratio) / ratio).ceil().max(0.0) as usize;
            let to =
                (((last - first) / ratio).floor() + 1.0).clamp(0.0, log.samples() as f64) as usize;
            if to < from + SHORTEST.min(log.samples()) {
                continue;
            }
            let places: Vec<f64> = (from..to).map(|k| first + k as f64 * ratio).collect();
            let rows =
                (ratio - 1.0).abs() <= SAME_STEP && (first - first.round()).abs() <= SAME_TIME;
            between |= !rows
                && places
                    .iter()
                    .any(|at| (at - at.round()).abs() > SAME_TIME * ratio);
            let output_data = simulation
                .output_data
                .iter()
                .map(|column| {
                    // Two clocks of one rate that are rounded differently still count the same samples.
                    let at = |(k, place): (usize, &f64)| match rows {
                        true => value(column, first.round() + (from + k) as f64),
                        false => value(column, *place),
                    };
                    places.iter().enumerate().map(at).collect()
                })
                .collect();
            let part = part(log, from, to);
            let simulation = Log {
                start_time: part.start_time,
                sample_time: part.sample_time,
                inputs: Vec::new(),
                input_data: Vec::new(),
                output_data,
                ..simulation.clone()
            };
            pairs.push((part, simulation));
        }
        let kept: usize = pairs
            .iter()
            .skip(before)
            .map(|(log, _)| log.samples())
            .sum();
        lost += log.samples() - kept.min(log.samples());
    }
    if pairs.is_empty() {
        let span = |reading: &Reading, shift: f64| {
            let from = reading.logs.first().map_or(f64::NAN, |l| l.start_time) + shift;
            let to = reading.logs.last().map_or(f64::NAN, |l| {
                l.start_time + (l.samples() - 1) as f64 * l.sample_time
            });
            format!("{from} s to {} s", to + shift)
        };
        anyhow::bail!(
            "{other}: the simulation does not overlap with the recording in time: it goes from {}, and {name} from {}; \
             simulate the recorded time, or give the sample time with --dt, which counts rows in both",
            span(simulated, shift),
            span(recording, 0.0)
        );
    }
    if lost > 0 {
        said.push(format!(
            "{lost} samples of {name} are outside of the simulation's time and left out"
        ));
    }
    if between {
        said.push("interpolated between its samples at the times of the recording".to_owned());
    }
    Ok((pairs, (!said.is_empty()).then(|| said.join("; "))))
}

fn name(reading: &Reading) -> String {
    reading
        .logs
        .first()
        .map_or_else(String::new, |log| match log.name.split_once(" [part ") {
            Some((name, _)) => name.to_owned(),
            None => log.name.clone(),
        })
}

/// Seconds to add to the simulation's time. Dates are compared with dates; a simulation that counts from its start belongs
/// to the start of a recording with dates.
fn shift(recording: &Reading, simulated: &Reading) -> (f64, Vec<String>) {
    let start = |reading: &Reading| reading.logs.first().map_or(0.0, |log| log.start_time);
    match (&recording.origin, &simulated.origin) {
        (Some(a), Some(b)) => (b.since(a), Vec::new()),
        (None, None) => (0.0, Vec::new()),
        _ => (
            start(recording) - start(simulated),
            vec!["only one of recording and simulation has dates: both are taken to begin at the same time".to_owned()],
        ),
    }
}

fn value(column: &[f64], place: f64) -> f64 {
    let place = place.clamp(0.0, column.len().saturating_sub(1) as f64);
    let (at, share) = (place.floor() as usize, place.fract());
    let get = |at: usize| column.get(at).copied();
    let here = get(at).unwrap_or(f64::NAN);
    // Rounded stamps do not make a value of its own.
    if share < 1e-9 {
        here
    } else {
        here + share * (get(at + 1).unwrap_or(here) - here)
    }
}

fn part(log: &Log, from: usize, to: usize) -> Log {
    if from == 0 && to == log.samples() {
        return log.clone();
    }
    let cut = |data: &[Vec<f64>]| {
        data.iter()
            .map(|c| c.get(from..to).unwrap_or_default().to_vec())
            .collect()
    };
    Log {
        start_time: log.start_time + from as f64 * log.sample_time,
        input_data: cut(&log.input_data),
        output_data: cut(&log.output_data),
        ..log.clone()
    }
}
