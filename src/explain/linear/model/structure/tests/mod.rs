use approx::assert_abs_diff_eq;

use super::*;
use crate::explain::effects;
use crate::explain::linear::model::continuous::moment_columns;

const N: usize = 60;
const STEP: f64 = 0.1;

/// Two outputs, two inputs, three states, in coordinates of its own.
fn coordinates() -> Arc<Coordinates> {
    let plant = Plant {
        states: 3,
        inputs: 2,
        outputs: 2,
        a: vec![0.9, 0.1, 0.0, -0.2, 0.8, 0.1, 0.05, 0.0, 0.7],
        b: vec![0.0, 0.3, 1.0, 0.0, 0.2, 0.5],
        c: vec![1.0, 0.0, 0.0, 0.0, 0.0, 1.0],
        d: vec![0.01, 0.02, 0.03, 0.04],
        sample_time: STEP,
    };
    Arc::new(Coordinates::new(&plant))
}

fn instance(id: &str, variant: &str, channel: usize) -> Instance {
    Instance {
        definition: effects::find(id, variant).unwrap(),
        channel,
        signal: Signal::Output(0),
        direction: Direction::Matched(1),
    }
}

fn structure(effects: Vec<Instance>) -> Structure {
    Structure {
        coordinates: coordinates(),
        plant_free: true,
        initial_free: true,
        initial: vec![vec![0.1, 0.2, 0.3], vec![-0.4, 0.5, 0.6]],
        feedthrough_free: true,
        substeps: 1,
        recording: None,
        effects,
        known: Vec::new(),
        adjusted: 0,
    }
}

fn data() -> Data {
    let segment = |phase: f64| Segment {
        inputs: vec![
            (0..N).map(|k| (0.7 * k as f64 + phase).sin()).collect(),
            (0..N).map(|k| (0.23 * k as f64).cos()).collect(),
        ],
        outputs: vec![vec![0.0; N]; 2],
        start_time: 1.0,
    };
    Data {
        segments: vec![segment(0.0), segment(1.0)],
        sample_time: STEP,
        inputs: 2,
        outputs: 2,
        constant: false,
    }
}

/// The recursion as it is written in books, with a force `w(x, x without it, u)` through `direction`.
fn written_out(
    plant: &Plant,
    x0: &[f64],
    inputs: &Series,
    direction: &[f64],
    w: impl Fn(&[f64], &[f64], &[f64]) -> f64,
) -> Series {
    let (n, r) = (plant.states, plant.inputs);
    let mut x = x0.to_vec();
    let mut outputs = vec![Vec::new(); plant.outputs];
    for k in 0..inputs[0].len() {
        let u: Vec<f64> = inputs.iter().map(|u| u[k]).collect();
        for (o, y) in outputs.iter_mut().enumerate() {
            let state: f64 = (0..n).map(|i| plant.c[o * n + i] * x[i]).sum();
            let direct: f64 = (0..r).map(|j| plant.d[o * r + j] * u[j]).sum();
            y.push(state + direct);
        }
        let free: Vec<f64> = (0..n)
            .map(|i| {
                let state: f64 = (0..n).map(|j| plant.a[i * n + j] * x[j]).sum();
                let input: f64 = (0..r).map(|j| plant.b[i * r + j] * u[j]).sum();
                state + input
            })
            .collect();
        let force = w(&x, &free, &u);
        x = free
            .iter()
            .zip(direction)
            .map(|(x, b)| x + b * force)
            .collect();
    }
    outputs
}

fn same(found: &[Vec<f64>], wanted: &[Vec<f64>]) {
    assert_eq!(found.len(), wanted.len());
    for (found, wanted) in found.iter().flatten().zip(wanted.iter().flatten()) {
        assert_abs_diff_eq!(*found, *wanted, epsilon = 1e-10);
    }
}

