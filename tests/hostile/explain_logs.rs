//! `explain` on arbitrary small logs and simulations.

use innovant::Model;
use innovant::explain::{Options, Simulation, explain};
use innovant::internal::effects::library;
use innovant::log::Log;
use innovant::report::parse_model;
use serde_json::json;

use super::bytes::Bytes;
use super::logs::{MOST_SAMPLES, log, sample_time, white};
use super::{explanation_json, sound};

/// Recordings around the shortest that are explained, and a simulation that may be anything: an explanation that can be
/// written and simulated on, or a reason.
pub fn explain_log(bytes: &[u8]) {
    let mut bytes = Bytes::new(bytes);
    let (inputs, outputs) = (
        bytes.one_of(&[1, 1, 1, 2, 0]),
        bytes.one_of(&[1, 1, 1, 2, 0]),
    );
    let samples = match bytes.byte() {
        // Enough to be explained, mostly.
        0..=223 => 150 + bytes.below(MOST_SAMPLES - 149),
        _ => bytes.below(MOST_SAMPLES + 1),
    };
    let time = sample_time(&mut bytes);
    let options = Options {
        without: bytes
            .maybe(|bytes| {
                let ids: Vec<&str> = library().map(|d| d.id).chain(["nothing"]).collect();
                bytes.one_of(&ids).to_owned()
            })
            .into_iter()
            .collect(),
        seed: u64::from(bytes.byte()),
    };
    let plant = bytes
        .flag()
        .then(|| plant(&mut bytes, inputs, outputs, time))
        .flatten();
    let mut log = match log(&mut bytes, inputs, outputs, samples, time) {
        Ok(log) => log,
        Err(error) => return sound::refusal(&error),
    };
    let simulation = match plant {
        Some(model) => {
            // The recording is mostly what the model says, changed somehow, and noise.
            if bytes.byte() < 192 {
                answer(&mut log, &model, &mut bytes);
            }
            Simulation::Model(Box::new(model), "model".to_owned())
        }
        None => {
            let columns = super::logs::columns(&mut bytes, outputs, samples);
            let given = Log {
                output_data: columns,
                ..log.clone()
            };
            Simulation::Outputs(vec![given])
        }
    };
    match explain(&[log], &simulation, &options) {
        Ok(explanation) => {
            assert!((0.0..=1.0).contains(&explanation.probability));
            explanation_json::explanation(&explanation);
        }
        Err(error) => sound::refusal(&error),
    }
}

/// A model of up to two states.
fn plant(bytes: &mut Bytes, inputs: usize, outputs: usize, sample_time: f64) -> Option<Model> {
    let n = 1 + bytes.below(2);
    let mut matrix = |rows: usize, columns: usize, size: f64| -> Vec<Vec<f64>> {
        (0..rows)
            .map(|_| {
                (0..columns)
                    .map(|_| match bytes.byte() {
                        255 => bytes.finite(),
                        small => size * f64::from(small as i8) / 128.0,
                    })
                    .collect()
            })
            .collect()
    };
    let document = json!({
        "A": matrix(n, n, 1.0), "B": matrix(n, inputs, 4.0), "C": matrix(outputs, n, 4.0), "dt": sample_time,
    });
    parse_model("model.json", &document.to_string())
        .ok()
        .map(|read| read.model)
}

/// Replaces the recorded outputs by the model's answer to the recorded inputs after a law that no model holds.
fn answer(log: &mut Log, model: &Model, bytes: &mut Bytes) {
    let (law, size) = (bytes.below(4), f64::from(bytes.byte()) / 256.0);
    let inputs: Vec<Vec<f64>> = log
        .input_data
        .iter()
        .map(|u| {
            u.iter()
                .map(|u| match law {
                    0 => u.clamp(-size, size),
                    1 => u + size * u.signum(),
                    2 => u + size * u * u,
                    _ => *u,
                })
                .collect()
        })
        .collect();
    let columns: Vec<&[f64]> = inputs.iter().map(Vec::as_slice).collect();
    let Ok(outputs) = model.simulate(&columns, None) else {
        return;
    };
    let noise = f64::from(bytes.byte()) / 4096.0;
    let samples = log.samples();
    let made: Vec<Vec<f64>> = outputs
        .into_iter()
        .map(|y| {
            y.iter()
                .zip(white(9, samples))
                .map(|(y, e)| y + noise * e)
                .collect()
        })
        .collect();
    if made.iter().flatten().all(|v: &f64| v.is_finite()) {
        log.output_data = made;
    }
}
