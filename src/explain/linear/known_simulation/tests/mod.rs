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
    let simulator = know(&Checked {
        recordings: vec![log],
        simulation,
        troubles: Vec::new(),
        interpolated: false,
    });
    let Ok(Simulator::Linear(known)) = simulator else {
        panic!("{simulator:?}");
    };
    let theta = known.structure.given();
    let found = known.structure.simulate(&theta, &known.data).unwrap();
    for ((found, expected), level) in found.iter().zip(&expected).zip(y0) {
        let size = expected.iter().fold(level.abs(), |m, v| m.max(v.abs()));
        for (a, b) in found.iter().zip(expected) {
            assert!((a - b - level).abs() < ROUNDING * size, "{a} {b} {level}");
        }
    }
}

#[test]
fn a_long_recording_is_cut_to_where_it_moves_furthest() {
    let n = 5 * MOST_SAMPLES / 2;
    let busy = 13_000..13_700;
    // About an operating point, which is no motion.
    let wave =
        |k: usize| 300.0 + if busy.contains(&k) { 5.0 } else { 1.0 } * (0.01 * k as f64).sin();
    let segment = |samples: usize| Segment {
        inputs: vec![(0..samples).map(|k| k as f64).collect()],
        outputs: vec![(0..samples).map(wave).collect()],
        start_time: 40.0,
    };
    let data = |segments: Vec<Segment>| Data {
        segments,
        sample_time: 0.5,
        inputs: 1,
        outputs: 1,
        constant: false,
    };
    let mut long = data(vec![segment(n)]);
    trimmed(&mut long);
    let kept = &long.segments[0];
    assert_eq!(kept.samples(), MOST_SAMPLES);
    // Inputs stay beside their outputs, and the clock with both.
    let from = kept.inputs[0][0];
    assert!(
        from <= busy.start as f64 && from + MOST_SAMPLES as f64 >= busy.end as f64,
        "{from}"
    );
    assert_eq!(kept.start_time, 40.0 + 0.5 * from);
    for (k, (u, y)) in kept.inputs[0].iter().zip(&kept.outputs[0]).enumerate() {
        assert_eq!((*u, *y), (from + k as f64, wave(from as usize + k)));
    }
    // What happens at the very end counts as what happens elsewhere.
    let mut late = data(vec![segment(MOST_SAMPLES + MOST_SAMPLES / 4 + 7)]);
    let end = late.segments[0].samples();
    late.segments[0].outputs[0][end - 1] += 20.0;
    trimmed(&mut late);
    assert_eq!(late.segments[0].inputs[0].last(), Some(&(end as f64 - 1.0)));
    // A tenth further is further.
    let mut slightly = data(vec![segment(n)]);
    for (k, y) in slightly.segments[0].outputs[0].iter_mut().enumerate() {
        let size = if k < 13_000 { 1.0 } else { 1.1 };
        *y = size * (0.01 * k as f64).sin();
    }
    trimmed(&mut slightly);
    assert!(slightly.segments[0].inputs[0].last().copied() > Some(13_000.0));
    // A quarter more is not worth a cut; and several share what there is.
    let mut short = data(vec![segment(MOST_SAMPLES + MOST_SAMPLES / 4)]);
    trimmed(&mut short);
    assert_eq!(short.segments[0].samples(), MOST_SAMPLES + MOST_SAMPLES / 4);
    assert_eq!(short.segments[0].start_time, 40.0);
    let mut two = data(vec![segment(n), segment(900)]);
    trimmed(&mut two);
    let samples: Vec<usize> = two.segments.iter().map(Segment::samples).collect();
    assert_eq!(samples, [MOST_SAMPLES / 2, 900]);
}