#[test]
fn numbers_stand_in_their_places() {
    let lag = instance("actuator_lag", "", 0);
    let spring = instance("cubic_stiffness", "", 0);
    let mode = instance("extra_mode", "", 1);
    let all = structure(vec![lag, spring, mode]);
    // A of one row an output, B, two initial states, D; a time; an amplitude; frequency, damping and residues.
    assert_eq!(all.linear_len(), 2 * 3 + 2 * 3 + 2 * 3 + 4);
    assert_eq!(all.len(), all.linear_len() + 1 + 1 + 2 + 4);
    let mut theta = all.given();
    assert_eq!(theta.len(), all.linear_len());
    assert_eq!(all.plant(&theta), coordinates().given);
    assert_eq!(all.initial_state(&theta, 1), [-0.4, 0.5, 0.6]);
    theta.extend([
        0.3_f64.ln(),
        2.0,
        4.0_f64.ln(),
        0.1_f64.ln(),
        1.0,
        2.0,
        3.0,
        4.0,
    ]);
    assert_eq!(all.bounds().len(), all.len());
    assert_abs_diff_eq!(all.shape(&theta, 0)[0], 0.3, epsilon = 1e-12);
    assert_eq!(all.effect_numbers(&theta, 1), [2.0]);
    assert!(all.shape(&theta, 1).is_empty());
    assert_abs_diff_eq!(all.shape(&theta, 2)[0], 4.0, epsilon = 1e-12);
    assert_eq!(all.effect_numbers(&theta, 2)[2..], [1.0, 2.0, 3.0, 4.0]);
    // Every number of the plant moves the plant, every one of the initial states a state, and none another thing.
    for i in 0..all.linear_len() {
        let mut moved = theta.clone();
        moved[i] += 0.01;
        let of_plant = all.plant(&moved) != all.plant(&theta);
        let of_state = (0..2).any(|s| all.initial_state(&moved, s) != all.initial_state(&theta, s));
        assert!(of_plant != of_state, "{i}");
        assert_eq!(of_state, (12..18).contains(&i), "{i}");
    }
    // Held, they are those of the simulation.
    let held = Structure {
        plant_free: false,
        initial_free: false,
        ..all.clone()
    };
    assert_eq!(held.linear_len(), 0);
    assert!(held.given().is_empty());
    assert_eq!(held.plant(&[]), coordinates().given);
    assert_eq!(held.initial_state(&[], 0), [0.1, 0.2, 0.3]);
}

#[test]
fn a_simulation_is_the_recursion() {
    let data = data();
    let spring = instance("cubic_stiffness", "", 0);
    let gain = instance("input_gain", "", 0);
    let offset = instance("sensor_offset", "", 1);
    let free = structure(vec![spring, gain, offset]);
    let mut theta = free.given();
    theta.extend([0.005, -0.2, 0.7]);
    let simulated = free.simulate(&theta, &data).unwrap();
    let plant = &coordinates().given;
    // The force resists: it enters with the sign that slows what the input drives.
    let rows = Functionals::new(plant);
    let signal = rows.of(plant, Signal::Output(0));
    let sign = matched_sign(plant, &signal.forward, 1);
    let direction: Vec<f64> = plant.b_column(1).iter().map(|b| sign * 0.005 * b).collect();
    for (s, segment) in data.segments.iter().enumerate() {
        let mut inputs = segment.inputs.clone();
        inputs[0].iter_mut().for_each(|u| *u *= 0.8);
        let position =
            |x: &[f64], u: &[f64]| dot(&signal.position, x) + dot(&signal.position_feedthrough, u);
        let mut wanted = written_out(
            plant,
            &free.initial[s],
            &inputs,
            &direction,
            // In the middle of the interval, where it has moved that itself.
            |x, free, u| {
                let middle = 0.5 * (position(x, u) + position(free, u));
                let gain = 0.5 * dot(&signal.position, &direction);
                (0..60).fold(0.0, |f: f64, _| -(middle + gain * f).powi(3))
            },
        );
        wanted[1].iter_mut().for_each(|y| *y += 0.7);
        same(&simulated[2 * s..2 * s + 2], &wanted);
    }
    // A position is what the output shows.
    assert_abs_diff_eq!(signal.position[0], plant.c[0], epsilon = 1e-12);
}

#[test]
fn a_mode_and_a_sine_stand_beside_the_plant() {
    let data = data();
    let (frequency, damping) = (1.3, 0.2);
    let mode = structure(vec![instance("extra_mode", "", 1)]);
    let mut theta = mode.given();
    let without = structure(Vec::new()).simulate(&theta, &data).unwrap();
    theta.extend([f64::ln(frequency), f64::ln(damping), 1.0, 0.0, 0.5, -2.0]);
    let simulated = mode.simulate(&theta, &data).unwrap();
    // exp of the continuous pole over an interval, as a rotation that shrinks.
    let w = std::f64::consts::TAU * frequency;
    let pole = num_complex::Complex64::new(-damping * w, w * (1.0 - damping * damping).sqrt());
    let p = (pole * STEP).exp();
    for s in 0..2 {
        let mut q = num_complex::Complex64::ZERO;
        for k in 0..N {
            let seen = |o: usize| simulated[2 * s + o][k] - without[2 * s + o][k];
            assert_abs_diff_eq!(seen(0), q.re, epsilon = 1e-10);
            assert_abs_diff_eq!(seen(1), 0.5 * q.re - 2.0 * q.im, epsilon = 1e-10);
            q = p * q + (1.0 - p.norm()) * data.segments[s].inputs[1][k];
        }
    }

    let sine = structure(vec![instance("periodic_disturbance", "", 0)]);
    let mut theta = sine.given();
    theta.extend([f64::ln(frequency), 0.3, -0.1, 2.0, 0.0]);
    let simulated = sine.simulate(&theta, &data).unwrap();
    for k in 0..N {
        let t = 1.0 + STEP * k as f64;
        let wanted = 0.3 * (w * t).cos() - 0.1 * (w * t).sin();
        assert_abs_diff_eq!(simulated[0][k] - without[0][k], wanted, epsilon = 1e-9);
        assert_abs_diff_eq!(
            simulated[3][k] - without[3][k],
            2.0 * (w * t).cos(),
            epsilon = 1e-9
        );
    }
    // On a new input the recording's disturbance is over.
    let fresh = sine
        .simulate_fresh(&theta, &data.segments[0], STEP, &sine.initial[0])
        .unwrap();
    same(&fresh, &without[..2]);
}

