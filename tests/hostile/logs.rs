//! Small numeric logs: constants, ramps, steps, noise, copies, answers of a plant, and samples that are no numbers.

use innovant::log::{Channel, Log, LogError};

use super::bytes::Bytes;

/// Most samples of a recording.
pub const MOST_SAMPLES: usize = 200;

/// Columns of equal length, some of them made of those before.
pub fn columns(bytes: &mut Bytes, count: usize, samples: usize) -> Vec<Vec<f64>> {
    let mut columns: Vec<Vec<f64>> = Vec::with_capacity(count);
    for _ in 0..count {
        let mut column = column(bytes, &columns, samples);
        let size = bytes.byte();
        if size >= 224 {
            let factor = 10_f64.powi(2 * i32::from(bytes.byte() as i8));
            column.iter_mut().for_each(|v| *v *= factor);
        }
        if size % 8 == 7 {
            let offset = bytes.finite();
            column.iter_mut().for_each(|v| *v += offset);
        }
        if size % 16 == 6 && samples > 0 {
            let at = bytes.below(samples);
            column[at] = bytes.number();
        }
        columns.push(column);
    }
    columns
}

fn column(bytes: &mut Bytes, before: &[Vec<f64>], samples: usize) -> Vec<f64> {
    let kind = bytes.below(12);
    let earlier = before.len().checked_sub(1).map(|last| {
        let which = bytes.below(last + 1);
        before[which].clone()
    });
    match (kind, earlier) {
        (0..=2, None) | (3, _) => white(u64::from(bytes.byte()), samples),
        // A plant of first order that answers to an earlier column, and noise.
        (0..=2, Some(input)) => {
            let (pole, noise) = (f64::from(bytes.byte() as i8) / 120.0, bytes.byte());
            let size = f64::from(noise) / 256.0;
            let mut state = 0.0;
            input
                .iter()
                .zip(white(u64::from(noise), samples))
                .map(|(u, e)| {
                    let y = state + size * e;
                    state = pole * state + u;
                    y
                })
                .collect()
        }
        (4, Some(earlier)) => {
            let (gain, offset) = (bytes.finite(), bytes.finite());
            earlier.iter().map(|v| gain * v + offset).collect()
        }
        (5, _) => vec![bytes.number(); samples],
        (6, _) => {
            let slope = bytes.finite();
            (0..samples).map(|k| slope * k as f64).collect()
        }
        (7, _) => {
            let (at, size) = (bytes.below(MOST_SAMPLES), bytes.finite());
            (0..samples)
                .map(|k| if k < at { 0.0 } else { size })
                .collect()
        }
        (8, _) => {
            let (at, size) = (bytes.below(MOST_SAMPLES), bytes.number());
            (0..samples)
                .map(|k| if k == at { size } else { 0.0 })
                .collect()
        }
        (9, _) => {
            let turn = f64::from(bytes.byte()) / 40.0;
            (0..samples).map(|k| (turn * k as f64).sin()).collect()
        }
        (10, _) => (0..samples)
            .map(|_| f64::from(bytes.byte() as i8))
            .collect(),
        _ => {
            let values: Vec<f64> = (0..1 + bytes.below(8)).map(|_| bytes.number()).collect();
            (0..samples).map(|k| values[k % values.len()]).collect()
        }
    }
}

/// Uniform noise between -1 and 1, from a multiplicative generator (L'Ecuyer 1999).
pub fn white(seed: u64, samples: usize) -> Vec<f64> {
    let mut state = seed.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    (0..samples)
        .map(|_| {
            state = state
                .wrapping_mul(2_862_933_555_777_941_757)
                .wrapping_add(1);
            (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        })
        .collect()
}

/// `u1`, `u2`, ...
pub fn named(letter: char, count: usize) -> Vec<Channel> {
    (1..=count)
        .map(|i| Channel::new(format!("{letter}{i}")))
        .collect()
}

/// A recording with so many channels, or why it is none.
pub fn log(
    bytes: &mut Bytes,
    inputs: usize,
    outputs: usize,
    samples: usize,
    sample_time: f64,
) -> Result<Log, LogError> {
    let mut data = columns(bytes, inputs + outputs, samples);
    let numbers = data.iter().flatten().all(|v| v.is_finite());
    let answers = data.split_off(inputs);
    let made = Log::from_columns(
        "run",
        sample_time,
        named('u', inputs),
        named('y', outputs),
        data,
        answers,
    );
    if !numbers {
        assert!(made.is_err(), "samples that are no numbers were taken");
    }
    made
}

/// A sample time, mostly a sensible one.
pub fn sample_time(bytes: &mut Bytes) -> f64 {
    match bytes.byte() {
        0..=191 => 0.1,
        192..=223 => 10_f64.powi(i32::from(bytes.byte() as i8) / 10),
        _ => bytes.number(),
    }
}
