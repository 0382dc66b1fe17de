//! What an answer says in numbers - where, when, how large, how certain - of recordings that were made for it.

use innovant::explain::{Explanation, Options, Simulation, Verdict, explain};
use innovant::log::{Channel, Log};
use innovant::model::StateSpace;
use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

const SAMPLES: usize = 1200;
const SAMPLE_TIME: f64 = 0.1;
/// Time of the first sample: a recording rarely begins at zero.
const START: f64 = 20.0;
/// Standard deviation of the noise at either output.
const NOISE: f64 = 0.05;

/// A mass on a spring, seen by two sensors.
fn plant() -> StateSpace {
    StateSpace {
        a: DMatrix::from_row_slice(2, 2, &[0.95, 0.09, -0.9, 0.85]),
        b: DMatrix::from_row_slice(2, 1, &[0.005, 0.09]),
        c: DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 0.4, 0.25]),
        d: DMatrix::zeros(2, 1),
        k: DMatrix::zeros(2, 2),
        sample_time: SAMPLE_TIME,
    }
}

fn log(name: &str, input: Vec<f64>, outputs: Vec<Vec<f64>>) -> Log {
    let channel = |name: &str| Channel {
        name: name.to_owned(),
        unit: None,
    };
    Log {
        name: name.to_owned(),
        sample_time: SAMPLE_TIME,
        start_time: START,
        inputs: vec![channel("u")],
        outputs: vec![channel("a"), channel("b")],
        input_data: vec![input],
        output_data: outputs,
        sha256: None,
    }
}

/// What is said of the plant with white noise and what `change` does to its outputs.
fn said(seed: u64, change: impl Fn(&mut [Vec<f64>])) -> Explanation {
    explained(seed, |_| (), change)
}

/// What is said of the plant with white noise when `change` is made of the input on its way to it.
fn said_of(seed: u64, change: impl Fn(&mut [f64])) -> Explanation {
    explained(seed, change, |_| ())
}

fn explained(
    seed: u64,
    before: impl Fn(&mut [f64]),
    behind: impl Fn(&mut [Vec<f64>]),
) -> Explanation {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut white = |size: f64| -> Vec<f64> {
        (0..SAMPLES)
            .map(|_| size * random.sample::<f64, _>(StandardNormal))
            .collect()
    };
    let input = white(4.0);
    let simulated = plant().simulate(&[&input], None).unwrap();
    let mut effective = input.clone();
    before(&mut effective);
    let mut recorded = plant().simulate(&[&effective], None).unwrap();
    for column in &mut recorded {
        for (y, e) in column.iter_mut().zip(white(NOISE)) {
            *y += e;
        }
    }
    behind(&mut recorded);
    let simulation = Simulation::Outputs(vec![log("simulation", input.clone(), simulated)]);
    explain(
        &[log("recording", input, recorded)],
        &simulation,
        &Options::default(),
    )
    .unwrap()
}

#[test]
fn a_frozen_sensor_is_said_in_the_recordings_time() {
    let (from, to) = (300, 340);
    let answer = said(1, |y| {
        let held = y[1][from];
        y[1][from..to].fill(held);
    });
    assert_eq!(answer.verdict, Verdict::Named, "{:?}", answer.summary);
    assert_eq!(answer.effects.len(), 1);
    let found = &answer.effects[0];
    assert_eq!(
        (found.effect.as_str(), found.signal.as_str()),
        ("sensor_freeze", "b")
    );
    let time = |k: usize| START + SAMPLE_TIME * k as f64;
    for (name, at) in [("from", time(from)), ("to", time(to))] {
        let said = found.parameters[name].value;
        assert!(
            (said - at).abs() < 1.5 * SAMPLE_TIME,
            "{name}: {said} for {at}"
        );
    }
    let [begins, ends, _] = answer.location.time[0];
    assert!((begins - time(from)).abs() < 1.5 * SAMPLE_TIME);
    assert!((ends - time(to)).abs() < 1.5 * SAMPLE_TIME);
    assert_eq!(answer.location.port.as_deref(), Some("output"));
}

