//! A mass on a spring, effects on it, and recordings of both, for tests.

use std::sync::Arc;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::data::{Data, Segment};
use super::model::coordinates::Coordinates;
use super::model::functionals::Signal;
use super::model::linear_plant::Plant;
use super::model::structure::{Direction, Instance, Structure};
use crate::explain::effects;

/// Samples of a recording.
pub(crate) const SAMPLES: usize = 800;
pub(crate) const SAMPLE_TIME: f64 = 0.1;
/// Standard deviation of its noise.
pub(crate) const NOISE: f64 = 0.05;

/// An effect at the only input and output.
pub(crate) fn effect(id: &str, variant: &str) -> Instance {
    Instance {
        definition: effects::find(id, variant).unwrap(),
        channel: 0,
        signal: Signal::Output(0),
        direction: Direction::Matched(0),
    }
}

/// A mass on a spring.
pub(crate) fn plant() -> Plant {
    Plant {
        states: 2,
        inputs: 1,
        outputs: 1,
        a: vec![0.95, 0.09, -0.9, 0.85],
        b: vec![0.005, 0.09],
        c: vec![1.0, 0.0],
        d: vec![0.0],
        sample_time: SAMPLE_TIME,
    }
}

/// [`plant`] as given, and effects on it.
pub(crate) fn spring(effects: Vec<Instance>) -> Structure {
    Structure {
        coordinates: Arc::new(Coordinates::new(&plant())),
        plant_free: false,
        initial_free: false,
        initial: vec![vec![0.0; 2]],
        feedthrough_free: false,
        substeps: 1,
        recording: None,
        effects,
        known: Vec::new(),
        adjusted: 0,
    }
}

/// What `structure` does at `theta` when it is driven by white noise, and noise.
pub(crate) fn recorded(structure: &Structure, theta: &[f64], seed: u64) -> Data {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || -> f64 { random.sample(StandardNormal) };
    let mut data = Data {
        segments: vec![Segment {
            inputs: vec![(0..SAMPLES).map(|_| 2.0 * normal()).collect()],
            outputs: vec![vec![0.0; SAMPLES]],
            start_time: 0.0,
        }],
        sample_time: SAMPLE_TIME,
        inputs: 1,
        outputs: 1,
        constant: false,
    };
    let mut y = structure.simulate(theta, &data).unwrap();
    y[0].iter_mut().for_each(|y| *y += NOISE * normal());
    data.segments[0].outputs = y;
    data
}
