//! Simulation of a plant in equations: state updates per second. Rules: `benches/README.md`.
//!
//! A state update is one state advanced over one sample. With sensitivities its derivatives with respect to all ten parameters
//! are advanced too, and count nothing by themselves.

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use innovant::physics::{Direction, Excitation, Hold, Plant, parse};

fn main() {
    divan::main();
}

const SAMPLES: usize = 20_000;
const SAMPLE_TIME: f64 = 1e-3;

/// Five states, ten parameters, one input.
fn plant() -> Plant {
    Plant::new(parse(include_str!("two_masses.mo")).expect("the text is right"))
}

/// A sine that is held over each sample, as a controller's output is.
fn voltage() -> Vec<f64> {
    (0..SAMPLES)
        .map(|k| 6.0 * (3.0 * k as f64 * SAMPLE_TIME).sin())
        .collect()
}

fn run(bencher: Bencher, hold: Hold, with_sensitivities: bool) {
    let plant = plant();
    let point = plant.nominal();
    let column = voltage();
    let inputs = [column.as_slice()];
    let excitation = Excitation {
        inputs: &inputs,
        length: SAMPLES,
        sample_time: SAMPLE_TIME,
        start_time: 0.0,
        hold,
    };
    let directions: Vec<Direction> = (0..point.parameters.len())
        .map(Direction::Parameter)
        .collect();
    let states = plant.spec.states().len();
    bencher
        .counter(ItemsCount::new(states * SAMPLES))
        .bench_local(|| {
            let run = plant
                .simulate(&point, &excitation, None)
                .expect("the plant can be simulated");
            if with_sensitivities {
                black_box(plant.sensitivities(&point, &excitation, None, &run.plan, &directions));
            }
            run
        });
}

#[divan::bench(sample_count = 20)]
fn held_input(bencher: Bencher) {
    run(bencher, Hold::Zero, false);
}

#[divan::bench(sample_count = 20)]
fn held_input_and_ten_sensitivities(bencher: Bencher) {
    run(bencher, Hold::Zero, true);
}

#[divan::bench(sample_count = 20)]
fn linear_input(bencher: Bencher) {
    run(bencher, Hold::Linear, false);
}

#[divan::bench(sample_count = 20)]
fn linear_input_and_ten_sensitivities(bencher: Bencher) {
    run(bencher, Hold::Linear, true);
}
