//! What is known of a simulation, against the model that it was given as.

use super::*;
use crate::identify::{Options, Order, identify};
use crate::systems;

/// Largest difference allowed between two ways of the same sums, relative to the largest output.
const ROUNDING: f64 = 1e-10;

#[test]
fn a_model_simulates_about_its_operating_points() {
    let (u0, y0) = ([3.0, -40.0], [250.0, 0.7]);
    let mut log = systems::two_by_two().record(600, 3);
    let about = log.clone();
    let levels = u0.iter().chain(&y0);
    for (column, level) in log
        .input_data
        .iter_mut()
        .chain(&mut log.output_data)
        .zip(levels)
    {
        column.iter_mut().for_each(|v| *v += level);
    }
    let options = Options {
        order: Order::Fixed(3),
        ..Options::default()
    };
    let mut model = identify(std::slice::from_ref(&log), &options).unwrap();
    for (channel, level) in model.inputs.iter_mut().zip(u0) {
        channel.level = level;
    }
    for (channel, level) in model.outputs.iter_mut().zip(y0) {
        channel.level = level;
    }
    // All four paths, so that a transposed matrix is seen.
    model.system.d.copy_from_slice(&[0.2, -0.5, 0.9, 0.4]);

    let inputs: Vec<&[f64]> = about.input_data.iter().map(Vec::as_slice).collect();
    let expected = model.system.simulate(&inputs, None).unwrap();
    let simulation = Simulation::Model(Box::new(model), "model".to_owned());
    let known = know(&[log], &simulation).unwrap();
    let theta = known.structure.given();
    let found = known.structure.simulate(&theta, &known.data).unwrap();
    for ((found, expected), level) in found.iter().zip(&expected).zip(y0) {
        let size = expected.iter().fold(level.abs(), |m, v| m.max(v.abs()));
        for (a, b) in found.iter().zip(expected) {
            assert!((a - b - level).abs() < ROUNDING * size, "{a} {b} {level}");
        }
    }
}