/// A plant between samples follows an input that moves there: a lag is that of a plant with the lag's state, sampled.
#[test]
fn moments_are_what_moves_within_an_interval() {
    // An integrator of an integrator: what a lag does within an interval is known in closed form.
    let h = STEP;
    let plant = Plant {
        states: 2,
        inputs: 1,
        outputs: 1,
        a: vec![1.0, h, 0.0, 1.0],
        b: vec![0.5 * h * h, h],
        c: vec![1.0, 0.0],
        d: vec![0.0],
        sample_time: h,
    };
    let lagging = Structure {
        initial: vec![vec![0.0; 2]],
        plant_free: false,
        initial_free: false,
        feedthrough_free: false,
        coordinates: Arc::new(Coordinates::new(&plant)),
        ..structure(vec![Instance {
            direction: Direction::Matched(0),
            ..instance("actuator_lag", "", 0)
        }])
    };
    // Steps to 1 after the first sample: u(t) = 1 - exp(-t/tau) from there on.
    let tau = 0.07;
    let segment = Segment {
        inputs: vec![(0..N).map(|k| f64::from(u8::from(k > 0))).collect()],
        outputs: vec![vec![0.0; N]],
        start_time: 0.0,
    };
    let data = Data {
        segments: vec![segment],
        sample_time: h,
        inputs: 1,
        outputs: 1,
        constant: false,
    };
    let y = lagging.simulate(&[f64::ln(tau)], &data).unwrap();
    for (k, y) in y[0].iter().enumerate().skip(1) {
        let t = (k - 1) as f64 * h;
        let wanted = 0.5 * t * t - tau * t + tau * tau * (1.0 - (-t / tau).exp());
        assert_abs_diff_eq!(*y, wanted, epsilon = 1e-9);
    }
}

/// What passes through does so once: the moments add to the state alone.
#[test]
fn moments_do_not_pass_through() {
    let plant = coordinates().given.clone();
    let wider = with_moments(&plant);
    assert_eq!((wider.inputs, wider.states), (6, 3));
    let columns = moment_columns(&plant);
    for (i, row) in wider.b.chunks_exact(6).enumerate() {
        assert_eq!(row[..2], plant.b[2 * i..2 * i + 2]);
        for degree in 0..2 {
            let of = |input: usize| columns[input][degree][i];
            assert_eq!(row[2 + 2 * degree..4 + 2 * degree], [of(0), of(1)]);
        }
    }
    for (row, direct) in wider.d.chunks_exact(6).zip([[0.01, 0.02], [0.03, 0.04]]) {
        assert_eq!((&row[..2], &row[2..]), (&direct[..], &[0.0; 4][..]));
    }
}

/// A drift belongs to the recording it was found in; an offset stays.
#[test]
fn what_does_not_persist_is_not_in_a_fresh_recording() {
    for (id, persists) in [("sensor_drift", false), ("sensor_offset", true)] {
        let sensor = structure(vec![instance(id, "", 0)]);
        let mut theta = sensor.given();
        theta.push(0.3);
        let prepared = sensor.prepare(&theta);
        let mut without = theta.clone();
        *without.last_mut().unwrap() = 0.0;
        let segment = data().segments.swap_remove(0);
        for fresh in [false, true] {
            let clock = Clock {
                start: 1.0,
                step: STEP,
                fresh,
            };
            let run = |theta: &[f64]| {
                sensor
                    .simulate_segment(theta, &prepared, &segment, &[0.1, 0.2, 0.3], &clock)
                    .unwrap()
            };
            let (with, plain) = (run(&theta), run(&without));
            let differs = with[0].iter().zip(&plain[0]).any(|(a, b)| a != b);
            assert_eq!(differs, persists || !fresh, "{id} {fresh}");
            assert_eq!(with[1], plain[1]);
        }
    }
}