#[test]
fn amplitudes_at_each_output_are_as_certain_as_white_noise_allows() {
    // Least squares of a sinusoid in white noise: 2 s^2 / N (Kay 1993, example 3.14).
    let expected = NOISE * (2.0 / SAMPLES as f64).sqrt();
    let amplitudes = [0.03, 0.06];
    let mut squares = 0.0;
    let runs = 4;
    for seed in 0..runs {
        let answer = said(10 + seed, |y| {
            for (column, amplitude) in y.iter_mut().zip(amplitudes) {
                for (k, y) in column.iter_mut().enumerate() {
                    *y += amplitude
                        * (0.9 * SAMPLE_TIME * std::f64::consts::TAU * k as f64 + 0.3).sin();
                }
            }
        });
        assert_eq!(answer.verdict, Verdict::Named, "{:?}", answer.summary);
        let found = &answer.effects[0];
        assert_eq!(found.effect, "periodic_disturbance");
        // The output that shows it most, over its noise.
        assert_eq!(found.signal, "b");
        // What is there all the time is the same in either half: the farthest of a few numbers.
        let apart = found.evidence.halves_disagree.unwrap();
        assert!(apart < 4.5, "{apart}");
        for (name, truth) in [("amplitude_a", 0.03), ("amplitude_b", 0.06)] {
            let amplitude = &found.parameters[name];
            let std = amplitude.std.unwrap();
            assert!(
                (0.8..1.4).contains(&(std / expected)),
                "{name}: {std} for {expected}"
            );
            squares += ((amplitude.value - truth) / std).powi(2);
        }
    }
    // Chi-squared with 8 degrees of freedom: between its quantiles 0.1 % and 99.9 %.
    assert!((0.86..26.2).contains(&squares), "{squares}");
}

#[test]
fn what_begins_at_some_time_is_not_compared_across_halves() {
    let begins = 500;
    let answer = said_of(2, |u| {
        u[begins..].iter_mut().for_each(|u| *u *= 1.3);
    });
    assert_eq!(answer.verdict, Verdict::Named, "{:?}", answer.summary);
    let found = &answer.effects[0];
    assert_eq!(found.effect, "gain_change");
    assert_eq!(found.signal, "u");
    assert_eq!(found.evidence.halves_disagree, None);
    let from = START + SAMPLE_TIME * begins as f64;
    let time = &found.parameters["from"];
    let off = (time.value - from) / time.std.unwrap();
    assert!(off.abs() < 4.0 && time.std.unwrap() < 1.0, "{time:?}");
    let change = &found.parameters["change"];
    let std = change.std.unwrap();
    assert!(
        (change.value - 0.3).abs() < 4.0 * std && std < 0.01,
        "{change:?}"
    );
}

/// A spring is a function of a way, or makes a plant oscillate: what a warm body loses is none, whatever its unit.
#[test]
fn a_loss_of_a_plant_that_does_not_oscillate_is_no_spring() {
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let input: Vec<f64> = (0..3000 / 60)
        .flat_map(|_| std::iter::repeat_n(100.0 * random.random::<f64>(), 60))
        .collect();
    let run = |loss: f64| -> Vec<f64> {
        let mut warm = 0.0_f64;
        let each = input.iter().map(|u| {
            let now = warm;
            for _ in 0..10 {
                warm += 0.01 * (u - 0.5 * warm - loss * warm * warm.abs());
            }
            now
        });
        each.collect()
    };
    let recorded: Vec<f64> = run(0.002)
        .iter()
        .map(|y| y + 0.1 * random.sample::<f64, _>(StandardNormal))
        .collect();
    for (unit, expected) in [
        (None, "law"),
        (Some("K"), "law"),
        (Some("mm"), "quadratic_stiffness"),
    ] {
        let mut logs =
            [("simulation", run(0.0)), ("recording", recorded.clone())].map(|(name, y)| {
                let mut log = log(name, input.clone(), vec![y]);
                log.outputs.truncate(1);
                log.outputs[0].unit = unit.map(str::to_owned);
                log
            });
        let [simulated, recording] = &mut logs;
        let found = explain(
            std::slice::from_ref(recording),
            &Simulation::Outputs(vec![simulated.clone()]),
            &Options::default(),
        )
        .unwrap();
        assert_eq!(found.verdict, Verdict::Named, "{:?}", found.summary);
        assert_eq!(found.effects[0].effect, expected, "{:?}", found.summary);
        assert_eq!(found.effects[0].depends.is_empty(), expected != "law");
    }
}
