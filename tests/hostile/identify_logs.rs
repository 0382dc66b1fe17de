//! `identify` on arbitrary small logs with arbitrary options.

use innovant::identify::Detrend;
use innovant::identify::{
    CovarianceKind, Method, Options, Order, Polish, Stochastic, Weight, identify,
};
use innovant::log::Log;

use super::bytes::Bytes;
use super::logs::{MOST_SAMPLES, log, sample_time};
use super::sound;

/// One or two recordings, and options within bounds and far out of them: a sound model comes back, or a reason.
pub fn identify_log(bytes: &[u8]) {
    let mut bytes = Bytes::new(bytes);
    let options = options(&mut bytes);
    let (inputs, outputs) = (bytes.below(4), bytes.below(4));
    let samples = bytes.below(MOST_SAMPLES + 1);
    let time = sample_time(&mut bytes);
    let mut logs: Vec<Log> = Vec::new();
    for _ in 0..1 + bytes.below(2) {
        match log(&mut bytes, inputs, outputs.min(4 - inputs), samples, time) {
            Ok(log) => logs.push(log),
            Err(error) => sound::refusal(&error),
        }
    }
    run(&logs, &options);
}

/// Identifies and holds the answer to its word.
pub fn run(logs: &[Log], options: &Options) {
    match identify(logs, options) {
        Ok(model) => {
            let numbers = |m: &nalgebra::DMatrix<f64>| m.iter().all(|v| v.is_finite());
            assert!(model.innovation_covariance.as_ref().is_some_and(numbers));
            assert!(
                model
                    .covariance
                    .as_ref()
                    .is_some_and(|c| numbers(&c.matrix))
            );
            assert!(model.initial_state.iter().all(|v| v.is_finite()));
            assert!(
                model
                    .inputs
                    .iter()
                    .chain(&model.outputs)
                    .all(|c| c.level.is_finite())
            );
            assert!(model.summary.is_some());
            sound::model(&model);
        }
        Err(error) => sound::refusal(&error),
    }
}

/// What a flag that takes a count is given: mostly a size that can be met.
fn size(bytes: &mut Bytes) -> usize {
    match bytes.byte() {
        small @ 0..=231 => usize::from(small) % 16,
        _ => bytes.count(),
    }
}

/// What `fuzz/run.sh` allows in one piece.
const MEMORY: u64 = 256 << 20;

fn options(bytes: &mut Bytes) -> Options {
    if bytes.byte() < 64 {
        return Options::default();
    }
    Options {
        method: bytes.one_of(Method::all()),
        stochastic: bytes.maybe(|bytes| bytes.one_of(Stochastic::all())),
        order: match bytes.below(4) {
            0 => Order::Auto,
            1 => {
                let count = bytes.below(5);
                Order::Compare((0..count).map(|_| size(bytes)).collect())
            }
            _ => Order::Fixed(size(bytes)),
        },
        past: bytes.maybe(size),
        future: bytes.maybe(size),
        weight: bytes.maybe(|bytes| bytes.one_of(&[Weight::Identity, Weight::Cva])),
        polish: bytes.one_of(&[Polish::Auto, Polish::Always, Polish::Never]),
        covariance: bytes.one_of(&[CovarianceKind::Model, CovarianceKind::Robust]),
        detrend: bytes.one_of(&[Detrend::Mean, Detrend::Linear, Detrend::None]),
        feedthrough: bytes.flag(),
        input_delay: {
            let count = bytes.below(4);
            (0..count).map(|_| size(bytes)).collect()
        },
        stable: bytes.flag(),
        seed: bytes.word(),
        memory_limit: Some(MEMORY),
    }
}
